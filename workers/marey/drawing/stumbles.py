"""Stumbles: a body that is pitched forward, catches itself in a few quick steps, and stands upright again."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT

_STEPS = ((0.5, 0.3, 32.0), (0.46, 0.3, 36.0), (0.36, 0.36, 20.0))
"""Metres, seconds, and degrees by which the trunk is pitched, of the steps that catch it; the last ones of these."""
_THROWN = HandPlace((0.24, -0.2, 0.34), "shoulder", (0.7, -0.7, -0.2))
_FLUNG = HandPlace((0.4, -0.1, 0.1), "shoulder", (0.2, -0.6, -0.7))
_LOW = HandPlace((0.2, -0.36, 0.16), "shoulder", (0.6, -0.7, -0.6))
"""Hands that reach for a hold, that are flung out for balance, and on their way back to the sides."""


@dataclass(frozen=True)
class _Stumble:
    """A stumble that the left foot begins.

    Attributes:
        steps: two or three.
        size: factor of their metres and degrees.
        starts, recovers: seconds of standing before it, and of coming upright.
    """

    steps: int
    size: float
    starts: float
    recovers: float

    def sequel(self, feet: StandingFeet) -> Sequel:
        """The postures over the feet of an idle."""
        done = Sequel([self.starts])
        caught = {LEFT: feet[LEFT].tiptoe(30), RIGHT: feet[RIGHT].flat()}
        tips = Posture((0.0, 0.91, 0.1), (12 * self.size, 0, 0), (8 * self.size, 0, 0), (-6, 0, 0), feet=caught)
        done.then(0.24, replace(tips, hands={LEFT: _FLUNG, RIGHT: _THROWN}))
        at: Mapping[str, float] = dict.fromkeys(SIDES, 0.0)
        side = LEFT
        for stride, seconds, pitch in _STEPS[-self.steps :]:
            at = self._step(done, feet, at, side, (self.size * stride, seconds, self.size * pitch))
            side = OTHER_SIDE[side]
        self._recover(done, feet, at, side)
        return done

    def _step(
        self,
        done: Sequel,
        feet: StandingFeet,
        at: Mapping[str, float],
        side: str,
        step: tuple[float, float, float],
    ) -> dict[str, float]:
        """Add a step with the foot of a side, of a length, a time and a pitch; return where both feet are."""
        other, (stride, seconds, pitch) = OTHER_SIDE[side], step
        there = at[other] + stride
        lean = Posture(
            None, (0.6 * pitch, 0, 0), (0.7 * pitch, 0, 0), (-0.6 * pitch, 0, 0), hands={side: _FLUNG, other: _THROWN}
        )
        passing = FootPlace((feet[side].out, 0.19, at[other] - 0.04), (0.1, -0.6, 0.6))
        off = {other: feet[other].tiptoe(16, at[other]), side: passing}
        done.then(0.5 * seconds, replace(lean, pelvis=(0.0, 0.87, at[other] + 0.14), feet=off))
        landed = {other: feet[other].tiptoe(48, at[other]), side: feet[side].flat(there)}
        swapped = {side: _THROWN, other: _FLUNG}
        done.then(0.5 * seconds, replace(lean, pelvis=(0.0, 0.84, there - 0.13), feet=landed, hands=swapped))
        return {other: at[other], side: there}

    def _recover(self, done: Sequel, feet: StandingFeet, at: Mapping[str, float], behind: str) -> None:
        """Sink over the foot ahead, bring the other one up to it, and stand."""
        ahead = OTHER_SIDE[behind]
        end, hands = at[ahead], {LEFT: _LOW, RIGHT: _LOW}
        held = {ahead: feet[ahead].flat(end), behind: feet[behind].tiptoe(38, at[behind])}
        sunk = Posture((0.0, 0.85, end - 0.08), (6, 0, 0), (8, 0, 0), (-4, 0, 0), hands=hands, feet=held)
        done.then(0.45 * self.recovers, sunk, 0.12)
        passing = {**held, behind: feet[behind].flat(end - 0.12, 0.07)}
        done.then(0.45 * self.recovers, Posture((0.0, 0.92, end - 0.03), (3, 0, 0), (3, 0, 0), feet=passing))
        done.then(0.3, Posture((0.0, 0.935, end), feet={side: foot.flat(end) for side, foot in feet.items()}), 0.3)


def stumble(rng: random.Random) -> Gesture:
    """Two or three quick steps forward that catch a body which loses its balance."""
    way = _Stumble(rng.choice((2, 3, 3)), rng.uniform(0.9, 1.12), rng.uniform(0.3, 0.6), rng.uniform(0.8, 1.1))
    side = rng.choice(SIDES)
    return on_feet(way.sequel, ["stumble"], rng.uniform(0.3, 0.7), side=side, mirror=side == RIGHT)
