"""Staggers: crooked steps of a body that sways over its feet, ahead, back or to a side, and comes to a stand."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT, SIGN

STAGGER_WAYS: Mapping[str, tuple[float, float]] = {
    "ahead": (0.0, 1.0),
    "back": (0.0, -1.0),
    LEFT: (1.0, 0.0),
    RIGHT: (-1.0, 0.0),
}
"""Ways of a stagger: to the left and forward."""
_APART, _FOLLOWS = 0.11, 0.21  # metres of a foot from the middle, and from the one that leads aside
_FLAT, _LIFTED = 0.07, 0.16  # metres of an ankle over the floor
_STEP_M, _SIDE_STEP_M, _STEP_S = (0.26, 0.52), (0.5, 0.7), (0.4, 0.62)
_CROSSED = 0.3  # share of the steps ahead that cross the line
_ENDS = ((7.0, 0.6), (-5.0, 0.7), (2.0, 0.7))  # degrees and seconds of the sways at the end
_BRIEF_S = (0.05, 0.12)  # seconds of standing before and after a stagger beside other things
_STRUCK_S, _STRUCK = 0.16, (16.0, 22.0)  # seconds of a blow, and degrees of the trunk
_NEAR_FALL = (0.5, 20.0)  # metres of the step that catches it, and degrees of the trunk


@dataclass(frozen=True)
class _Stagger:
    """A stagger.

    Attributes:
        way: key of `STAGGER_WAYS`.
        leads: the foot that goes first.
        strides: metres and seconds of each step, metres by which it leaves the line, degrees by which the trunk sways.
        caught: number of the step that catches a fall; -1 = none.
        starts: seconds of standing before it.
        brief: it sways once at its end.
        struck: degrees by which a blow throws the trunk back before it; 0 = none does.
    """

    way: str
    leads: str
    strides: tuple[tuple[float, float, float, float], ...]
    caught: int
    starts: float
    brief: bool = False
    struck: float = 0.0

    def sequel(self, feet: StandingFeet) -> Sequel:
        """The postures over the feet of an idle."""
        left, ahead = STAGGER_WAYS[self.way]
        at = {side: (SIGN[side] * feet[side].out, feet[side].forward) for side in SIDES}
        done = Sequel([self.starts])
        side, middle = self.leads, 0.0
        if self.struck:
            done.then(_STRUCK_S, self._struck())
        for number, (stride, seconds, off, sway) in enumerate(self.strides):
            middle += stride if not left or side == self.way else 0.0
            if left:
                behind = 0.0 if side == self.way else _FOLLOWS  # it closes up to the other foot
                there = (left * (middle - behind), feet[side].forward + off)
            else:
                there = (SIGN[side] * _APART + off, ahead * middle)
            self._step(done, at, side, there, (seconds, sway, number == self.caught))
            at[side], side = there, OTHER_SIDE[side]
        self._stand(done, at, side, feet)
        return done

    def _struck(self) -> Posture:
        """The posture into which a blow throws the body: away from where it comes, arms ahead."""
        left, ahead = STAGGER_WAYS[self.way]
        pitch, roll = ahead * self.struck, -left * self.struck
        hands = {side: HandPlace((0.26, -0.2, 0.3), "shoulder", (0.7, -0.6, -0.4)) for side in SIDES}
        hips = (0.05 * left, 0.9, 0.05 * ahead)
        neck = (-0.9 * pitch, -0.6 * roll, 0.0)
        return Posture(hips, (0.3 * pitch, 0.4 * roll, 0), (0.8 * pitch, 0.6 * roll, 0), neck, hands=hands)

    def _step(
        self,
        done: Sequel,
        at: dict[str, tuple[float, float]],
        side: str,
        there: tuple[float, float],
        how: tuple[float, float, bool],
    ) -> None:
        """Add a step of a foot to a place; `how`: seconds, degrees of the sway, and True if it catches a fall."""
        (seconds, sway, catches), other = how, OTHER_SIDE[side]
        stands, begun = at[other], at[side]
        over = tuple(0.5 * (a + b) for a, b in zip(begun, there, strict=True))
        pitch = _NEAR_FALL[1] if catches else 7.0
        aside = SIGN[side] * sway
        hands = {
            LEFT: HandPlace((0.34, -0.3 + 0.01 * max(sway, 0.0), 0.12), "shoulder", (0.4, -0.7, -0.6)),
            RIGHT: HandPlace((0.3, -0.34 - 0.01 * min(sway, 0.0), 0.16), "shoulder", (0.4, -0.7, -0.6)),
        }
        lean = Posture(
            None, (0.4 * pitch, 0.3 * aside, 0), (0.6 * pitch, 0.7 * aside, 0), (8, -0.8 * aside, 0), hands=hands
        )
        mid = {other: _foot(other, stands), side: _foot(side, (over[0], over[1]), _LIFTED)}
        between = tuple(0.65 * a + 0.35 * b for a, b in zip(stands, over, strict=True))
        done.then(0.5 * seconds, replace(lean, pelvis=(between[0], 0.9, between[1]), feet=mid))
        landed = {other: _foot(other, stands), side: _foot(side, there)}
        reached = tuple(0.45 * a + 0.55 * b for a, b in zip(stands, there, strict=True))
        low = 0.8 if catches else 0.88
        done.then(
            0.5 * seconds, replace(lean, pelvis=(reached[0], low, reached[1]), feet=landed), 0.25 if catches else 0.0
        )

    def _stand(self, done: Sequel, at: dict[str, tuple[float, float]], side: str, feet: StandingFeet) -> None:
        """Bring the foot behind beside the other one, sway over both, and stand."""
        other = OTHER_SIDE[side]
        apart = SIGN[side] * (feet[LEFT].out + feet[RIGHT].out)
        end = {other: at[other], side: (at[other][0] + apart, at[other][1] + 0.02)}
        middle = tuple(0.5 * (a + b) for a, b in zip(end[LEFT], end[RIGHT], strict=True))
        stands = {each: _foot(each, end[each]) for each in SIDES}
        for sway, seconds in _ENDS[:1] if self.brief else _ENDS:
            tilt = SIGN[side] * sway
            hips = (middle[0] + 0.005 * tilt, 0.92, middle[1])
            done.then(seconds, Posture(hips, (2, 0.3 * tilt, 0), (4, 0.7 * tilt, 0), (8, -0.5 * tilt, 0), feet=stands))
        done.then(0.4, Posture((middle[0], 0.935, middle[1]), feet=stands), 0.3)


def _foot(side: str, at: tuple[float, float], up: float = _FLAT) -> FootPlace:
    """A foot at a place to the left and forward."""
    return FootPlace((SIGN[side] * at[0], up, at[1]))


def stagger(
    rng: random.Random,
    way: str = "",
    *,
    nearly_falls: bool = False,
    steps: int | None = None,
    brief: bool = False,
    struck: bool = False,
) -> Gesture:
    """Crooked steps of a body that loses its balance.

    Args:
        rng: decides everything that is not given.
        way: key of `STAGGER_WAYS`; empty = ahead.
        nearly_falls: one of the steps catches the body.
        steps: how many; None = as many as go two to three metres.
        brief: other things are done before or after it: it starts at once and sways once at its end.
        struck: a blow throws the body that way.
    """
    way = way or "ahead"
    aside, number = way in SIDES, steps or (rng.choice((4, 5)) if brief else rng.choice((7, 8)))
    leads = way if aside else rng.choice(SIDES)
    caught = min(rng.choice((2, 3, 4)), number - 1) if nearly_falls else -1
    strides = list[tuple[float, float, float, float]]()
    drift = rng.choice((-1.0, 1.0)) * 0.08
    for step in range(number):
        side = leads if step % 2 == 0 else OTHER_SIDE[leads]
        metres = rng.uniform(*(_SIDE_STEP_M if aside else _STEP_M))
        crosses = rng.random() < _CROSSED and step not in (0, caught)
        off = rng.uniform(-0.06, 0.06) + drift * (1 if step % 4 < 2 else -1) - (SIGN[side] * 0.09 if crosses else 0.0)
        metres = _NEAR_FALL[0] if step == caught else metres
        strides.append((metres, rng.uniform(*_STEP_S), off, rng.uniform(7.0, 15.0) * rng.choice((-1.0, 1.0, 1.0))))
    starts, blow = rng.uniform(*_BRIEF_S if brief else (0.3, 0.5)), rng.uniform(*_STRUCK) if struck else 0.0
    form = _Stagger(way, leads, tuple(strides), caught, starts, brief, blow)
    return on_feet(
        form.sequel, ["stagger"], rng.uniform(*(_BRIEF_S if brief else (0.3, 0.6))), side=way if aside else ""
    )
