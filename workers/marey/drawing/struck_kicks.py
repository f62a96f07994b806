"""Roundhouse kicks, and kicks of a ball out of a run-up. Both are drawn for the left leg and mirrored for the right
one."""

from __future__ import annotations

import math
import random
from dataclasses import dataclass, replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.leaps import running, running_step
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT

_LEG = 0.79
"""Metres from hip to ankle of a leg that is almost straight."""
_HIP = 0.93
"""Metres of the hip of a leg that is swung to the side."""
_GUARD = {
    LEFT: HandPlace((0.08, -0.04, 0.28), "trunk", (0.5, -1.0, -0.1)),
    RIGHT: HandPlace((0.08, -0.02, 0.22), "trunk", (0.5, -1.0, -0.1)),
}
_SWUNG = {
    LEFT: HandPlace((0.22, -0.36, -0.24), "trunk", (0.6, -0.4, -0.8)),
    RIGHT: HandPlace((0.06, 0.02, 0.2), "trunk", (0.5, -1.0, 0.0)),
}
"""Arms of a roundhouse: that of the leg is thrown back."""
_PIVOTED: Point = (0.86, -0.45, -0.24)
"""Where the toes of the foot point that a roundhouse is turned on."""
_OPENED: dict[str, Point] = {RIGHT: (0.9, 0.1, 0.4)}
_STEPS = ((0.52, 0.42), (0.68, 0.34), (0.86, 0.32))
"""Metres and seconds of the steps up to a ball, the last ones of these."""


def roundhouse(rng: random.Random, side: str = "", up: float = 0.0, times: int = 1) -> Gesture:
    """Kicks from a guard whose straight leg comes round from the side as the hips turn, and back into the guard.

    Args:
        rng: decides everything that is not given.
        side: of the leg.
        up: metres of the foot over the floor; 0 = at the hip or somewhat higher.
        times: how many.
    """
    side, up = side or rng.choice(SIDES), up or rng.uniform(1.0, 1.1)
    done = Sequel([rng.uniform(0.1, 0.3)])
    guard = Posture((0.0, 0.9, 0.0), (4, 0, 0), (4, 0, 0), hands=_GUARD)
    done.then(rng.uniform(0.35, 0.45), guard, rng.uniform(0.1, 0.25))
    for _ in range(times):
        _round(rng, done, up, guard)
    done.then(rng.uniform(0.5, 0.7), STAND)
    return (done if side == LEFT else done.mirrored()).gesture(rng, ["kick", "kick-round", "kick-guard"], side, times)


