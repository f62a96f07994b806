"""A check for schemathesis: an answer that refuses what was sent names the field that is wrong."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from typing import Any

import requests
from schemathesis import Case, Response
from schemathesis.checks import CheckContext

from marey.http.queries import LONGEST_NAME

REFUSALS = (400, 409, 413, 415, 422)
OF_ANY = {"body", "query", "content-type", "content-encoding", "content-length"}
OF_PYDANTIC = re.compile(
    r"\b(Input|String|Value|List|Dictionary|Tuple) should\b|Value error|Extra inputs|should match pattern"
)


def names_the_field(_context: CheckContext, response: Response, case: Case) -> None:
    """Fail unless each problem names a parameter, a header, or a field of the body as sent or as documented, in words
    that are not those of pydantic."""
    if response.status_code not in REFUSALS:
        return
    problem = json.loads(response.content)
    known = {name.lower() for name in (*OF_ANY, *_parameters(case), *_documented(case), *_sent(response.request))}
    told = problem.get("problems") or [{"field": name} for name in (problem.get("where") or "").split(", ")]
    assert problem["detail"], problem
    assert not OF_PYDANTIC.search(response.text), problem
    for each in told:
        field, line = each.get("field"), each.get("line")
        named = line is not None if field is None else _leads(field.lower(), known)
        if field and each.get("message", "").startswith("is missing"):  # of an element that is free in form
            named = named or _leads(field.lower().rpartition(".")[0], known)
        if response.status_code == 409 or problem["type"].endswith(":idempotency-mismatch"):
            named = named or bool(field)  # about what stands there: its kind and id
        assert named, f"{field!r} (line {line}) is no field of the request: {problem}"


def _leads(path: str, known: set[str]) -> bool:
    """Return True if a dotted path consists of known names and numbers of elements."""
    if path in known or path.isdecimal():
        return True
    head = next((name for name in known if name and path.startswith(name + ".")), None)
    if head is None:
        first, dot, rest = path.partition(".")
        return bool(dot) and first.isdecimal() and _leads(rest, known)
    return _leads(path[len(head) + 1 :], known)


def _parameters(case: Case) -> Iterator[str]:
    for parameter in case.operation.iter_parameters():
        yield parameter.name
    for name in case.query or {}:  # also one that the route does not know
        yield name[:LONGEST_NAME]


def _documented(case: Case) -> Iterator[str]:
    """Names of the properties of its bodies, at any depth."""
    for body in case.operation.body:
        yield from _properties(body.definition)
        yield from _properties(body.optimized_schema)


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
    for line in (content, *content.split(b"\n")):
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
