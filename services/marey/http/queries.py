"""Validation of query parameters: a misspelt filter would otherwise return everything."""

from __future__ import annotations

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
    """Validate that the route knows every query parameter of the request. Sockets check their own.

    Raises:
        InvalidInput: an unknown parameter.
    """
    route = asked.scope.get("route")
    if not asked.query_params or not isinstance(route, APIRoute):
        return
    params = get_flat_params(route.dependant)
    known = sorted({each.alias for each in params if getattr(each.field_info, "in_", None) == ParamTypes.query})
    for name in asked.query_params:
        if name not in known:
            unknown = f"unknown parameter {name[:LONGEST_NAME]!r}{did_you_mean(name, known)}"
            message = f"{unknown}; known: {', '.join(known) or 'none'}"
            raise InvalidInput(message, where=name[:LONGEST_NAME] or "query")


def _wants_key(dependant: Dependant) -> bool:
    return any(each.own_oauth_scopes or _wants_key(each) for each in dependant.dependencies)
