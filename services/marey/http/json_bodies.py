"""JSON bodies that FastAPI reads: an object that gives a key twice is refused."""

from __future__ import annotations

import json
from collections.abc import Callable, Coroutine
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute

from marey.core.documents import unique_object


class UniqueKeysRequest(Request):
    """A request whose JSON gives each key of an object once."""

    async def json(self) -> Any:
        """Return the value of the body.

        Raises:
            ValueError: it is not JSON, or an object gives a key twice.
        """
        return json.loads(await self.body(), object_pairs_hook=unique_object)


class UniqueKeysRoute(APIRoute):
    """A route of such requests."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler of FastAPI, with its request replaced."""
        handle = super().get_route_handler()

        async def handler(request: Request) -> Response:
            return await handle(UniqueKeysRequest(request.scope, request.receive))

        return handler