def _round(rng: random.Random, done: Sequel, up: float, guard: Posture) -> None:
    """Add one kick to a body in guard."""
    high = min(max((up - 0.9) / 0.5, 0.0), 1.2)
    turn, lean, pace = rng.uniform(78, 92), 14 + 20 * high, rng.uniform(0.95, 1.1)
    flat, pivot = FootPlace((0.09, 0.07, 0.0), (0.25, -0.45, 0.86)), FootPlace((0.09, 0.075, 0.0), _PIVOTED)
    hips: Point = (0.03, 0.92 + 0.02 * high, 0.0)
    wound = replace(guard, pelvis=(0.04, 0.89, 0.02), tilt=(6, 0, 14), spine=(4, 0, 8), over=RIGHT)
    wound = replace(wound, feet={LEFT: FootPlace((0.16, 0.2, -0.28), (0.1, -0.85, 0.2)), RIGHT: flat})
    chambered = Posture(hips, (2, 0.6 * lean, -0.3 * turn), (6, 0, 4), over=RIGHT, hands=_GUARD)
    lifted = FootPlace((0.46, 0.5 + 0.3 * (up - 0.6), -0.26), (0.2, -0.7, -0.3))
    half = FootPlace((0.09, 0.075, 0.0), (0.7, -0.45, 0.55))
    chambered = replace(chambered, feet={LEFT: lifted, RIGHT: half}, knees={**_OPENED, LEFT: (0.75, 0.4, 0.6)})
    far = math.sqrt(max(_LEG**2 - (up - _HIP - 0.04 * high) ** 2, 0.1))
    hit = replace(chambered, tilt=(0, lean, -turn), spine=(4, 0, -8), hands=_SWUNG)
    struck = FootPlace((-0.02, up, (0.17 if up < 0.8 else 0.11) + far), (-0.3, 0.15 + 0.5 * high, 0.85))
    hit = replace(hit, feet={LEFT: struck, RIGHT: pivot}, knees={**_OPENED, LEFT: (0.35, 0.9, 0.3)})
    sweeps = FootPlace((0.16 + 0.66 * far, up - 0.12, 0.08 + 0.5 * far), (0.5, -0.4, 0.6))
    swings = replace(hit, tilt=(0, 0.9 * lean, -0.72 * turn), spine=(5, 0, -4))
    swings = replace(swings, feet={LEFT: sweeps, RIGHT: pivot}, knees={**_OPENED, LEFT: (0.5, 0.8, 0.4)})
    folded = FootPlace((0.12, min(0.56, up - 0.1), 0.34), (0.0, -0.6, 0.6))
    back = replace(hit, tilt=(4, 0.3 * lean, -0.4 * turn), hands=_GUARD, feet={LEFT: folded, RIGHT: half})
    done.then(0.24 * pace, wound)
    done.then(0.2 * pace, chambered)
    done.then(0.11, swings)
    done.then(0.09, hit, 0.05)
    done.then(0.2 * pace, replace(back, knees={**_OPENED, LEFT: (0.3, 0.5, 0.8)}))
    done.then(0.28 * pace, guard, rng.uniform(0.15, 0.3))


