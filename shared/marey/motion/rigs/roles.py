"""Helper joints of a rig: those that take a share of a twist, and those that follow hands and feet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from marey.motion.rigs.parts import SIDES
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.tree import between
from marey.motion.rigs.words import TWISTS, NameWord

BONES = (("upper_arm", "lower_arm"), ("lower_arm", "hand"), ("upper_leg", "lower_leg"), ("lower_leg", "foot"))
"""Limb bones: the parts of their beginning and end."""
ASIDE = 0.15
"""Distance from the line of the bone, as a share of its length, up to which a joint lies along it."""


@dataclass(frozen=True)
class Twist:
    """A joint that takes a share of a limb's twist.

    Attributes:
        bone: parts of the beginning and the end of the bone that it lies along.
        share: its place along the bone, 0 at the beginning and 1 at the end.
        inline: True if the end of the bone hangs on it, False if it only carries skin.
    """

    bone: tuple[str, str]
    share: float
    inline: bool


def find_twists(rig: Rig, parts: Mapping[str, int], words: Sequence[NameWord]) -> dict[int, Twist]:
    """Return the joints along arms and legs that share the twist of their bone."""
    found: dict[int, Twist] = {}
    taken = set(parts.values())
    for side in SIDES:
        for names in ((f"{side}_{begin}", f"{side}_{end}") for begin, end in BONES):
            if names[0] not in parts or names[1] not in parts:
                continue
            begin, end = (parts[name] for name in names)
            chain = between(rig.parents, begin, end)
            leaves = [joint for joint in _below(rig, begin, end) if words[joint].words & TWISTS]
            for joint in (*chain, *leaves):
                share = _along(rig, begin, end, joint)
                if joint not in taken and share is not None:
                    found[joint] = Twist(names, share, joint in chain)
    return found


def find_followers(rig: Rig, parts: Mapping[str, int], words: Sequence[NameWord]) -> dict[int, str]:
    """Return the joints that are named after inverse kinematics and a hand or foot: `ik_foot_l`, `ik_hand_gun`."""
    found: dict[int, str] = {}
    for joint, word in enumerate(words):
        part = next((each for each in ("foot", "hand") if each in word.words), None)
        if "ik" not in word.words or part is None or "root" in word.words:
            continue
        side = 1 if word.side is None and "gun" in word.words else word.side
        if side is not None and f"{SIDES[side]}_{part}" in parts:
            found[joint] = f"{SIDES[side]}_{part}"
    return found


def _below(rig: Rig, begin: int, end: int) -> list[int]:
    """Return the joints under the beginning of a bone that are not under its end."""
    found: list[int] = []
    waiting = [begin]
    while waiting:
        for child in rig.children[waiting.pop()]:
            if child != end:
                found.append(child)
                waiting.append(child)
    return found


def _along(rig: Rig, begin: int, end: int, joint: int) -> float | None:
    """Return the place of a joint along a bone, None if it lies beside it."""
    line, way = (rig.positions[each] - rig.positions[begin] for each in (end, joint))
    length = float(np.linalg.norm(line))
    if length < 1e-6:
        return None
    share = float(way @ line) / length**2
    aside = float(np.linalg.norm(way - share * line)) / length
    return min(max(share, 0.0), 1.0) if -0.1 <= share <= 1.1 and aside <= ASIDE else None
