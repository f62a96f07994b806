"""What a re-roll needs besides rows: the bundle, for the item must still be makeable on this server."""

from __future__ import annotations

from services.api.catalogue import Catalogue
from shared.errors import Conflict, MareyError
from shared.items import Item
from shared.jobs import ItemRow, NewItem
from shared.offers import new_items


def made_again(row: ItemRow, catalogue: Catalogue) -> NewItem:
    """The item as a new one, by the same exact bundle with the same settings.

    Raises:
        Conflict: this server no longer has the bundle, or it no longer takes what the item asks for.
    """
    item = Item(
        prompt=row.prompt,
        name=row.name,
        seconds=row.seconds,
        seed=row.seed,
        model=row.bundle,
        tags=row.tags,
        settings={name: value for name, value in row.settings.items() if isinstance(value, int | float)},
    )
    try:
        offer = catalogue.offer(row.bundle)
        offer.check_seconds(item.seconds)
        offer.check_settings(item.settings)
    except MareyError as error:
        if error.status >= 500:
            raise
        raise Conflict(
            f"cannot be made again: {error.message}",
            where=f"item {row.id}",
            hint=error.hint or "Submit the prompt as a new job.",
        ) from error
    return next(new_items([(item, offer)]))
