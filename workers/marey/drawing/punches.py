"""Blows of the fists of a body in guard: their ways, with the turn of trunk, hips and feet behind them."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.guards import drawn_stance
from marey.drawing.stances import settle, turn_hips
from marey.motion.filters import smooth_seconds
from marey.motion.rotations import from_rotvec, rotate
from marey.posing.limbs import FPS
from marey.posing.standing import ARMS, LEFT, LEGS, OTHER_SIDE, RIGHT, SIGN, StandingBody, eased, way_through
from marey.posing.still import standing_still

Array = NDArray[np.floating]
Point = tuple[float, float, float]

GUARD: Mapping[str, Point] = {LEFT: (0.06, -0.02, 0.22), RIGHT: (0.08, -0.05, 0.17)}
"""Places of the wrists in guard: outward, up and forward of the middle of the shoulders, metres; the left leads."""
LEAD_M = 0.06
"""Metres by which the fist of the leading hand goes further: its shoulder is ahead of the other in the stance."""
ELBOW = (0.45, -1.0, -0.1)
SMOOTH_S = 0.025
"""Standard deviation of the filter of the ways of fists, seconds."""


STRIDE_M = 0.04
"""Metres by which the hips go ahead in a blow."""
PIVOTS, LIFTS_M = 1.3, 0.04
"""Degrees by which a foot pivots for each of the hips, and metres by which its heel rises."""


@dataclass(frozen=True)
class Strike:
    """A way of a fist from the guard and back.

    Attributes:
        times: seconds.
        way: places of the wrist at these times, as `GUARD`, between the first and the last, which are the guard's.
        twist: degrees of the trunk at these times, to the other side.
        elbow: where it points meanwhile.
        elbows: the same at the times of the way, of a blow with the elbow itself; empty = as `elbow`.
        hips: share of the twist that the hips have, on feet that pivot with them.
        sink: metres by which the hips go down at these times; empty = as far as the trunk turns.
    """

    times: tuple[float, ...]
    way: tuple[Point, ...]
    twist: tuple[float, ...]
    elbow: Point = ELBOW
    hips: float = 0.0
    sink: tuple[float, ...] = ()
    elbows: tuple[Point, ...] = ()

    def weighted(self, weight: str) -> Strike:
        """Return a heavy or a light one: the body loads longer or shorter, and turns and sinks more or less."""
        if weight not in _WEIGHTS or not self.hips:
            return self
        load, body, returns = _WEIGHTS[weight]
        loaded = self.times[1]
        steps = [load * loaded, *(load * loaded + each - loaded for each in self.times[2:-1])]
        end = steps[-1] + returns * (self.times[-1] - self.times[-2])
        twist, sink = (tuple(body * each for each in values) for values in (self.twist, self.sink))
        return replace(self, times=(0.0, *steps, end), twist=twist, sink=sink)

    def on(self, side: str) -> tuple[Point, ...]:
        """Return the way of the fist of a side; the leading one goes further where it strikes."""
        if side != LEFT:
            return self.way
        wound = min(z for _, _, z in self.way)
        return tuple((x, y, z + (LEAD_M if z > wound + 0.2 else 0.0)) for x, y, z in self.way)

    @property
    def seconds(self) -> float:
        """Seconds from guard to guard."""
        return self.times[-1]


_WEIGHTS: Mapping[str, tuple[float, float, float]] = {"heavy": (1.7, 1.12, 1.35), "light": (0.75, 0.7, 0.8)}
"""Of a heavy and a light blow: factors of the seconds in which the body loads, of what it does, and of the return."""
STRAIGHT = Strike((0.0, 0.12, 0.19, 0.44), ((-0.02, 0.0, 0.66), (-0.02, 0.0, 0.66)), (0.0, 24.0, 24.0, 0.0))
_HOOK = Strike(
    (0.0, 0.22, 0.31, 0.37, 0.45, 0.8),
    ((0.34, -0.04, 0.0), (0.46, 0.14, 0.28), (0.06, 0.18, 0.53), (-0.16, 0.14, 0.38)),
    (0.0, -30.0, 4.0, 52.0, 62.0, 0.0),
    (1.0, 0.35, -0.2),
    0.45,
    (0.0, 0.05, 0.03, 0.01, 0.0, 0.0),
)
_UPPERCUT = Strike(
    (0.0, 0.26, 0.38, 0.47, 0.56, 0.92),
    ((0.16, -0.30, 0.06), (0.07, -0.17, 0.2), (-0.02, 0.06, 0.44), (-0.05, 0.23, 0.4)),
    (0.0, -20.0, -6.0, 26.0, 30.0, 0.0),
    (0.3, -1.0, -0.2),
    0.5,
    (0.0, 0.10, 0.07, -0.015, -0.02, 0.0),
)
_HAYMAKER = Strike(
    (0.0, 0.32, 0.43, 0.5, 0.6, 1.05),
    ((0.34, -0.06, -0.02), (0.54, 0.12, 0.24), (0.08, 0.18, 0.6), (-0.24, 0.12, 0.36)),
    (0.0, -38.0, 0.0, 56.0, 68.0, 0.0),
    (1.0, 0.0, -0.3),
    0.45,
    (0.0, 0.06, 0.04, 0.01, 0.02, 0.0),
)
_OVERHAND = Strike(
    (0.0, 0.24, 0.34, 0.41, 0.49, 0.88),
    ((0.28, 0.1, 0.0), (0.24, 0.32, 0.28), (-0.02, 0.16, 0.62), (-0.14, -0.06, 0.52)),
    (0.0, -26.0, 6.0, 48.0, 58.0, 0.0),
    (0.9, 0.5, -0.3),
    0.45,
    (0.0, 0.02, 0.03, 0.06, 0.08, 0.0),
)
_BACKFIST = Strike(
    (0.0, 0.2, 0.28, 0.34, 0.42, 0.74),
    ((-0.2, 0.02, 0.16), (-0.1, 0.1, 0.4), (0.14, 0.12, 0.64), (0.26, 0.1, 0.56)),
    (0.0, 34.0, 30.0, 8.0, 0.0, 0.0),
    (0.9, -0.2, 0.3),
    0.3,
)
_HAMMER = Strike(
    (0.0, 0.28, 0.4, 0.48, 0.56, 0.98),
    ((0.2, 0.26, 0.0), (0.14, 0.38, 0.26), (0.0, 0.06, 0.64), (-0.02, -0.2, 0.52)),
    (0.0, -20.0, -6.0, 32.0, 38.0, 0.0),
    (0.8, 0.2, 0.0),
    0.35,
    (0.0, -0.01, 0.0, 0.06, 0.08, 0.0),
)
ELBOW_STRIKE = Strike(
    (0.0, 0.22, 0.32, 0.38, 0.48, 0.84),
    ((0.14, -0.08, 0.2), (0.08, 0.04, 0.22), (-0.05, 0.07, 0.22), (-0.12, 0.05, 0.2)),
    (0.0, -30.0, 2.0, 54.0, 64.0, 0.0),
    hips=0.45,
    sink=(0.0, 0.04, 0.03, 0.01, 0.0, 0.0),
    elbows=(ELBOW, (1.0, 0.1, -0.7), (1.0, 0.3, 0.5), (0.4, 0.3, 1.0), (-0.1, 0.25, 1.0), ELBOW),
)
"""A blow with the elbow: the forearm stays folded before the chest, and the upper arm swings round."""
KINDS: Mapping[str, tuple[Strike, str]] = {
    "hook": (_HOOK, ""),
    "haymaker": (_HAYMAKER, RIGHT),
    "uppercut": (_UPPERCUT, RIGHT),
    "jab": (STRAIGHT, LEFT),
    "cross": (STRAIGHT, RIGHT),
    "straight": (STRAIGHT, RIGHT),
    "overhand": (_OVERHAND, RIGHT),
    "backfist": (_BACKFIST, LEFT),
    "hammer fist": (_HAMMER, RIGHT),
    "palm strike": (STRAIGHT, RIGHT),
    "": (STRAIGHT, ""),
}
"""Way of each kind of punch, and the hand that does it if none is named; empty = the one that did not strike last."""


def strike(body: StandingBody, fps: float, strikes: Sequence[tuple[float, Strike, str]], *, drives: bool) -> None:
    """Draw the guard and strikes on a body.

    Args:
        body: that stands, or moves its feet; it is changed.
        fps: frames a second.
        strikes: seconds at which each begins, its way, and the side of its hand.
        drives: hips and feet go with the strikes.
    """
    frames = len(body.joints)
    time, twist, hips = np.arange(frames) / fps, np.zeros(frames), np.zeros(frames)
    sinks = np.zeros(frames)
    pivots = {side: np.zeros(frames) for side in ARMS}
    ways = {side: np.tile(GUARD[side], (frames, 1)) for side in ARMS}
    elbows = {side: np.tile(ELBOW, (frames, 1)) for side in ARMS}
    for start, blow, side in strikes:
        inside = (time >= start) & (time < start + blow.seconds)
        points = [GUARD[side], *blow.on(side), GUARD[side]]
        since = time[inside] - start
        ways[side][inside] = way_through(since, blow.times, points)
        turned = way_through(since, blow.times, blow.twist)
        twist[inside] -= SIGN[side] * turned
        hips[inside] -= SIGN[side] * blow.hips * turned
        pivots[side][inside] += blow.hips * np.maximum(turned, 0.0)
        if blow.sink:
            sinks[inside] += way_through(since, blow.times, blow.sink)
        if blow.elbows:
            elbows[side][inside] = way_through(since, blow.times, blow.elbows)
        else:
            lifted = eased(np.minimum(since, blow.seconds - since) / 0.12)[:, None]
            elbows[side][inside] = (1 - lifted) * np.array(ELBOW) + lifted * np.array(blow.elbow)
    twist = smooth_seconds(twist, SMOOTH_S, fps)
    if drives:
        ahead = smooth_seconds(np.abs(twist) / 36.0, 0.05, fps)
        body.shift(-0.3 * STRIDE_M * ahead - smooth_seconds(sinks, SMOOTH_S, fps), STRIDE_M * ahead)
        hips = smooth_seconds(hips, SMOOTH_S, fps)
        turn_hips(body, hips)
        for side in ARMS:
            _pivot(body, side, smooth_seconds(pivots[side], SMOOTH_S, fps))
        settle(body)
    body.lean(twist - hips if drives else twist, "up")
    for side in ARMS:
        body.hold(
            side,
            np.ones(frames),
            smooth_seconds(ways[side], SMOOTH_S, fps),
            pole=smooth_seconds(elbows[side], 0.05, fps),
        )


def _pivot(body: StandingBody, side: str, degrees: Array) -> None:
    """Turn the foot of the hand that strikes inward about its toes, (T,) degrees, its heel lifted a little."""
    _, _, ankle, toe = LEGS[side]
    about = np.array([0.0, 1.0, 0.0]) * np.radians(-SIGN[side] * PIVOTS * degrees)[:, None]
    heel = rotate(from_rotvec(about), body.joints[:, ankle] - body.joints[:, toe])
    heel[:, 1] += LIFTS_M * np.clip(degrees / 25.0, 0.0, 1.0)
    body.joints[:, ankle] = body.joints[:, toe] + heel


def in_stance(frames: int, rng: random.Random) -> StandingBody:
    """Return a body that stands with its left foot ahead and bent knees."""
    body = StandingBody(standing_still(frames, rng))
    drawn_stance(rng, LEFT, -2.0, None)(body, np.ones(frames))
    return body


def elbow_strike(rng: random.Random, side: str = "", times: int = 1) -> Gesture:
    """A body in guard that strikes with its elbow.

    Args:
        rng: decides everything that is not given.
        side: of the first elbow; the others take turns if none is named.
        times: how many strikes.
    """
    first, begins, rest = side or rng.choice(SIDES), rng.uniform(0.4, 0.7), rng.uniform(0.6, 0.9)
    apart = ELBOW_STRIKE.seconds + rng.uniform(0.05, 0.15)
    hands = [first if side or number % 2 == 0 else OTHER_SIDE[first] for number in range(times)]
    strikes = [(begins + number * apart, ELBOW_STRIKE, hand) for number, hand in enumerate(hands)]
    stance = drawn_stance(rng, LEFT, -2.0, None)

    def change(body: StandingBody) -> None:
        stance(body, np.ones(len(body.joints)))
        strike(body, FPS, strikes, drives=True)

    return Gesture(begins + times * apart + rest, ("elbow-strike",), change, side, times)
