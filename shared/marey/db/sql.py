"""SQL expressions and checks that all repositories share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import ARRAY

from marey.core import characters
from marey.core.errors import MareyError

CLOCK = sa.func.clock_timestamp()
"""Database time at this statement; `now()` is the start of the transaction, before it waited for locks."""


def among(column: sa.Column[Any], values: Iterable[object]) -> sa.ColumnElement[bool]:
    """Return `column = ANY(array)`: one parameter for any number of values."""
    return column == sa.any_(sa.literal(list(values), ARRAY(column.type)))


def interval(seconds: float) -> sa.Function[object]:
    """Return a length of time for comparisons with `CLOCK`."""
    return sa.func.make_interval(0, 0, 0, 0, 0, 0, seconds)


def notify(conn: sa.Connection, channel: str, payloads: Iterable[str]) -> None:
    """NOTIFY when this transaction commits; equal payloads are sent once."""
    for payload in payloads:
        conn.execute(sa.select(sa.func.pg_notify(channel, payload)))


def need_row(conn: sa.Connection, query: sa.Select[Any], missing: MareyError) -> sa.RowMapping:
    """Return the row of a query.

    Raises:
        MareyError: `missing`, where there is none.
    """
    row = conn.execute(query).mappings().one_or_none()
    if row is None:
        raise missing
    return row


def check_text(text: str | None, where: str) -> None:
    """Validate that Postgres can store a text; incoming text is checked at the edge (`marey.core.characters`).

    Raises:
        InvalidInput: it holds NUL or a lone surrogate.
    """
    if text is not None:
        characters.check_text(text, allowed=characters.STORED, where=where)