@dataclass(frozen=True)
class _BallStrike:
    """A kick of a ball with the left foot out of a run-up.

    Attributes:
        steps: two or three, the last one onto the right foot.
        high: metres of the foot after the strike.
        starts: seconds before the first step.
    """

    steps: int
    high: float
    starts: float

    def sequel(self, feet: StandingFeet) -> Sequel:
        """The postures over the feet of an idle."""
        done = Sequel([self.starts])
        at: dict[str, float] = dict.fromkeys(SIDES, 0.0)
        side = RIGHT if self.steps % 2 else LEFT
        for stride, seconds in _STEPS[-self.steps : -1]:
            at = running_step(done, feet, at, side, (stride, seconds))
            side = OTHER_SIDE[side]
        plant = at[LEFT] + _STEPS[-1][0]
        self._strikes(done, feet, at[LEFT], plant)
        self._goes_through(done, feet, plant)
        return done

    def _strikes(self, done: Sequel, feet: StandingFeet, behind: float, plant: float) -> None:
        """Step beside the ball with the leg drawn back, and whip it through the ball."""
        seconds = _STEPS[-1][1]
        wide = {
            LEFT: HandPlace((0.34, -0.16, -0.1), "shoulder", (0.3, -0.4, -0.8)),
            RIGHT: HandPlace((0.48, -0.04, 0.1), "shoulder", (0.1, -0.8, -0.5)),
        }
        wound = {
            LEFT: HandPlace((0.2, -0.38, -0.16), "shoulder", (0.5, -0.3, -0.9)),
            RIGHT: HandPlace((0.44, 0.02, -0.06), "shoulder", (0.1, -0.8, -0.5)),
        }
        passing = FootPlace((0.12, 0.26, behind + 0.16), (0.1, -0.4, 0.9))
        over = running(behind + 0.2, {LEFT: feet[LEFT].tiptoe(30, behind), RIGHT: passing}, LEFT, 0.6)
        done.then(0.5 * seconds, replace(over, hands=wide))
        stood = feet[RIGHT].flat(plant)
        drawn = FootPlace((0.15, 0.46, plant - 0.74), (0.1, -0.7, -0.6))
        ready = Posture((-0.04, 0.88, plant - 0.2), (8, 6, -14), (-4, 0, -12), (-2, 0, 14), hands=wound)
        knees: dict[str, Point] = {LEFT: (0.25, -0.5, 0.9)}
        done.then(0.5 * seconds, replace(ready, feet={RIGHT: stood, LEFT: drawn}, knees=knees))
        leads = FootPlace((0.15, 0.44, plant - 0.56), (0.1, -0.8, -0.4))
        leading = replace(ready, pelvis=(-0.05, 0.87, plant - 0.1), tilt=(4, 8, 0), spine=(8, 0, -6), hands=wound)
        done.then(0.08, replace(leading, feet={RIGHT: stood, LEFT: leads}, knees=knees))
        hit = FootPlace((0.07, 0.1, plant + 0.17), (0.0, -0.8, 0.6))
        struck = Posture((-0.05, 0.87, plant - 0.02), (-4, 10, 16), (16, 0, 8), (8, 0, -8), hands=wide)
        done.then(0.09, replace(struck, feet={RIGHT: stood, LEFT: hit}))

    def _goes_through(self, done: Sequel, feet: StandingFeet, plant: float) -> None:
        """Follow through, come down on the foot that kicked, and stand."""
        far = math.sqrt(_LEG**2 - (self.high - 0.85) ** 2)
        swung = {
            LEFT: HandPlace((0.3, -0.26, -0.2), "shoulder", (0.5, -0.3, -0.9)),
            RIGHT: HandPlace((0.02, -0.12, 0.4), "shoulder", (0.6, -0.7, 0.0)),
        }
        rising = FootPlace((0.03, 0.4, plant + 0.68), (0.0, -0.4, 0.9))
        through = Posture((-0.03, 0.89, plant + 0.06), (-8, 6, 20), (18, 0, 8), (8, 0, -10), hands=swung)
        done.then(0.07, replace(through, feet={RIGHT: feet[RIGHT].flat(plant), LEFT: rising}))
        top = FootPlace((-0.02, self.high, plant + 0.18 + far), (0.0, 0.2, 0.95))
        followed = replace(through, pelvis=(-0.02, 0.91, plant + 0.12), tilt=(-10, 4, 22))
        done.then(0.12, replace(followed, feet={RIGHT: feet[RIGHT].tiptoe(12, plant), LEFT: top}))
        there = plant + 0.52
        falls = FootPlace((0.09, 0.34, there + 0.06), (0.0, -0.3, 0.9))
        lowering = Posture((0.0, 0.9, plant + 0.26), (2, 0, 10), (8, 0, 0))
        done.then(0.2, replace(lowering, feet={RIGHT: feet[RIGHT].tiptoe(35, plant), LEFT: falls}))
        landed = {RIGHT: feet[RIGHT].tiptoe(52, plant), LEFT: feet[LEFT].flat(there)}
        done.then(0.16, running(there - 0.16, landed, RIGHT, 0.5))
        passing = {LEFT: feet[LEFT].flat(there), RIGHT: feet[RIGHT].flat(there - 0.12, 0.09)}
        done.then(0.28, Posture((0.0, 0.92, there - 0.03), (3, 0, 0), feet=passing))
        done.then(0.3, Posture((0.0, 0.94, there), feet={side: foot.flat(there) for side, foot in feet.items()}))


def ball_strike(rng: random.Random, side: str = "", steps: int | None = None) -> Gesture:
    """A hard kick of a ball out of a run-up, as those of penalties and free kicks.

    Args:
        rng: decides everything that is not given.
        side: of the foot that kicks.
        steps: of the run-up, two or three.
    """
    side, steps = side or rng.choice(SIDES), steps or rng.choice((2, 3))
    way = _BallStrike(steps, rng.uniform(0.75, 0.95), rng.uniform(0.2, 0.5))
    kinds = ["kick-ball", "kick-ball-run", "kick-ball-hard"]
    return on_feet(way.sequel, kinds, rng.uniform(0.4, 0.8), side=side, mirror=side == RIGHT)
