"""The base of the client's resources, and the arguments they share."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any, TypeVar
from urllib.parse import quote

from marey.client.results import Result
from marey.client.transport import Transport
from marey.core.errors import InvalidInput

R = TypeVar("R", bound=Result)
PAGE = 1000
"""Elements of one request of a listing."""


class Resource:
    """The methods of one noun of the API."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport

    def _pages(
        self, kind: type[R], path: str, limit: int | None, page_size: int | None = None, **params: Any
    ) -> Iterator[R]:
        """Iterate over the elements of a listing, at most `limit`; pages are requested as the caller proceeds."""
        if page_size is None:
            page_size = PAGE if limit is None else max(1, min(limit, PAGE))
        found = self._transport.pages(path, **params, limit=page_size)
        for each in islice(found, limit):
            yield kind.of(each)


def identifier(of: Result | str) -> str:
    """Return the id of a result, or the id itself, as one part of a path.

    Raises:
        InvalidInput: it is empty, or would be another path.
    """
    (text,) = identifiers(of)
    if text in ("", ".", ".."):
        raise InvalidInput(f"{text!r} is no id", where="id", hint="Give the id, or an object that the client gave.")
    return quote(text, safe="")


def identifiers(of: Result | str | Iterable[Result | str]) -> list[str]:
    """Return the ids of one or several objects."""
    several = [of] if isinstance(of, Result | str) else of
    return [each if isinstance(each, str) else str(getattr(each, "id", "")) for each in several]
