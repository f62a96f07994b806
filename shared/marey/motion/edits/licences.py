"""Terms of a motion that was made of several: those of the strictest source."""

from __future__ import annotations

import re
from collections.abc import Iterable

from marey.core.errors import InvalidInput

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
