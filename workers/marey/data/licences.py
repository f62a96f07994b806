"""Licence tiers: which data may be trained on together, and what the weights may then be used for."""

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
    """Terms of a set; they travel into every manifest and model card.

    Attributes:
        name: of the set.
        title, licence, credit, url: as they must be given.
        tier: what weights trained on it may be used for.
    """

    name: str
    title: str
    licence: str
    credit: str
    url: str
    tier: Tier


def tier_of(licence: str) -> Tier:
    """Tier of a licence by its name, for records that do not state one."""
    if re.search(r"\bNC\b|non-?commercial|research only", licence, re.IGNORECASE):
        return "non-commercial"
    return "sharealike" if re.search(r"\bSA\b|share-?alike", licence, re.IGNORECASE) else "commercial"


def check_mix(terms: Iterable[Terms], *, where: str | None = None) -> Tier:
    """The tier of what is made of all of these: the strictest.

    Raises:
        InvalidInput: sharealike together with non-commercial: no licence would satisfy both.
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
