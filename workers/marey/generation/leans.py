"""How far bodies lean that bear themselves in several ways: old, stooped and on a cane."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from marey.vocabulary.bearings import StatedBearing

BOTH_LEAN = 24.0
"""Degrees by which manners lean together at most, if none of them leans further."""


def trunk_shares(parts: Iterable[Sequence[StatedBearing]]) -> dict[str, float]:
    """Return the share of its lean and of its bent knees that each manner has, by its name: together they lean as far
    as the one that leans most, or a little further.

    Args:
        parts: the bearings of each part of a motion.
    """
    shares: dict[str, float] = {}
    for stated in parts:
        leans = {each.name: each.bearing.trunk for each in stated if each.bearing.trunk > 0 and not each.is_done}
        if len(leans) > 1:
            share = max(*leans.values(), BOTH_LEAN) / sum(leans.values())
            shares |= {name: min(share, 1.0, shares.get(name, 1.0)) for name in leans}
    return shares
