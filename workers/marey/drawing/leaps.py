"""Leaps: a run-up, off one foot, through the air with the legs apart, and onto the other foot."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, replace

from marey.drawing.flights import StandingFeet, flight_height, fly, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, OTHER_SIDE, RIGHT

_UP, _RUNS = 0.95, 0.9
"""Metres of the hips of a body that stands, and that runs."""
_STRIDE, _JUMPS = 0.5, 0.34
"""Metres from the hips to a foot ahead and behind in a flight: of a leap, and of a plain jump out of a run."""
_STEPS = ((0.5, 0.44), (0.68, 0.34), (0.85, 0.3))
"""Metres and seconds of the steps of a run-up, the last ones of these."""
_OUT = {side: HandPlace((0.46, 0.02, 0.06), "shoulder", (0.1, -0.8, -0.6)) for side in SIDES}
_FIFTH = {
    LEFT: HandPlace((0.04, 0.1, 0.5), "shoulder", (0.6, -0.8, 0.0)),
    RIGHT: HandPlace((0.48, 0.06, -0.1), "shoulder", (0.1, -0.8, -0.6)),
}
"""Arms of dancers: out to the sides, and one ahead."""


def running(
    pelvis: float, feet: dict[str, FootPlace], ahead: str, swing: float = 0.4, hands: dict[str, HandPlace] | None = None
) -> Posture:
    """A run with the hips so many metres ahead, and the hand of a side before the body, unless `hands` are given."""
    far = 0.26 * swing
    swung = {
        ahead: HandPlace((0.1, -0.3, 0.08 + far), "shoulder", (0.5, -0.5, -0.8)),
        OTHER_SIDE[ahead]: HandPlace((0.16, -0.36, 0.04 - far), "shoulder", (0.5, -0.3, -0.9)),
    }
    return Posture((0.0, _RUNS, pelvis), (9, 0, 0), (5, 0, 0), (-8, 0, 0), hands=hands or swung, feet=feet)


def running_step(
    done: Sequel,
    feet: StandingFeet,
    at: Mapping[str, float],
    side: str,
    step: tuple[float, float],
    hands: dict[str, HandPlace] | None = None,
) -> dict[str, float]:
    """Add a step of a run-up; return where both feet are, metres ahead by side.

    Args:
        done: the postures up to here.
        feet: of the idle, by side.
        at: where both feet are.
        side: of the foot that steps.
        step: its metres and seconds.
        hands: where they are held; None = they swing.
    """
    other, (stride, seconds) = OTHER_SIDE[side], step
    there = at[other] + stride
    passing = FootPlace((feet[side].out, 0.26 + 0.1 * stride, at[other] - 0.12), (0.1, -0.8, -0.2))
    places = {other: feet[other].tiptoe(12, at[other]), side: passing}
    done.then(0.5 * seconds, running(at[other] + 0.04, places, side, hands=hands))
    places = {other: feet[other].tiptoe(55, at[other]), side: feet[side].flat(there)}
    done.then(0.5 * seconds, running(there - 0.42 * stride, places, other, 1.0, hands))
    return {other: at[other], side: there}


@dataclass(frozen=True)
class _Leap:
    """A leap off the left foot onto the right one, in metres, degrees and seconds.

    Attributes:
        steps: of the run-up, two or three.
        far: from where the left foot leaves to where the right one lands.
        seconds: in the air.
        split: 0 to 1: the legs of a runner, or straight ones that are level.
        dances: with arms held as a dancer does.
        starts: before the first step.
        stride: from the hips to each foot in the air, beside what the split adds.
    """

    steps: int
    far: float
    seconds: float
    split: float
    dances: bool
    starts: float
    stride: float = _STRIDE

    def sequel(self, feet: StandingFeet) -> Sequel:
        """The postures over the feet of an idle."""
        done = Sequel([self.starts])
        at: Mapping[str, float] = dict.fromkeys(SIDES, 0.0)
        side = LEFT if self.steps % 2 else RIGHT
        for stride, seconds in _STEPS[-self.steps :]:
            at = running_step(done, feet, at, side, (stride, seconds), hands=self._arms)
            side = OTHER_SIDE[side]
        self._flight(done, feet, at[LEFT])
        self._runs_out(done, feet, at[LEFT] + self.far)
        return done

    @property
    def _arms(self) -> dict[str, HandPlace] | None:
        """Those of a dancer; None for those of a runner."""
        return _OUT if self.dances else None

    def _running(self, pelvis: float, feet: dict[str, FootPlace], ahead: str, swing: float = 0.4) -> Posture:
        return running(pelvis, feet, ahead, swing, self._arms)

    def _flight(self, done: Sequel, feet: StandingFeet, here: float) -> None:
        """Add the step onto the left foot and off it, the flight, and the landing on the right foot."""
        there = here + self.far
        drives = FootPlace((0.09, 0.42, here + 0.2), (0, -0.7, 0.7))
        over = self._running(here + 0.02, {LEFT: feet[LEFT].flat(here), RIGHT: drives}, LEFT)
        done.then(0.16, replace(over, pelvis=(0.02, 0.86, here + 0.02)))
        leaving = self._flies((here + 0.3, 1.0), 0.1)
        leaving = replace(leaving, feet={**leaving.feet, LEFT: feet[LEFT].tiptoe(62, here)})
        done.then(0.13, leaving)
        landing = self._flies((there - 0.24, 0.96), 0.95)
        landing = replace(landing, feet={**landing.feet, RIGHT: feet[RIGHT].tiptoe(20, there)})

        def shaped(share: float, rise: float) -> Posture:
            pelvis = here + 0.3 + share * (self.far - 0.54)
            return self._flies((pelvis, 0.98 + rise), share)

        fly(done, self.seconds, leaving, landing, shaped)

    def _flies(self, at: tuple[float, float], share: float) -> Posture:
        """In the air, with the hips so far ahead and up, after a share of the flight."""
        apart = 1 - abs(2 * share - 1) ** 2
        ahead, up = at
        reach = self.stride + 0.26 * self.split * apart
        front = FootPlace(
            (0.08, up - 0.62 + (0.1 + 0.26 * self.split) * apart, ahead + reach), (0, -0.5 - 0.3 * self.split, 0.8)
        )
        rear = FootPlace((0.08, up - 0.6 + (0.1 + 0.24 * self.split) * apart, ahead - reach), (0.1, -0.6, -0.7))
        lean = 10 - 6 * self.split
        arms = {
            LEFT: HandPlace((0.12, -0.1, 0.4), "shoulder", (0.6, -0.7, -0.3)),
            RIGHT: HandPlace((0.3, -0.2, -0.24), "shoulder", (0.5, 0.0, -0.9)),
        }
        hands = _FIFTH if self.dances else arms
        knees: dict[str, Point] = {LEFT: (0.1, -0.6, 0.8), RIGHT: (0.1, 0.6, 0.8)}
        return Posture(
            (0.0, up, ahead),
            (lean, 0, 0),
            (-2, 0, 0),
            (-8, 0, 0),
            hands=hands,
            feet={LEFT: rear, RIGHT: front},
            knees=knees,
        )

    def _runs_out(self, done: Sequel, feet: StandingFeet, there: float) -> None:
        """Sink over the foot that landed, step on twice, and stand."""
        passing = FootPlace((0.1, 0.34, there - 0.2), (0.1, -0.8, -0.3))
        sunk = self._running(there, {RIGHT: feet[RIGHT].flat(there), LEFT: passing}, RIGHT)
        done.then(0.16, replace(sunk, pelvis=(-0.02, 0.84, there)))
        at = {RIGHT: there, LEFT: there + 0.66}
        lands = {RIGHT: feet[RIGHT].tiptoe(50, there), LEFT: feet[LEFT].flat(at[LEFT])}
        done.then(0.24, self._running(there + 0.38, lands, RIGHT, 0.8))
        at = running_step(done, feet, at, RIGHT, (0.36, 0.4), hands=self._arms)
        end = at[RIGHT]
        passing = {RIGHT: feet[RIGHT].flat(end), LEFT: feet[LEFT].flat(end - 0.15, 0.08)}
        done.then(
            0.24,
            replace(self._running(end - 0.04, passing, LEFT, 0.2), pelvis=(-0.02, 0.93, end - 0.03), tilt=(1, 0, 0)),
        )
        stood = {side: foot.flat(end) for side, foot in feet.items()}
        done.then(0.24, Posture((0.0, 0.94, end), feet=stood))


def leap(rng: random.Random, form: str = "", side: str = "") -> Gesture:
    """A leap out of a short run-up.

    Args:
        rng: decides everything that is not given.
        form: `far`, `jump` for a plain jump out of a run, `split` for legs that are stretched apart, `dance` for those
            of a dancer; empty = a leap, far or not.
        side: of the foot that takes off.
    """
    form, side = form or rng.choice(("", "far")), side or rng.choice(SIDES)
    far = rng.uniform(1.9, 2.3) if form == "far" else rng.uniform(1.5, 2.0)
    split = rng.uniform(0.8, 1.0) if form in ("split", "dance") else rng.uniform(0.2, 0.5)
    seconds = min(max(far / 4.2, 0.4) + 0.04 * (split > 0.7), 0.54)
    steps, starts = rng.choice((2, 3)), rng.uniform(0.2, 0.5)
    way = _Leap(steps, far, seconds, split, form == "dance", starts)
    if form == "jump":
        way = replace(way, split=0.0, stride=_JUMPS)
    kinds = ["leap", "leap-split" if split > 0.7 else "", "leap-high" if flight_height(seconds) > 0.3 else ""]
    return on_feet(way.sequel, kinds, rng.uniform(0.4, 0.8), side=side, mirror=side == RIGHT)
