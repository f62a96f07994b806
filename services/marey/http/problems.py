"""Every error as an RFC 9457 problem, with a stable `type`."""

from __future__ import annotations

import types
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any, Union, get_args, get_origin

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.routing import Match

from marey.core.documents import json_problem
from marey.core.errors import (
    TYPE_PREFIX,
    Busy,
    InvalidInput,
    MareyError,
    NotFound,
    Overloaded,
    QuotaUsedUp,
    Unauthenticated,
    Unreachable,
)
from marey.core.validation import problem_of
from marey.items.problems import InvalidItems
from marey.tenants import QuotaHeadroom

MEDIA_TYPE = "application/problem+json"
RETRY_AFTER = "2"
"""Seconds: typical restart of a database or store."""

OF_THE_REQUEST = ("body", "prompts")
"""Prefixes of locations that a caller knows: they are part of the request."""
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE")
UNIONS = (Union, types.UnionType)

log = structlog.get_logger(__name__)


class FieldProblem(BaseModel):
    """One problem of a request."""

    line: int | None = Field(default=None, description="Line of the body, from 1; for `items`, the element's number.")
    field: str | None = Field(
        default=None, description="Path of the field, as `motions.0`: elements of lists are counted from 0."
    )
    message: str


class QuotaBody(BaseModel):
    """A quota and the requested amount; items or bytes."""

    name: str
    limit: int
    used: int
    left: int
    asked: int

    @classmethod
    def of(cls, found: QuotaHeadroom | QuotaUsedUp) -> QuotaBody:
        """Convert a headroom or a refusal."""
        return cls(name=found.quota, limit=found.limit, used=found.used, left=found.left, asked=found.asked)


class ProblemBody(BaseModel):
    """RFC 9457."""

    type: str = Field(description=f"Stable: `{TYPE_PREFIX}` and a name such as `invalid-input`.")
    title: str
    status: int
    detail: str = Field(description="What is wrong.")
    where: str | None = Field(default=None, description="Field, file or object that the problem concerns.")
    hint: str | None = Field(default=None, description="How to resolve it.")
    problems: list[FieldProblem] | None = Field(default=None, description="The first 1,000 problems.")
    total: int | None = Field(default=None, description="Total number of problems.")
    quota: QuotaBody | None = Field(default=None, description="Of `quota`: which one, and what is left.")


RESPONSES: dict[int | str, dict[str, Any]] = {
    code: {"description": "Problem", "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/ProblemBody"}}}}
    for code in ("4XX", "5XX")
}
"""Problem responses that every route may return."""


def public_error(error: MareyError) -> MareyError:
    """Return the part of an error that clients may see.

    Faults of the server may name its hosts, files and settings, and reach callers without a key: these learn what is
    down, never where or how. The log has the error itself.
    """
    if error.status < 500:
        return error
    if isinstance(error, Overloaded):
        return error
    if isinstance(error, Unreachable):
        public = error.public or "a dependency of this server does not answer"
        where = error.where if error.where in OF_THE_REQUEST else None
        return Unreachable(public, where=where, hint="Try again in a moment; the server's log says more.")
    return MareyError("an internal error; the server's log says more")


def problem_body(error: MareyError) -> ProblemBody:
    """Return the problem document of an expected error."""
    error = public_error(error)
    body = ProblemBody(
        type=TYPE_PREFIX + error.problem_type,
        title=error.problem_type.replace("-", " ").capitalize(),
        status=error.status,
        detail=_clean(error.message) or "",
        where=_clean(error.where),
        hint=_clean(error.hint),
    )
    if isinstance(error, InvalidItems):
        body.total = error.total
        body.problems = [
            FieldProblem(line=p.line, field=_clean(p.field), message=_clean(p.message) or "") for p in error.problems
        ]
    if isinstance(error, QuotaUsedUp):
        body.quota = QuotaBody.of(error)
    return body


def problem_response(error: MareyError) -> JSONResponse:
    """Return the answer to a request that failed with this error."""
    body = problem_body(error)
    headers: dict[str, str] = {}
    if isinstance(error, Unauthenticated):
        headers["WWW-Authenticate"] = 'Bearer realm="marey"'
    if isinstance(error, Unreachable):
        headers["Retry-After"] = RETRY_AFTER
    if isinstance(error, Busy | Overloaded):
        headers["Retry-After"] = str(error.seconds)
    return JSONResponse(
        body.model_dump(mode="json", exclude_none=True), error.status, headers=headers, media_type=MEDIA_TYPE
    )


def install(app: FastAPI) -> None:
    """Register handlers that answer problems for Marey's errors, for requests FastAPI refuses, and for bugs."""

    @app.exception_handler(MareyError)
    def _expected(_: Request, error: MareyError) -> JSONResponse:
        if error.status >= 500:
            log.warning("request_failed", error=str(error))
        return problem_response(error)

    @app.exception_handler(RequestValidationError)
    def _invalid(request: Request, error: RequestValidationError) -> JSONResponse:
        return _validation(request, error)

    @app.exception_handler(HTTPException)
    def _http(request: Request, error: HTTPException) -> JSONResponse:
        return _of_status(request, error)

    @app.exception_handler(Exception)
    def _bug(_: Request, error: Exception) -> JSONResponse:
        log.error("internal_error", exc_info=error)
        return problem_response(MareyError("internal"))


