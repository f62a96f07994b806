"""Lunges: a long step ahead, back or aside until the thigh of the leg in front is level, legs by turns."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import STAND, FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel, both
from marey.posing.standing import OTHER_SIDE, SIGN

_HANDS = {
    "hips": HandPlace((0.06, -0.4, 0.05), "shoulder", (1.0, 0.1, -0.5)),
    "clasped": HandPlace((-0.13, -0.16, 0.27), "shoulder", (0.8, -0.8, -0.2)),
    "hang": None,
}
"""Where the hands are; None = they hang beside the body, as with weights."""
_SHIN, _THIGH = 0.03, 0.37
"""Metres of the knee of the front leg ahead of its ankle, and of the hips behind that knee, when the thigh is level."""
_ASIDE_M, _MOMENT_S = 0.66, 0.12
"""Metres of a step aside, and seconds at the lowest point."""
_REAR: Point = (0.1, -0.55, 1.0)
_FRONT: Point = (0.12, 0.4, 1.0)
"""Where the knees of the rear and of the front leg point."""


@dataclass(frozen=True)
class _Lunge:
    """Lunges of a body, in metres, degrees and seconds.

    Attributes:
        form: see `lunges`.
        stride: from ankle to ankle.
        low: of the hips over the floor when the thigh is level.
        lean: of the trunk.
        pace: factor of the seconds.
        hands: key of `_HANDS`.
        holds: seconds at the lowest point.
    """

    form: str
    stride: float
    low: float
    lean: float
    pace: float
    hands: str
    holds: float

    def posture(self, pelvis: Point, feet: StandingFeet, places: dict[str, tuple[float, float]]) -> Posture:
        """The posture with feet by side at metres forward and with degrees of a heel that is lifted."""
        put = {
            side: feet[side].tiptoe(heel, at) if heel else feet[side].flat(at) for side, (at, heel) in places.items()
        }
        rear = min(places, key=lambda side: places[side][0])
        knees = {rear: _REAR, OTHER_SIDE[rear]: _FRONT} if pelvis[1] < 0.85 else {}
        lean = self.lean if pelvis[1] < 0.85 else 0.4 * self.lean
        return Posture(pelvis, (lean, 0, 0), (0.5 * lean, 0, 0), (-lean, 0, 0), 1.0, self._arms(), put, knees)

    def stands(self, feet: StandingFeet, at: float) -> Posture:
        """Upright with both feet `at` metres forward."""
        return self.posture((0.0, 0.94, at), feet, dict.fromkeys(SIDES, (at, 0.0)))

    def down(self, done: Sequel, feet: StandingFeet, front: str, rear: float) -> None:
        """Step with one foot, ahead or back, and go down; the rear foot is at `rear` metres forward."""
        moves = OTHER_SIDE[front] if self.form == "back" else front
        ahead = rear + self.stride
        half = {front: (ahead, 0.0), OTHER_SIDE[front]: (rear, 34.0)}
        deep = {front: (ahead, 0.0), OTHER_SIDE[front]: (rear, 62.0)}
        share = 0.5 if moves == front else 0.66
        done.then(0.5 * self.pace, self.posture((0.0, 0.8, rear + share * self.stride), feet, half))
        done.then(0.42 * self.pace, self.posture((0.0, self.low, ahead - _THIGH + _SHIN), feet, deep), self.holds)

    def up(self, done: Sequel, feet: StandingFeet, front: str, rear: float) -> None:
        """Push up on both feet."""
        places = {front: (rear + self.stride, 0.0), OTHER_SIDE[front]: (rear, 38.0)}
        share = {"ahead": 0.45, "back": 0.7, "walking": 0.75}[self.form]
        done.then(0.38 * self.pace, self.posture((0.0, 0.8, rear + share * self.stride), feet, places))

    def aside(self, done: Sequel, feet: StandingFeet, side: str) -> None:
        """Step to a side, go down over that foot while the other leg stays straight, and push back."""
        foot, stays, out = feet[side], feet[OTHER_SIDE[side]].flat(0.0), SIGN[side]
        at = FootPlace((foot.out + _ASIDE_M, foot.flat().at[1], foot.forward))
        half = Posture((0.5 * out * _ASIDE_M, 0.84, 0.0), (0.5 * self.lean, 0, 0), hands=self._arms())
        half = replace(half, feet={side: at, OTHER_SIDE[side]: stays})
        low = replace(half, pelvis=(out * (_ASIDE_M - 0.06), self.low, -0.2), tilt=(24.0, 0, 0), spine=(12.0, 0, 0))
        low = replace(low, neck=(-24.0, 0, 0), knees={side: (0.25, 0.2, 1.0)})
        done.then(0.5 * self.pace, half)
        done.then(0.5 * self.pace, low, self.holds)
        done.then(0.45 * self.pace, half)

    def _arms(self) -> dict[str, HandPlace]:
        hand = _HANDS[self.hands]
        return both(hand) if hand else {}


def lunges(
    rng: random.Random, form: str = "ahead", times: int | None = None, side: str = "", hold: float | None = None
) -> Gesture:
    """A body that stands and does lunges.

    Args:
        rng: decides everything that is not given.
        form: `ahead` or `back` from where it stands, `aside`, or `walking`.
        times: how many; None = four.
        side: of the front leg, or to which it goes; empty = legs by turns.
        hold: seconds for which the lowest posture is held; None = a moment.
    """
    times, first, starts = times or 4, side or rng.choice(SIDES), rng.uniform(0.2, 0.5)
    hands, stride, low = rng.choice(list(_HANDS)), rng.uniform(0.76, 0.84), rng.uniform(0.53, 0.56)
    pace, lean = rng.uniform(0.95, 1.2), rng.uniform(4, 10)
    way = _Lunge(form, stride, low, lean, pace, hands, _MOMENT_S * pace if hold is None else hold)
    fronts = [first if side or k % 2 == 0 else OTHER_SIDE[first] for k in range(times)]
    after = rng.uniform(0.3, 0.7)
    return on_feet(lambda feet: _sequel(way, fronts, starts, feet), ["lunges"], after, side=side, times=times)


def _sequel(way: _Lunge, fronts: list[str], starts: float, feet: StandingFeet) -> Sequel:
    """The postures over the feet of an idle, with the front legs one after another."""
    done, at = Sequel([starts]), 0.0
    if _HANDS[way.hands]:
        done.then(0.45, way.stands(feet, 0.0), 0.05)
    for front in fronts:
        rear = at - way.stride if way.form == "back" else at
        if way.form == "aside":
            way.aside(done, feet, front)
        else:
            way.down(done, feet, front, rear)
            way.up(done, feet, front, rear)
        at += way.stride if way.form == "walking" else 0.0
        done.then(0.42 * way.pace, way.stands(feet, at), 0.1 * way.pace)
    still = {side: foot.flat(at) for side, foot in feet.items()}
    done.then(0.45, Posture((0.0, 0.94, at), feet=still) if at else STAND)
    return done
