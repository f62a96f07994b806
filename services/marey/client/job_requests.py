"""Rows and options of requests about jobs, and the form in which they are sent."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, TypedDict

from marey.items.item import Item
from marey.vocabulary.scope import ScopePolicy

Row = Item | Mapping[str, object] | str
"""A prompt, a dict with the columns of a file, or an `Item`."""


class Defaults(TypedDict, total=False):
    """Fields of rows that do not set them."""

    model: str | None
    bundle: str | None
    seconds: float | None
    seed: int | None
    variants: int | None
    fps: float | None
    best_of: int | None
    redraws: int | None
    variety: str | None
    tags: Sequence[str] | None
    settings: Mapping[str, float] | None


class JobOptions(TypedDict, total=False):
    """Options of a new job."""

    name: str | None
    comment: str | None
    priority: int
    fail_early: float | None
    keep_days: int | None
    scope: ScopePolicy


class JobChanges(TypedDict, total=False):
    """Changes of a job; None removes the comment or the limit of failures."""

    priority: int
    comment: str | None
    fail_early: float | None


def sent_options(options: JobOptions) -> dict[str, Any]:
    """Return the parameters of a request; priority 0 and scope `warn` are the defaults and are not sent."""
    return {**options, "priority": options.get("priority") or None, "scope": sent_scope(options.get("scope", "warn"))}


def sent_scope(policy: ScopePolicy) -> ScopePolicy | None:
    """Return the parameter of a scope; None = the default, which is not sent."""
    return None if policy == "warn" else policy


def raw_items(rows: Iterable[Row]) -> Iterator[object]:
    """Yield rows as objects with the fields of an item."""
    for row in rows:
        if isinstance(row, str):
            yield {"prompt": row}
        else:
            yield row.as_json() if isinstance(row, Item) else row