def _validation(request: Request, error: RequestValidationError) -> JSONResponse:
    body_model = _body_model(request)
    problems = [_field_problem(e, body_model) for e in error.errors()]
    names = ", ".join(dict.fromkeys(p.field or "body" for p in problems))
    many = len(problems) > 1  # for a single one, `where` names the field
    body = ProblemBody(
        type=TYPE_PREFIX + InvalidInput.problem_type,
        title="Invalid input",
        status=InvalidInput.status,
        detail="; ".join(f"{p.field or 'body'}: {p.message}" if many else p.message for p in problems[:5]),
        where=names,
        problems=problems[:1000],
        total=len(problems),
    )
    return JSONResponse(body.model_dump(mode="json", exclude_none=True), InvalidInput.status, media_type=MEDIA_TYPE)


def _of_status(request: Request, error: HTTPException) -> JSONResponse:
    if error.status_code == NotFound.status:
        return problem_response(NotFound("there is nothing at this path", where=_clean(request.url.path)))
    if error.status_code == HTTPStatus.BAD_REQUEST:  # FastAPI's, for a body that `json` cannot read
        cause = error.__cause__
        known = isinstance(cause, ValueError | RecursionError)
        message = f"the body {json_problem(cause) if known else 'cannot be read'}"
        return problem_response(InvalidInput(message, where="body", hint="Send JSON in UTF-8."))
    phrase = HTTPStatus(error.status_code).phrase
    headers = dict(error.headers or {})
    body = ProblemBody(
        type=TYPE_PREFIX + phrase.lower().replace(" ", "-"),
        title=phrase,
        status=error.status_code,
        detail=_clean(str(error.detail)) or phrase,
    )
    if error.status_code == HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = ", ".join(_allowed(request))
        body.detail = f"{_clean(request.method)} is not a method of this path"
        body.where = _clean(request.url.path)
        body.hint = f"Allowed: {headers['Allow']}."
    return JSONResponse(
        body.model_dump(mode="json", exclude_none=True), error.status_code, headers=headers, media_type=MEDIA_TYPE
    )


def _allowed(request: Request) -> list[str]:
    """Return the methods that the routes of the request's path have. The header that comes with the exception has those
    of one route."""
    given = {name: request.scope[name] for name in ("path", "root_path", "headers")}
    asked = {method: {"type": "http", "method": method, **given} for method in METHODS}
    routes = request.app.routes
    return [name for name, scope in asked.items() if any(each.matches(scope)[0] is Match.FULL for each in routes)]


def _body_model(request: Request) -> Any:
    """Return the model of the route's body; None if it has no body, or parses it itself."""
    route = request.scope.get("route")
    body = route.body_field if isinstance(route, APIRoute) else None
    return None if body is None else body.field_info.annotation


def known_fields(body_model: Any, path: Sequence[object]) -> tuple[str, ...]:
    """Return the names of the fields beside one of a body; none where it is not in a model.

    Args:
        body_model: type of the body.
        path: of the field in the body.
    """
    kind = body_model
    for part in path[:-1]:
        kind = _inner(kind, part)
    return tuple(kind.model_fields) if _is_model(kind) else ()


def _inner(kind: Any, part: object) -> Any:
    """Return the type of a field of a model, or of the elements of a list or object; None of others."""
    if _is_model(kind):
        field = kind.model_fields.get(part)
        found = None if field is None else field.annotation
    else:
        found = get_args(kind)[-1] if get_origin(kind) in (list, dict) else None
    options = [each for each in get_args(found) if each is not type(None)] if get_origin(found) in UNIONS else [found]
    return options[0] if len(options) == 1 else None


def _is_model(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, BaseModel)


def _field_problem(error: Mapping[str, Any], body_model: Any) -> FieldProblem:
    """Convert one of pydantic's errors. `("query", "limit")` becomes `limit`: the prefix means nothing to a client."""
    place, *path = error["loc"]
    if error["type"] == "json_invalid":  # its path is a position
        return FieldProblem(
            field=str(place), message=f"is not JSON: {error['ctx']['error']} at character {path[0] + 1}"
        )
    if place == "query":
        path = path[:1]  # a repeated parameter has no numbers
    field = ".".join(str(part) for part in path) or str(place)
    message = problem_of(error, known_fields(body_model, path))
    return FieldProblem(field=_clean(field), message=_clean(message) or "")


def _clean(text: str | None) -> str | None:
    """Return text that UTF-8 can encode: a lone surrogate of a request must not break its error answer."""
    return None if text is None else text.encode("utf-8", "backslashreplace").decode()
