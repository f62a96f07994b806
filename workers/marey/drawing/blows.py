"""Blows as a series: hands that are drawn back, strike and return to guard, with the trunk behind them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES
from marey.drawing.stances import glide, settle, turn_hips
from marey.posing.standing import LEFT, StandingBody

Array = NDArray[np.floating]
Point = Sequence[float]

ELBOW = (0.5, -1.0, -0.2)
"""Where an elbow points in guard; see `StandingBody.reach`."""
_HIPS_SHARE = 0.35
_NECK = (12,)


@dataclass(frozen=True)
class Blow:
    """One blow of one hand or of both.

    Attributes:
        begin: seconds at which the hand leaves the guard.
        hands: the places of each hand that acts, see `StandingBody.hold`: drawn back, perhaps one in passing, and
            where the blow ends.
        wind, out, stay, back: seconds of drawing back, striking, staying there and returning.
        side: the side of the trunk that goes forward.
        twist, stoop: degrees by which the trunk turns and bends in the blow.
        ahead: metres that the hips move forward.
        coil: share of the twist by which the trunk first turns the other way.
        pole: where the elbow points while striking.
    """

    begin: float
    hands: Mapping[str, Sequence[Point]]
    wind: float
    out: float
    stay: float
    back: float
    side: str
    twist: float = 0.0
    stoop: float = 0.0
    ahead: float = 0.0
    coil: float = 0.45
    pole: Point = ELBOW

    @property
    def hit(self) -> float:
        """Seconds at which it ends ahead."""
        return self.begin + self.wind + self.out

    @property
    def end(self) -> float:
        return self.hit + self.stay + self.back

    def times(self, places: int) -> list[float]:
        """Times of the guard, of each place, of the end of the stay and of the guard again."""
        first = self.begin + self.wind
        passing = [first + self.out * k / (places - 1) for k in range(places)]
        return [self.begin, *passing, self.hit + self.stay, self.end]


def strike(body: StandingBody, way: Array, guards: Mapping[str, Point], blows: Sequence[Blow]) -> None:
    """Let the trunk, then the hands of a body carry out blows; the blows of one hand must not overlap.

    Args:
        body: with its feet in place already.
        way: (T,) progress into guard, see `StandingBody.move_arm`.
        guards: where each hand waits that is not to hang.
        blows: in order.
    """
    frames = len(way)
    turned, bent, forth = np.zeros(frames), np.zeros(frames), np.zeros(frames)
    for blow in blows:
        times = [blow.begin, blow.begin + blow.wind, blow.hit, blow.hit + blow.stay, blow.end]
        course = glide(frames, times, [[0.0], [-blow.coil], [1.0], [0.9], [0.0]])[:, 0]
        turned += (-1.0 if blow.side == LEFT else 1.0) * blow.twist * course
        bent += blow.stoop * np.maximum(course, -0.45)
        forth += blow.ahead * course
    body.shift(np.zeros(frames), forth)
    turn_hips(body, _HIPS_SHARE * turned)
    body.lean((1 - _HIPS_SHARE) * turned, "up")
    body.lean(-0.8 * turned, "up", _NECK)
    body.turn(0, "left", 0.3 * bent)
    body.lean(0.7 * bent, "left")
    body.lean(-0.5 * bent, "left", _NECK)
    settle(body)
    for side in SIDES:
        if side in guards:
            path, poles = _course(frames, guards[side], [blow for blow in blows if side in blow.hands], side)
            body.hold(side, way, path, pole=poles)


def _course(frames: int, guard: Point, blows: Sequence[Blow], side: str) -> tuple[Array, Array]:
    """The places (T, 3) of a hand and where its elbow points (T, 3)."""
    times, points, poles = [-1.0], [guard], [ELBOW]
    for blow in blows:
        places = blow.hands[side]
        times += blow.times(len(places))
        points += [guard, *places, places[-1], guard]
        poles += [ELBOW, *[blow.pole] * (len(places) + 1), ELBOW]
    times.append(times[-1] + 1.0)
    points.append(guard)
    poles.append(ELBOW)
    return glide(frames, times, np.array(points, np.float64)), glide(frames, times, np.array(poles, np.float64))
