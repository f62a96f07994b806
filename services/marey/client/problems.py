"""Problems of the API as the errors that were raised on the server."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import httpx2

from marey.client.foreign_answers import foreign_answer
from marey.core.errors import (
    TYPE_PREFIX,
    Busy,
    Conflict,
    InvalidBundle,
    InvalidFile,
    InvalidInput,
    MareyError,
    NotFound,
    Overloaded,
    QuotaUsedUp,
    Refused,
    TimedOut,
    TooLarge,
    TooSlow,
    Unauthenticated,
    Unreachable,
)
from marey.items.problems import InvalidItems, OutOfScope, Problem

_QUOTA = QuotaUsedUp.problem_type
NOT_OURS = (ValueError, KeyError, TypeError, AttributeError, RecursionError)
"""Errors of reading an answer that is not the API's; the last one is raised by JSON that is nested too deeply."""

_ERRORS: dict[str, type[MareyError]] = {
    kind.problem_type: kind
    for kind in (
        InvalidInput, TooLarge, InvalidFile, InvalidBundle, Conflict, NotFound, Unreachable, Refused, Unauthenticated,
        TimedOut, TooSlow,
    )
}  # fmt: skip


def error_of(response: httpx2.Response) -> MareyError:
    """Return the error of an RFC 9457 problem, as it was raised on the server."""
    try:
        return error_of_problem(response.json(), response.status_code, retry_seconds(response))
    except NOT_OURS:
        return foreign_error(response)


def error_of_problem(problem: Mapping[str, Any], status: int, retry_after: float = 0.0) -> MareyError:
    """Return the error of a problem of the API.

    Args:
        retry_after: seconds.

    Raises:
        ValueError, KeyError, TypeError, AttributeError: it is not a problem of the API.
    """
    kind = str(problem["type"]).removeprefix(TYPE_PREFIX)
    message, where, hint = str(problem["detail"]), problem.get("where"), problem.get("hint")
    if kind == InvalidItems.problem_type:
        found = [_problem(each) for each in problem.get("problems", [])]
        return InvalidItems(found, total=problem.get("total"))
    if kind == OutOfScope.problem_type:
        found = [_problem(each) for each in problem.get("problems", [])]
        return OutOfScope(found, total=problem.get("total"), hint=hint or "")
    if kind == Overloaded.problem_type:
        return Overloaded(message, where=where, hint=hint, seconds=round(retry_after))
    if kind == _QUOTA and (quota := problem.get("quota")) is not None:
        sizes = {name: int(quota[name]) for name in ("limit", "used", "asked")}
        seconds = round(retry_after)
        return QuotaUsedUp(message, where=where, hint=hint, seconds=seconds, quota=str(quota["name"]), **sizes)
    if kind in (Busy.problem_type, _QUOTA):
        return Busy(message, where=where, hint=hint, seconds=round(retry_after))
    error = _ERRORS.get(kind) or (InvalidInput if status < 500 else MareyError)
    return error(message, where=where, hint=hint)


def _problem(found: Mapping[str, Any]) -> Problem:
    """Read one of the problems of items."""
    line = found.get("line")
    return Problem(None if line is None else int(line), found.get("field"), str(found["message"]))


def is_busy(response: httpx2.Response) -> bool:
    """Return True if the server is busy: a rate limit, or too many large requests at once."""
    return response.status_code == Busy.status or (
        response.status_code == Overloaded.status and f"{TYPE_PREFIX}{Overloaded.problem_type}" in response.text
    )


def is_quota(response: httpx2.Response) -> bool:
    """Return True for a quota: unlike a rate it takes minutes, or an operator, so the error is raised at once."""
    return response.status_code == Busy.status and f"{TYPE_PREFIX}{_QUOTA}" in response.text


def retry_seconds(response: httpx2.Response) -> float:
    """Return the seconds of `Retry-After`, at most 60; 0 without it, or if it is a date."""
    try:
        return min(float(response.headers.get("Retry-After", 0)), 60.0)
    except ValueError:
        return 0.0


def foreign_error(response: httpx2.Response) -> MareyError:
    """Return the error of an answer that is not the API's."""
    where = str(response.request.url.copy_with(query=None))
    return foreign_answer(response.status_code, response.headers.get, response.text[:2000], where)
