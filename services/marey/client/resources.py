"""The base of the client's resources, and the arguments they share."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, TypeVar
from urllib.parse import quote

from marey.client.results import Result
from marey.client.transport import Transport

R = TypeVar("R", bound=Result)
PAGE = 1000
"""Elements of one request of a listing."""


class Resource:
    """The methods of one noun of the API."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    def _pages(self, kind: type[R], path: str, limit: int | None, **params: Any) -> Iterator[R]:
        """The elements of a listing, page after page, as they are asked for; at most `limit`."""
        size = PAGE if limit is None else max(1, min(limit, PAGE))
        found = self._transport.pages(path, **params, limit=size)
        for number, each in enumerate(found):
            if limit is not None and number >= limit:
                return
            yield kind.of(each)


def identifier(of: Result | str) -> str:
    """The id of a result, or the id itself, as part of a path."""
    return quote(of if isinstance(of, str) else str(getattr(of, "id", "")), safe="")


def identifiers(of: Result | str | Iterable[Result | str]) -> list[str]:
    """The ids of one or several objects."""
    several = [of] if isinstance(of, Result | str) else of
    return [each if isinstance(each, str) else str(getattr(each, "id", "")) for each in several]
