"""Swings of a bat: sideways to the ball, a stride, the hips before the shoulders, and the hands through. Drawn for a
batter who stands with the left side to the ball, and mirrored for one with the right side."""

from __future__ import annotations

import random
from dataclasses import dataclass

from marey.drawing.flights import StandingFeet, on_feet
from marey.drawing.gesture import Gesture
from marey.drawing.postures import FootPlace, HandPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.posing.standing import LEFT, RIGHT

_TOP: Point = (0.9, -0.5, -0.2)
_LOW: Point = (0.5, -1.0, 0.0)
_REACH = 0.08
"""Metres from one hand to the other on the handle."""


@dataclass(frozen=True)
class _Swing:
    """A swing towards the left side of the body.

    Attributes:
        stride: metres of the step of the front foot.
        pace: factor of the seconds of the windup and the follow-through.
        starts: seconds before it.
        high: metres of the hands over the shoulders at the ball.
    """

    stride: float
    pace: float
    starts: float
    high: float

    def sequel(self, feet: StandingFeet) -> Sequel:
        """The postures over the feet of an idle: the ball comes from the left."""
        apart = {LEFT: FootPlace((0.2, 0.07, 0.02)), RIGHT: FootPlace((0.2, 0.07, 0.0))}
        done = Sequel([self.starts])
        ready = self._held((0.0, 0.86, -0.03), (10, 0, -6), (8, 0, -14), (0, 0, 46), (-0.2, 0.1, 0.12), apart)
        done.then(0.6 * self.pace, ready, 0.25)
        raised = {LEFT: FootPlace((0.16, 0.16, 0.04), (0.3, -0.6, 0.8)), RIGHT: apart[RIGHT]}
        loaded = self._held((-0.1, 0.86, -0.03), (8, 6, -18), (8, 2, -26), (0, 0, 66), (-0.3, 0.12, 0.04), raised)
        done.then(0.38 * self.pace, loaded)
        planted = {LEFT: FootPlace((0.2 + self.stride, 0.07, 0.04), (0.75, -0.45, 0.5)), RIGHT: apart[RIGHT]}
        strides = self._held((0.02, 0.82, -0.02), (8, 4, 6), (6, 2, -40), (0, 0, 62), (-0.34, 0.1, -0.02), planted)
        done.then(0.26, strides)
        self._swings(done, planted)
        lowers = self._held((0.06, 0.9, 0.0), (4, 0, 30), (4, 0, 10), (0, 0, -20), (0.06, -0.3, 0.32), planted)
        done.then(0.45, lowers)
        done.then(0.5, Posture((0.0, 0.94, 0.0), feet={one: foot.flat() for one, foot in feet.items()}))
        return done

    def _swings(self, done: Sequel, planted: dict[str, FootPlace]) -> None:
        """The hips turn with the back foot on its toes, the hands go through the ball and up over the shoulder."""
        pivoting = {**planted, RIGHT: FootPlace((0.19, 0.13, 0.02), (-0.5, -0.8, 0.4))}
        turned = {**planted, RIGHT: FootPlace((0.17, 0.17, 0.03), (-0.75, -0.85, 0.15))}
        slots = self._held((0.07, 0.82, 0.0), (8, -4, 36), (8, 0, -34), (0, 0, 20), (-0.3, 0.0, 0.14), pivoting)
        hits = self._held((0.1, 0.83, 0.0), (8, -8, 68), (6, 0, 20), (4, 0, -14), (0.06, self.high, 0.5), turned)
        wraps = self._held((0.1, 0.86, 0.0), (4, -6, 80), (2, -2, 50), (0, 0, -46), (0.42, 0.06, 0.2), turned)
        ends = self._held((0.1, 0.88, 0.0), (2, -4, 82), (0, -2, 54), (0, 0, -56), (0.26, 0.16, 0.02), turned)
        done.then(0.1, slots)
        done.then(0.09, hits)
        done.then(0.09, wraps)
        done.then(0.22 * self.pace, ends, 0.3)

    def _held(
        self, pelvis: Point, tilt: Point, spine: Point, neck: Point, grip: Point, feet: dict[str, FootPlace]
    ) -> Posture:
        """A posture with both hands on the handle at a place left, up and ahead of the middle of the shoulders."""
        left, up, ahead = grip
        hands = {
            LEFT: HandPlace((left, up - 0.5 * _REACH, ahead), "trunk", _LOW),
            RIGHT: HandPlace((-left, up + 0.5 * _REACH, ahead - 0.02), "trunk", _TOP),
        }
        return Posture(pelvis, tilt, spine, neck, 0.0, hands, feet)


def bat_swing(rng: random.Random, side: str = "") -> Gesture:
    """A full swing of a bat with both hands.

    Args:
        rng: decides sizes and times.
        side: of the hand on top, right for a batter who stands with the left side to the ball; empty = right.
    """
    way = _Swing(rng.uniform(0.2, 0.28), rng.uniform(0.9, 1.1), rng.uniform(0.2, 0.4), rng.uniform(-0.24, -0.14))
    return on_feet(way.sequel, ["bat-swing"], rng.uniform(0.3, 0.6), side=side or RIGHT, mirror=side == LEFT)
