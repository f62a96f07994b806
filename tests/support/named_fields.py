"""A check for schemathesis: an answer that refuses what was sent names the field that is wrong."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Set
from typing import Any

import requests
from schemathesis import Case, Response
from schemathesis.checks import CheckContext
from schemathesis.schemas import APIOperation

from marey.http.queries import LONGEST_NAME

REFUSALS = (400, 409, 413, 415, 422)
OF_ANY = {"body", "query", "content-type", "content-encoding", "content-length"}
OF_PYDANTIC = re.compile(
    r"\b(Input|String|Value|List|Dictionary|Tuple) should\b|Value error|Extra inputs|should match pattern"
)


_declared: dict[str, frozenset[str]] = {}
"""By the label of an operation: see `_of_operation`."""


def names_the_field(_context: CheckContext, response: Response, case: Case) -> None:
    """Fail unless each problem names a parameter, a header, or a field of the body as sent or as documented, in words
    that are not those of pydantic."""
    if response.status_code not in REFUSALS:
        return
    problem = json.loads(response.content)
    told = problem.get("problems") or [{"field": name} for name in (problem.get("where") or "").split(", ")]
    assert problem["detail"], problem
    assert not OF_PYDANTIC.search(response.text), problem
    of_state = response.status_code == 409 or problem["type"].endswith(":idempotency-mismatch")
    known = _of_operation(case.operation) | {name[:LONGEST_NAME].lower() for name in case.query or {}}
    unknown = [each for each in told if not _is_named(each, known, of_state)]
    if unknown:  # the body is read only if it may hold the name
        known |= {name.lower() for name in _sent(response.request)}
    for each in unknown:
        assert _is_named(each, known, of_state), f"{each} names no field of the request: {problem}"


def _is_named(told: dict[str, Any], known: Set[str], of_state: bool) -> bool:
    """Return True if a problem names a line or one of the known fields.

    Args:
        of_state: the problem is about what stands there: it names its kind and id.
    """
    field = told.get("field")
    if field is None:
        return told.get("line") is not None
    path = field.lower()
    missing = bool(field) and told.get("message", "").startswith("is missing")  # perhaps of one that is free in form
    return (of_state and bool(field)) or _leads(path, known) or (missing and _leads(path.rpartition(".")[0], known))


def _leads(path: str, known: Set[str]) -> bool:
    """Return True if a dotted path consists of known names and numbers of elements."""
    if path in known or path.isdecimal():
        return True
    head = next((name for name in known if name and path.startswith(name + ".")), None)
    if head is None:
        first, dot, rest = path.partition(".")
        return bool(dot) and first.isdecimal() and _leads(rest, known)
    return _leads(path[len(head) + 1 :], known)


def _of_operation(operation: APIOperation[Any, Any, Any, Any]) -> frozenset[str]:
    """Return what an operation declares: its parameters, and the properties of its bodies at any depth."""
    if operation.label not in _declared:
        names = {parameter.name for parameter in operation.iter_parameters()}
        for body in operation.body:
            names.update(_properties(body.definition), _properties(body.optimized_schema))
        _declared[operation.label] = frozenset(name.lower() for name in OF_ANY | names)
    return _declared[operation.label]


def _properties(schema: Any) -> Iterator[str]:
    if isinstance(schema, dict):
        if isinstance(schema.get("properties"), dict):
            yield from schema["properties"]
        for value in schema.values():
            yield from _properties(value)
    elif isinstance(schema, list):
        for value in schema:
            yield from _properties(value)


def _sent(request: requests.PreparedRequest) -> Iterator[str]:
    """Names in the body, also as a message shows those that hold what cannot be printed."""
    content = request.body if isinstance(request.body, bytes) else (request.body or "").encode()
    for line in dict.fromkeys((content, *content.split(b"\n"))):
        try:
            document = json.loads(line)
        except (ValueError, RecursionError):
            continue
        for key in _keys(document):
            yield key.encode("utf-8", "backslashreplace").decode()
            yield ascii(key)[1:41].strip("'")


def _keys(document: Any) -> Iterator[str]:
    if isinstance(document, dict):
        yield from document
    for value in document.values() if isinstance(document, dict) else document if isinstance(document, list) else ():
        yield from _keys(value)
