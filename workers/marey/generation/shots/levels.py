"""Heights at which the movements of a sequence are done: behind a climb, the body stays where that has ended.

Each movement is made alone, on a floor at 0. Who climbed stairs and waves would sink to that floor in half a second.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.motion.features import FeatureLayout
from marey.motion.skeleton import HUMANML3D

Float32 = NDArray[np.float32]
Array = NDArray[np.floating]

CLIMBS = frozenset({"climb-stairs", "climb-ladder", "climb-onto"})
"""Actions that may end higher than they begin."""
_OVER = re.compile(r"\b(?:over|across|vaults?|vaulting|hurdl\w+|clears?)\b")
"""Words of what is passed over, not climbed onto."""
LEAST_M = 0.15
"""Metres by which a climb ends higher, or begins, at least."""
ENDS = 5
"""Frames at either end of a motion of which the floor is measured."""
MOST_SCALED = 0.5
"""Share by which the height of a way down is changed at most, so that it begins where the way up has ended."""
FEET = [7, 8, 10, 11]
_DOWN = re.compile(
    r"\b(?:climb|walk|run|go|goes|com|step|jump|leap|hop|slid|drop|rush|head|get|back|sneak|make|fall|tumbl)\w*"
    r"(?: (?:his|her|their|its) way)?(?: (?:back|right|straight|\w+ly))* down\b"
    r"|\b(?:jump|leap|hop|step|get|climb|drop|fall|dive)\w* (?:\w+ )?off\b|\bdescend\w*|\blets? go\b"
    r"|\bdrops?(?: (?:to|onto|from)\b|$)|\bfall(?:s|ing)? (?:off|from|to)\b|\bto the (?:ground|floor|bottom)\b"
)
"""Words of a body that comes down from where it is."""


@dataclass(frozen=True, eq=False)
class RaisedRow:
    """A row of a sequence at the height where it is done.

    Attributes:
        features: (T, D).
        base: metres of the floor on which the row before has ended, and this one begins.
    """

    features: Float32 = field(repr=False)
    base: float = 0.0


def raised_rows(rows: Sequence[tuple[str, str, Float32]], layout: FeatureLayout) -> list[RaisedRow]:
    """Return the rows of a sequence, those behind a climb at the height where it has ended.

    Args:
        rows: id of the action, words in lower case, and features (T, D) of each.
        layout: of the features; on other skeletons than that of HumanML3D, rows stay as they are.
    """
    found, level = list[RaisedRow](), 0.0
    for action, said, features in rows:
        if layout.skeleton.name != HUMANML3D.name or (level == 0.0 and action not in CLIMBS):
            found.append(RaisedRow(features))
            continue
        floor = layout.decode(features)[:, FEET, 1].min(axis=1)
        begins, ends = float(floor[:ENDS].min()), float(floor[-ENDS:].min())
        down = comes_down(said)
        if down and action in CLIMBS and level > 0.0 and begins > LEAST_M:
            share = float(np.clip(level / begins - 1, -MOST_SCALED, MOST_SCALED))
            found.append(RaisedRow(lifted(features, share * (floor - ends), layout), level))
        else:
            level = 0.0 if down else level
            found.append(RaisedRow(lifted(features, level, layout), level))
        if down or (action == "climb-onto" and passes_over(said)):
            level = 0.0
        elif action in CLIMBS and ends - begins > LEAST_M:
            level += ends - begins
    return found


def comes_down(said: str) -> bool:
    """Return True if words, in lower case, have a body come down from where it is."""
    return _DOWN.search(said) is not None


def passes_over(said: str) -> bool:
    """Return True if words, in lower case, name what is passed over, not climbed onto."""
    return _OVER.search(said) is not None


def lifted(features: Float32, metres: float | Array, layout: FeatureLayout) -> Float32:
    """Return features (T, D) of a body that is higher by so many metres, one number or one a frame (T,)."""
    moved = features.copy()
    up = np.broadcast_to(np.asarray(metres, np.float32), len(moved))[:, None]
    moved[:, layout.slices["height"]] += up
    positions = layout.slices["positions"]
    moved[:, positions.start + 1 : positions.stop : 3] += up
    return moved
