"""Download names of motions, and the bundle of a re-roll, which must still exist."""

from __future__ import annotations

import re
from dataclasses import replace

from marey.api.catalogue import Catalogue
from marey.core.errors import Conflict, MareyError
from marey.items.item import Item
from marey.jobs import ItemRow, MotionRow, NewItem
from marey.jobs.generators import new_items

WORDS = 48
"""Characters of the prompt in a file name."""


def file_stem(row: MotionRow) -> str:
    """Return the download name of a motion: its number in the job, its name or the prompt's first words, its seed."""
    words = "-".join(re.findall(r"\w+", row.prompt.lower()))
    if len(words) > WORDS:
        words = words[: WORDS + 1].rpartition("-")[0] or words[:WORDS]
    return f"{row.index:05}_{row.name or words or 'motion'}_{row.seed}"


def made_again(row: ItemRow, catalogue: Catalogue) -> NewItem:
    """Return the item as a new one, by the same exact bundle with the same settings, and of the same scope.

    Raises:
        Conflict: this server no longer has the bundle, or the bundle no longer accepts the item's settings.
    """
    item = Item(
        **{**row.spec(), "seconds": row.seconds if row.timeline is None else None},
        seed=row.seed,
        model=row.bundle,
        settings={name: value for name, value in row.settings.items() if isinstance(value, int | float)},
    )
    try:
        generator = catalogue.capabilities(row.bundle)
        generator.check_seconds(item.seconds)
        generator.check_settings(item.settings)
        generator.check_timeline(item.timeline)
    except MareyError as error:
        if error.status >= 500:
            raise
        raise Conflict(
            f"cannot be made again: {error.message}",
            where=f"item {row.id}",
            hint=error.hint or "Submit the prompt as a new job.",
        ) from error
    return replace(next(new_items([(item, generator)])), scope=row.scope)
