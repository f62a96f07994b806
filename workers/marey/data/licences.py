"""Licence tiers: which data may be combined for training, and the allowed use of the weights."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

from marey.core.errors import InvalidInput

Tier = Literal["commercial", "sharealike", "non-commercial"]
TIERS: tuple[Tier, ...] = get_args(Tier)


@dataclass(frozen=True)
class Terms:
    """Terms of a set, copied into every manifest and model card.

    Attributes:
        name: name of the set.
        title, licence, credit, url: attribution, as required by the licence.
        tier: allowed use of weights trained on the set.
    """

    name: str
    title: str
    licence: str
    credit: str
    url: str
    tier: Tier


def tier_of(licence: str) -> Tier:
    """Tier of a licence by its name, for records without a tier."""
    if re.search(r"\bNC\b|non-?commercial|research only", licence, re.IGNORECASE):
        return "non-commercial"
    return "sharealike" if re.search(r"\bSA\b|share-?alike", licence, re.IGNORECASE) else "commercial"


def check_mix(terms: Iterable[Terms], *, where: str | None = None) -> Tier:
    """Return the tier of a combination of sets: the strictest.

    Raises:
        InvalidInput: share-alike and non-commercial sets together; no licence satisfies both.
    """
    by_tier: dict[Tier, list[str]] = {tier: [] for tier in TIERS}
    for entry in terms:
        by_tier[entry.tier].append(entry.name)
    if by_tier["sharealike"] and by_tier["non-commercial"]:
        raise InvalidInput(
            f"{by_tier['sharealike'][0]} is share-alike and {by_tier['non-commercial'][0]} is non-commercial: "
            "no weights may be trained on both",
            where=where,
            hint="Share-alike weights must allow every use, which the other licence forbids. Leave one of them out.",
        )
    used: list[Tier] = [tier for tier in TIERS if by_tier[tier]]
    return used[-1] if used else "commercial"
