"""The limb that a prompt asks to act, and the one that acts."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np

from marey.selector.matching import side_of
from marey.selector.motion import Motion
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.legs import stated_leg

MORE = 1.1
"""How many times as much as the other a limb does that is the one that acts."""
LIFTED = frozenset({"kick", "kick-ball"})
"""Actions of the foot that is lifted; in others, such as a balance, a prompt may name the one that stands."""
_ARM = re.compile(r"\b(?:left|right|l|r)(?:[ -]handed|[ -](?:hand|arm|forearm|fist|palm|elbow|wrist))\b")


@dataclass(frozen=True)
class NamedLimb:
    """A hand or a foot.

    Attributes:
        part: which.
        side: whose.
    """

    part: Literal["hand", "foot"]
    side: Literal["left", "right"]

    def is_other(self, motion: Motion) -> bool:
        """Return True if the limb of the other side acts in a motion: the hand that moves faster about the hips, the
        foot that is lifted higher."""
        if self.part == "foot":
            left, right = motion.feet.max(axis=0)
        else:
            left, right = np.percentile(motion.hand_speed, 90, axis=0)
        own, other = (left, right) if self.side == "left" else (right, left)
        return bool(other > MORE * own)


def limb_of(prompt: str, action: str | None = None) -> NamedLimb | None:
    """Return the limb that a prompt asks to act; None if it names none, or both.

    Args:
        prompt: as a user typed it.
        action: id of the one action that it asks for; None = one that is not in the vocabulary: its words decide.
    """
    side = (stated_leg(prompt, action) if action in LIFTED else "") or side_of(prompt)
    if side not in ("left", "right"):
        return None
    if action in LIFTED:
        return NamedLimb("foot", side)
    by_hand = action is not None and load_vocabulary().need(action).sided == "hand"
    return NamedLimb("hand", side) if by_hand or _ARM.search(prompt.lower()) else None
