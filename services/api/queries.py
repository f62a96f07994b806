"""Query parameters that a route does not know are refused: a misspelt filter would otherwise show everything."""

from __future__ import annotations

from fastapi.dependencies.utils import get_flat_params
from fastapi.params import ParamTypes
from fastapi.routing import APIRoute
from starlette.requests import HTTPConnection

from shared.errors import InvalidInput

LONGEST_NAME = 60


async def known_query(asked: HTTPConnection) -> None:
    """A dependency of every route: nothing, if it knows every query parameter of the request. Sockets have their own.

    Raises:
        InvalidInput: it does not know one.
    """
    route = asked.scope.get("route")
    if not asked.query_params or not isinstance(route, APIRoute):
        return
    params = get_flat_params(route.dependant)
    known = sorted({each.alias for each in params if getattr(each.field_info, "in_", None) == ParamTypes.query})
    for name in asked.query_params:
        if name not in known:
            hint = f"It takes {', '.join(known)}." if known else "It takes none."
            raise InvalidInput("is no parameter of this route", where=name[:LONGEST_NAME] or "query", hint=hint)
