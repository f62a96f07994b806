"""Deeds of hands on the floor beside a body that kneels, crouches or sits: things picked up, and the floor pounded."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, replace

from marey.drawing.gesture import BOTH, SIDES
from marey.drawing.postures import HandPlace, Point, Posture
from marey.drawing.sequels import Step, near
from marey.posing.standing import SIGN

PICKS, POUNDS = "picks", "pounds"
"""Kinds of deeds."""
_GRASPS_S, _LOOKS_S = 0.3, 0.5
"""Seconds in which a hand closes around a thing, and in which that is looked at."""
_BLOWS = 4
"""Blows on the floor where their number is left open."""
_ELBOW: Point = (0.6, 0.3, -0.7)
_BEFORE_CHEST = HandPlace((-0.08, -0.2, 0.3), "trunk", (0.8, -0.8, 0.0))
_BOTH_BEFORE_CHEST = HandPlace((0.0, -0.24, 0.34), "trunk", (0.9, -0.6, 0.0))
_RAISED = HandPlace((0.06, 0.08, 0.34), "shoulder", (0.7, -0.6, 0.5))
_LOWEST_M = 0.4
"""Metres of hips that are lowered for it, at least."""
_TABLE_M = 0.74
"""Metres of a hand over a table."""


@dataclass(frozen=True)
class LowDeed:
    """A deed of the hands in a low posture.

    Attributes:
        kind: `PICKS` or `POUNDS`.
        hand: left, right or both.
        times: blows on the floor; None = some.
        high: the thing lies on a table, not on the floor.
    """

    kind: str
    hand: str = ""
    times: int | None = None
    high: bool = False


@dataclass(frozen=True)
class _Bow:
    """How a body bends to the floor.

    Attributes:
        sinks: metres by which the hips go down and back.
        tilt, spine: degrees forward.
        aside: degrees to the side of the hand.
        at: place of the hand: outward, up and forward, metres.
    """

    sinks: tuple[float, float]
    tilt: float
    spine: float
    aside: float
    at: Point


_BOWS: Mapping[str, _Bow] = {
    "knees": _Bow((0.04, 0.08), 58, 50, 6, (0.12, 0.05, 0.2)),
    "knee": _Bow((0.04, 0.08), 54, 52, 12, (0.16, 0.05, 0.12)),
    "right-knee": _Bow((0.04, 0.08), 54, 52, 12, (0.16, 0.05, 0.12)),
    "crouch": _Bow((0.2, 0.02), 50, 44, 10, (0.16, 0.05, 0.26)),
    "floor": _Bow((0.0, 0.0), 18, 34, 16, (0.4, 0.05, -0.14)),
    "upright": _Bow((0.0, 0.0), 18, 34, 16, (0.4, 0.05, -0.2)),
    "seat": _Bow((0.0, 0.0), 52, 56, 16, (0.3, 0.06, 0.06)),
    "crossed": _Bow((0.0, 0.0), 50, 56, 20, (0.36, 0.06, 0.0)),
}
"""Bows by the name of the posture (`marey.drawing.holds`)."""
REACHES = frozenset(_BOWS)
"""Names of postures in which hands reach the floor."""
_OWN_HAND: Mapping[str, str] = {"knee": "left", "right-knee": "right"}
"""Hand on the side of the knee that is down: the other one would have to go around a thigh."""


def deed_steps(deed: LowDeed, name: str, low: Posture, rng: random.Random) -> tuple[Step, ...]:
    """Return the steps of a deed, from a posture and back to it.

    Args:
        deed: what is done.
        name: of the posture, one of `REACHES`.
        low: the posture.
        rng: decides what is left open.
    """
    hand = deed.hand or _OWN_HAND.get(name, "") or rng.choice(SIDES)
    return _pounding(deed, name, low, rng) if deed.kind == POUNDS else _picking(deed, name, low, hand, rng)


def _picking(deed: LowDeed, name: str, low: Posture, hand: str, rng: random.Random) -> tuple[Step, ...]:
    hands = SIDES if hand == BOTH else (hand,)
    bow = _BOWS[name]
    if deed.high:
        place = HandPlace((0.1, _TABLE_M, 0.16), "floor", (0.7, -0.8, 0.0))
        down = replace(low, tilt=(16, 0, 0), spine=(14, 0, 0), neck=(14, 0, 0), hands=dict.fromkeys(hands, place))
    else:
        down = _bowed(bow, low, hand, near(rng, bow.at, 0.02))
    held = dict.fromkeys(hands, _BOTH_BEFORE_CHEST if hand == BOTH else _BEFORE_CHEST)
    looks = replace(low, spine=(low.spine[0] + 6, 0, 0), neck=(20, 0, 0), hands={**low.hands, **held})
    pace = rng.uniform(0.9, 1.1)
    return (0.8 * pace, down), (_GRASPS_S, down), (0.75 * pace, looks), (_LOOKS_S, looks), (0.6 * pace, low)


def _pounding(deed: LowDeed, name: str, low: Posture, rng: random.Random) -> tuple[Step, ...]:
    """Both fists, or one while the other hand leans on the floor."""
    bow = _BOWS[name]
    at = near(rng, (max(bow.at[0], 0.17), bow.at[1], bow.at[2]), 0.015)
    down = _bowed(replace(bow, aside=0.0), low, BOTH, at)
    fists = SIDES if deed.hand in ("", BOTH) else (deed.hand,)
    raised = replace(
        down,
        pelvis=low.pelvis,
        tilt=(0.35 * bow.tilt, 0, 0),
        spine=(0.5 * bow.spine, 0, 0),
        hands={side: _RAISED if side in fists else down.hands[side] for side in SIDES},
    )
    if len(fists) == 1:
        raised = replace(raised, tilt=(0.8 * bow.tilt, 0, 0))
    steps = [(0.55, raised)]
    for _ in range(deed.times or _BLOWS):
        steps += [(rng.uniform(0.17, 0.2), down), (0.08, down), (rng.uniform(0.28, 0.36), raised)]
    return (*steps[:-1], (0.5, down), (0.8, low))


def _bowed(bow: _Bow, low: Posture, hand: str, at: Point) -> Posture:
    """Return a posture bent until a hand, or both, reach the floor."""
    left, up, ahead = low.pelvis or (0.0, 0.94, 0.0)
    sign = 0.0 if hand == BOTH else -SIGN[hand]
    hands = {side: HandPlace(at, "floor", _ELBOW) for side in (SIDES if hand == BOTH else (hand,))}
    others = {side: place for side, place in low.hands.items() if side not in hands}
    return replace(
        low,
        pelvis=(left, max(up - bow.sinks[0], min(up, _LOWEST_M)), ahead - bow.sinks[1]),
        tilt=(bow.tilt, 0.4 * sign * bow.aside, 0),
        spine=(bow.spine, 0.6 * sign * bow.aside, 0),
        neck=(-6, 0, 0),
        hang=1.0,
        hands={**others, **hands},
    )
