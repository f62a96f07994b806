"""Steps over things on the way: one long stride over a puddle, or a leg after the other lifted over a log or a wall.
Drawn with the left leg first and mirrored for the right one."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT, SIGN

WIDE, FLAT, LOG, WALL = "wide", "flat", "log", "wall"
"""Things to step over: a place that is wide, and things of no height, of that of a shin, and of that of a knee."""
_LIFTS = {WIDE: (0.16, 0.2), FLAT: (0.2, 0.26), LOG: (0.4, 0.46), WALL: (0.6, 0.66)}
"""Metres of the ankle on its way over."""
_STRIDES = {WIDE: (0.88, 0.98), FLAT: (0.58, 0.66), LOG: (0.66, 0.74), WALL: (0.66, 0.72)}
"""Metres from the foot that stands to the one that has stepped over."""
_SECONDS = {WIDE: 0.62, FLAT: 0.72, LOG: 1.0, WALL: 1.3}
"""Seconds of each leg on its way over."""
_WALKS = (0.44, 0.5)
"""Metres and seconds of a step before it and behind it."""
_OVER_FOOT = 0.05
"""Metres by which the hips are over the foot that stands."""


@dataclass(frozen=True)
class _StepOver:
    """Steps over something, the left leg first.

    Attributes:
        what: is stepped over.
        lift, stride: metres of the ankle on its way, and of the stride.
        steps: on the way to each.
        times: how many things.
        starts: seconds before the first step.
        pace: factor of all seconds.
    """

    what: str
    lift: float
    stride: float
    steps: int
    times: int
    starts: float
    pace: float

    def sequel(self, feet: StandingFeet) -> Sequel:
        """The postures over the feet of an idle."""
        done = Sequel([self.starts])
        at: dict[str, float] = dict.fromkeys(SIDES, 0.0)
        for _ in range(self.times):
            for left in range(self.steps, 0, -1):
                at = self._step(done, feet, at, RIGHT if left % 2 else LEFT)
            at = self._over(done, feet, at)
        end = at[RIGHT]
        passing = {RIGHT: feet[RIGHT].flat(end), LEFT: feet[LEFT].flat(end - 0.12, 0.09)}
        done.then(0.26 * self.pace, Posture((-_OVER_FOOT, 0.93, end - 0.02), (1, 0, 0), feet=passing))
        done.then(
            0.28 * self.pace, Posture((0.0, 0.94, end), feet={side: foot.flat(end) for side, foot in feet.items()})
        )
        return done

    def _step(self, done: Sequel, feet: StandingFeet, at: dict[str, float], side: str) -> dict[str, float]:
        """Add a step of a walk; return where both feet are."""
        other, (stride, seconds) = OTHER_SIDE[side], _WALKS
        there = at[other] + stride
        passing = {other: feet[other].flat(at[other]), side: FootPlace((0.09, 0.15, at[other] - 0.05), (0, -0.5, 0.85))}
        over = Posture((SIGN[other] * _OVER_FOOT, 0.935, at[other] + 0.02), (2, 0, 0), feet=passing)
        done.then(0.5 * seconds * self.pace, over)
        lands = {other: feet[other].tiptoe(32, at[other]), side: feet[side].flat(there)}
        done.then(0.5 * seconds * self.pace, Posture((0.0, 0.91, there - 0.5 * stride), (2, 0, 0), feet=lands))
        return {other: at[other], side: there}

    def _over(self, done: Sequel, feet: StandingFeet, at: dict[str, float]) -> dict[str, float]:
        """Add the way of both legs over it; return where both feet are."""
        here, seconds = at[RIGHT], _SECONDS[self.what] * self.pace
        there, middle = here + self.stride, here + 0.5 * self.stride
        self._lead(done, feet, (here, middle, there), seconds)
        last = there + (0.12 if self.lift > 0.3 else 0.36)
        self._trail(done, feet, (here, middle, there, last), seconds)
        return {LEFT: there, RIGHT: last}

    def _lead(self, done: Sequel, feet: StandingFeet, way: Point, seconds: float) -> None:
        """Lift the left leg over it and put it down behind it."""
        here, middle, there = way
        high = self.lift > 0.3
        stands = feet[RIGHT].flat(here)
        lifted = FootPlace((0.1, self.lift, here + 0.08), (0.0, -0.4, 0.9))
        across = FootPlace((0.09, self.lift, middle + 0.08), (0.0, 0.1, 1.0))
        lean, arms = (8 if high else 3), self._arms(LEFT)
        up = Posture((-_OVER_FOOT, 0.935, here + 0.01), (-2, -3, 0), (lean, 0, 0), (lean, 0, 0), hands=arms)
        knees: dict[str, Point] = {LEFT: (0.15, 0.6, 1.0)}
        done.then(0.42 * seconds, _with(up, {RIGHT: stands, LEFT: lifted}, knees))
        on = Posture((-0.03, 0.925, here + 0.3 * self.stride), (0, -2, 0), (lean, 0, 0), (lean, 0, 0), hands=arms)
        done.then(0.26 * seconds, _with(on, {RIGHT: feet[RIGHT].tiptoe(18, here), LEFT: across}, knees))
        sunk = 0.94 - 0.3 * self.stride**2 * 0.4
        down = Posture((0.0, sunk, here + 0.62 * self.stride), (3, 0, 0), (4, 0, 0), (4, 0, 0), hands=arms)
        done.then(0.32 * seconds, _with(down, {RIGHT: feet[RIGHT].tiptoe(46, here), LEFT: feet[LEFT].flat(there)}))

    def _trail(self, done: Sequel, feet: StandingFeet, way: tuple[float, ...], seconds: float) -> None:
        """Bring the right leg after it."""
        here, middle, there, last = way
        high = self.lift > 0.3
        stands, wide = feet[LEFT].flat(there), 0.16 if high else 0.1
        lifted = FootPlace((wide, self.lift, here + 0.24 * self.stride), (0.2, -0.8, 0.4))
        across = FootPlace((wide, self.lift + 0.03, middle + 0.2), (0.15, -0.4, 0.8))
        arms, knees = self._arms(RIGHT), {RIGHT: (0.5 if high else 0.15, 0.5, 1.0)}
        lean = 10 if high else 4
        up = Posture((_OVER_FOOT, 0.925, there - 0.1), (lean, 3, 0), (4, 0, 0), hands=arms)
        done.then(0.42 * seconds, _with(up, {LEFT: stands, RIGHT: lifted}, knees))
        on = Posture((_OVER_FOOT, 0.935, there + 0.01), (0.5 * lean, 3, 0), (4, 0, 0), hands=arms)
        done.then(0.24 * seconds, _with(on, {LEFT: stands, RIGHT: across}, knees))
        lands = {LEFT: feet[LEFT].flat(there) if high else feet[LEFT].tiptoe(24, there), RIGHT: feet[RIGHT].flat(last)}
        done.then(0.32 * seconds, _with(Posture((0.0, 0.92, last - 0.14), (2, 0, 0)), lands))

    def _arms(self, leg: str) -> dict[str, HandPlace]:
        """Arms that balance over a high thing, and swing against the leg otherwise."""
        if self.lift > 0.3:
            return {side: HandPlace((0.3, -0.3, 0.14), "shoulder", (0.4, -0.4, -0.9)) for side in SIDES}
        far = 0.22 if self.what == WIDE else 0.12
        return {
            leg: HandPlace((0.14, -0.44, -far), "shoulder", (0.5, -0.4, -0.8)),
            OTHER_SIDE[leg]: HandPlace((0.12, -0.42, far), "shoulder", (0.5, -0.5, -0.8)),
        }


def _with(posture: Posture, feet: dict[str, FootPlace], knees: dict[str, Point] | None = None) -> Posture:
    return replace(posture, feet=feet, knees=knees or {})


def step_over(rng: random.Random, what: str = LOG, side: str = "", times: int = 1) -> Gesture:
    """Steps up to something and over it.

    Args:
        rng: decides everything that is not given.
        what: `WIDE`, `FLAT`, `LOG` or `WALL`.
        side: of the leg that goes first.
        times: how many such things follow each other.
    """
    side = side or rng.choice(SIDES)
    lift, stride = rng.uniform(*_LIFTS[what]), rng.uniform(*_STRIDES[what])
    way = _StepOver(what, lift, stride, rng.choice((1, 2)), times, rng.uniform(0.2, 0.4), rng.uniform(0.95, 1.1))
    return on_feet(way.sequel, ["step-over"], rng.uniform(0.3, 0.6), side=side, mirror=side == RIGHT, times=times)
