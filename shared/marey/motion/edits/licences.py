"""Terms of a motion that was made of several: those of the strictest source."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from marey.core.errors import InvalidInput

LICENCE = "licence"
"""Field of a pose keyframe, and key of a manifest."""
_NON_COMMERCIAL = re.compile(r"(?<![A-Za-z])NC(?![A-Za-z])|non-?commercial|research only", re.IGNORECASE)
_SHARE_ALIKE = re.compile(r"(?<![A-Za-z])SA(?![A-Za-z])|share-?alike", re.IGNORECASE)


def strictest(licences: Iterable[str | None], *, where: str = "licence") -> str | None:
    """Return the licence of a work made of works under these; None where none is stated.

    Non-commercial terms are stricter than share-alike ones, and those than all others. Different licences that are
    equally strict apply together: `MIT AND CC-BY-4.0`.

    Raises:
        InvalidInput: one source is share-alike and another one non-commercial: no licence satisfies both.
    """
    known = list(dict.fromkeys(each for each in licences if each))
    closed = [each for each in known if _NON_COMMERCIAL.search(each)]
    shared = [each for each in known if _SHARE_ALIKE.search(each) and each not in closed]
    if closed and shared:
        raise InvalidInput(
            f"{shared[0]} is share-alike and {closed[0]} is non-commercial: no licence satisfies both",
            where=where,
            hint="Leave one of the motions out.",
        )
    return " AND ".join(closed or shared or known) or None


def terms_with(licence: str | None, constraints: Iterable[Mapping[str, Any]]) -> str | None:
    """Return the licence of a motion that is generated with constraints: that of the weights and of the motions that
    their poses are from.

    Raises:
        InvalidInput: no licence satisfies both; with the field in `where`.
    """
    found = licence
    for number, each in enumerate(constraints):
        try:
            found = strictest([found, each.get(LICENCE)])
        except InvalidInput as error:
            hint = "Leave the pose out, or use another bundle."
            raise InvalidInput(error.message, where=f"constraints.{number}.{LICENCE}", hint=hint) from None
    return found
