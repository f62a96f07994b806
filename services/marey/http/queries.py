"""Validation of query parameters: a misspelt filter would otherwise return everything."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, get_args, get_origin

from fastapi.dependencies.models import Dependant
from fastapi.dependencies.utils import get_flat_params
from fastapi.params import ParamTypes
from fastapi.routing import APIRoute
from starlette.requests import HTTPConnection

from marey.core.errors import InvalidInput
from marey.core.suggestions import did_you_mean

LONGEST_NAME = 60


async def known_query(asked: HTTPConnection) -> None:
    """Dependency of every route: `check_query`, except for routes with a key, where authentication comes first
    (`auth`)."""
    route = asked.scope.get("route")
    if isinstance(route, APIRoute) and not _wants_key(route.dependant):
        check_query(asked)


def check_query(asked: HTTPConnection) -> None:
    """Validate that the route knows every query parameter of the request, and that those of one value have one: of two,
    the last would count. Sockets check their own.

    Raises:
        InvalidInput: an unknown parameter, or one that is given twice.
    """
    route = asked.scope.get("route")
    if not asked.query_params or not isinstance(route, APIRoute):
        return
    params = get_flat_params(route.dependant)
    asks = {each.alias: each.field_info for each in params if getattr(each.field_info, "in_", None) == ParamTypes.query}
    known = sorted(asks)
    for name in asked.query_params:
        if name not in known:
            unknown = f"unknown parameter {name[:LONGEST_NAME]!r}{did_you_mean(name, known)}"
            message = f"{unknown}; known: {', '.join(known) or 'none'}"
            raise InvalidInput(message, where=name[:LONGEST_NAME] or "query")
        if len(asked.query_params.getlist(name)) > 1 and not _is_list(asks[name].annotation):
            raise InvalidInput("is given twice", where=name, hint="Give it once.")


def _is_list(annotation: Any) -> bool:
    """Return True for a type of several values, as `list[str] | None`."""
    return get_origin(annotation) in (list, tuple, set, Sequence) or any(map(_is_list, get_args(annotation)))


def _wants_key(dependant: Dependant) -> bool:
    return any(each.own_oauth_scopes or _wants_key(each) for each in dependant.dependencies)
