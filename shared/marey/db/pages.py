"""Pages of listings, ordered by the database's clock. Cursors are opaque.

A cursor holds the id and the creation time of the last row. Cursors of earlier releases hold the id alone, and are
accepted too: the time is that of the row, or, if the row is gone, the time in its UUIDv7. In turn an API process of
an earlier release reads the id of a current cursor, and continues in its own order: the id in braces is base64 that
ends in padding, where its decoder stops; the time follows.
"""

from __future__ import annotations

import base64
import binascii
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from operator import attrgetter
from typing import Any, Generic, TypeVar
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import InvalidInput
from marey.db.tables import Id, Time

PAGE = 50
"""Rows of a page where no other number is asked for."""
LARGEST_PAGE = 1000
SEPARATOR = "|"
_PADDED = re.compile(r"[^=]+=*|=+")
Row = TypeVar("Row")
Mark = TypeVar("Mark")
Place = sa.ColumnElement[Any]
"""The creation time and the id of a row, as SQL."""


@dataclass(frozen=True)
class Page(Generic[Row]):
    """One page of a listing; `cursor` asks for the next, None at the end."""

    rows: tuple[Row, ...]
    cursor: str | None


@dataclass(frozen=True)
class Order:
    """The order of a listing: by creation time, then id."""

    created: sa.ColumnElement[Any]
    id: sa.ColumnElement[Any]
    descending: bool = True

    def by(self) -> tuple[sa.ColumnElement[Any], sa.ColumnElement[Any]]:
        """The terms of ORDER BY."""
        return (self.created.desc(), self.id.desc()) if self.descending else (self.created, self.id)

    def place(self, cursor: str, scope: sa.ColumnElement[bool]) -> Place:
        """Return the position of a cursor.

        Args:
            scope: the rows of the listing; the row of an earlier release's cursor is looked up among them.

        Raises:
            InvalidInput: not a cursor of this listing.
        """
        mark = read_cursor(cursor, _Mark.read)
        at: sa.ColumnElement[Any] = sa.literal(mark.at, Time)
        if mark.by_id:
            own = sa.select(self.created).where(scope, self.id == mark.id).correlate(None)
            at = sa.func.coalesce(own.scalar_subquery(), at)
        return sa.tuple_(at, sa.literal(mark.id, Id))

    def beyond(self, place: Place) -> sa.ColumnElement[bool]:
        """Return the condition of rows that come after a position."""
        here = sa.tuple_(self.created, self.id)
        return here < place if self.descending else here > place

    def after(self, cursor: str, scope: sa.ColumnElement[bool]) -> sa.ColumnElement[bool]:
        """Return the condition of rows that come after a cursor; raises as `place`."""
        return self.beyond(self.place(cursor, scope))

    def page(
        self,
        conn: sa.Connection,
        query: sa.Select[Any],
        scope: sa.ColumnElement[bool],
        cursor: str | None,
        limit: int,
        read: Callable[[sa.RowMapping], Row],
        *,
        mark: Callable[[Row], tuple[datetime, UUID]] = attrgetter("created", "id"),
    ) -> Page[Row]:
        """Return a page of a listing.

        Args:
            query: the rows that are wanted, in any order.
            scope: as in `place`.
            read: makes a row of the database's.
            mark: returns the creation time and the id of a row.

        Raises:
            InvalidInput: not a cursor of this listing, or a limit out of range.
        """
        if cursor is not None:
            query = query.where(self.after(cursor, scope))
        found = conn.execute(query.order_by(*self.by()).limit(page_limit(limit) + 1)).mappings()
        return cut_page([read(each) for each in found], limit, lambda row: mark_of(*mark(row)))


@dataclass(frozen=True)
class _Mark:
    at: datetime
    id: UUID
    by_id: bool

    @classmethod
    def read(cls, text: str) -> _Mark:
        identifier, separator, time = text.partition(SEPARATOR)
        own = UUID(identifier)
        if not separator:
            return cls(datetime.fromtimestamp((own.int >> 80) / 1000).astimezone(), own, by_id=True)
        at = datetime.fromisoformat(time)
        if at.tzinfo is None:
            raise ValueError("a time without its zone")
        return cls(at, own, by_id=False)


def mark_of(created: datetime, identifier: UUID) -> str:
    """Return the mark of a row for `cut_page`."""
    return f"{{{identifier}}}{SEPARATOR}{created.isoformat()}"


def page_limit(limit: int) -> int:
    """Validate a page size and return it.

    Raises:
        InvalidInput: out of range.
    """
    if not 1 <= limit <= LARGEST_PAGE:
        raise InvalidInput(f"{limit} is not between 1 and {LARGEST_PAGE}", where="limit")
    return limit


def cut_page(rows: Sequence[Row], limit: int, mark: Callable[[Row], str]) -> Page[Row]:
    """Return the first `limit` rows of one more than asked for; the cursor is the mark of the last."""
    kept = tuple(rows[:limit])
    return Page(kept, cursor_at(mark(kept[-1])) if len(rows) > limit else None)


def cursor_at(mark: str) -> str:
    """Return the cursor of the page that comes after a mark."""
    parts = mark.split(SEPARATOR)
    return "".join(base64.urlsafe_b64encode(part.encode()).decode() for part in parts).rstrip("=")


def read_cursor(cursor: str, kind: Callable[[str], Mark]) -> Mark:
    """Decode the mark of a cursor.

    Raises:
        InvalidInput: not a cursor of this listing.
    """
    try:
        parts = _PADDED.findall(cursor + "=" * (-len(cursor) % 4))
        return kind(SEPARATOR.join(base64.urlsafe_b64decode(part).decode() for part in parts))
    except (binascii.Error, ValueError, OverflowError, OSError) as error:
        raise InvalidInput(
            "this is not a cursor of this listing", where="cursor", hint="Use the one of the last page."
        ) from error
