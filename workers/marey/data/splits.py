"""Splits by source, for clips without a split in the index: no source is in two splits."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from marey.data.licences import TIERS, Tier

FEWEST, SEVERAL, MANY = 4, 8, 12
TEST_SHARE = 0.12


@dataclass(frozen=True)
class Sourced:
    """Source, actions and tier of a clip, from which splits are made."""

    source: str
    actions: tuple[str, ...]
    tier: Tier


def actions_of(content: str) -> tuple[str, ...]:
    """Actions of a label: `walk; turn-left` has two."""
    return tuple(part for piece in content.split(";") if (part := piece.strip()))


def held_out(sources: int) -> tuple[int, int]:
    """Number of sources of an action to hold out for test and validation. Test: 2 or 12 % of 8 or more; 1 of 4 to 7;
    otherwise none. Validation: 1 of 12 or more."""
    test = max(2, round(TEST_SHARE * sources)) if sources >= SEVERAL else int(sources >= FEWEST)
    return test, int(sources >= MANY)


def splits_by_source(clips: Iterable[Sourced]) -> dict[str, str]:
    """Assign a split to each source.

    Actions are processed from the rarest; within an action, sources are ordered by hash, with sources of rare actions
    last, because training needs them. Tiers are processed one after the other, so that the splits of the commercial
    sources do not depend on further sources.
    """
    clips = list(clips)
    split: dict[str, str] = {}
    for k, tier in enumerate(TIERS):
        counted = [clip for clip in clips if clip.tier in TIERS[: k + 1]]
        of_action: dict[str, set[str]] = defaultdict(set)
        for clip in counted:
            for action in clip.actions:
                of_action[action].add(clip.source)
        free = {clip.source for clip in clips if clip.tier == tier} - split.keys()
        rare = {s for sources in of_action.values() if len(sources) < FEWEST for s in sources}
        _hold_out(of_action, free, rare, split)
        split.update({source: "train" for source in free if source not in split})
    return split


def _hold_out(of_action: Mapping[str, set[str]], free: set[str], rare: set[str], split: dict[str, str]) -> None:
    """Add the held-out ones of the free sources to `split`."""
    for action in sorted(of_action, key=lambda name: (len(of_action[name]), name)):
        sources = of_action[action]
        for name, wanted in zip(("test", "val"), held_out(len(sources)), strict=True):
            missing = wanted - sum(split.get(source) == name for source in sources)
            candidates = sorted(sources & free - split.keys(), key=lambda source: (source in rare, _hash(source)))
            split.update(dict.fromkeys(candidates[: max(missing, 0)], name))


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
