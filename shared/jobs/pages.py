"""Pages of listings. Cursors are opaque."""

from __future__ import annotations

import base64
import binascii
from collections.abc import Callable, Sequence
from typing import TypeVar

from shared.errors import InvalidInput
from shared.jobs.types import Page

LARGEST_PAGE = 1000
Row = TypeVar("Row")
Mark = TypeVar("Mark")


def page_limit(limit: int) -> int:
    """`limit`, checked.

    Raises:
        InvalidInput: out of range.
    """
    if not 1 <= limit <= LARGEST_PAGE:
        raise InvalidInput(f"{limit} is not between 1 and {LARGEST_PAGE}", where="limit")
    return limit


def cut_page(rows: Sequence[Row], limit: int, mark: Callable[[Row], str]) -> Page[Row]:
    """The first `limit` rows of one more than asked for; the cursor is the mark of the last."""
    kept = tuple(rows[:limit])
    if len(rows) <= limit:
        return Page(kept, None)
    return Page(kept, base64.urlsafe_b64encode(mark(kept[-1]).encode()).decode().rstrip("="))


def read_cursor(cursor: str, kind: Callable[[str], Mark]) -> Mark:
    """The mark in a cursor.

    Raises:
        InvalidInput: it is none of ours.
    """
    try:
        return kind(base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)).decode())
    except (binascii.Error, ValueError) as error:
        raise InvalidInput(
            "this is no cursor of this listing", where="cursor", hint="Use the one the last page gave."
        ) from error
