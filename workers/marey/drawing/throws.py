"""Throws from above, below and the side, with one hand or both."""

from __future__ import annotations

import random
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.stances import glide, settle, step, turn_hips
from marey.posing.standing import LEFT, OTHER_SIDE, StandingBody, envelope

Array = NDArray[np.floating]

_NECK = (12,)
_THROWS = {
    "throw-over": ((0.36, 0.1, -0.16), (0.24, 0.38, 0.08), (0.1, 0.2, 0.48), (-0.12, -0.3, 0.34)),
    "throw-under": ((0.17, -0.45, -0.2), (0.12, -0.46, 0.12), (0.08, -0.2, 0.46), (0.05, 0.0, 0.45)),
    "throw-side": ((0.5, -0.08, -0.16), (0.48, -0.02, 0.22), (0.08, -0.04, 0.5), (-0.2, -0.16, 0.36)),
    "throw-both": ((0.09, 0.36, -0.15), (0.1, 0.5, 0.08), (0.07, 0.24, 0.46), (0.1, -0.16, 0.42)),
}
"""Where the hand is drawn back to, what it passes, where it lets go and where it stops; see `StandingBody.hold`."""
_TRUNK = {
    "throw-over": {"twist": (24, 46), "back": (4, 12), "stoop": (16, 36), "sway": (4, 12)},
    "throw-under": {"twist": (8, 26), "back": (-8, 4), "stoop": (4, 18), "sway": (-4, 4)},
    "throw-side": {"twist": (28, 48), "back": (0, 6), "stoop": (6, 20), "sway": (-6, 4)},
    "throw-both": {"twist": (0, 0), "back": (10, 22), "stoop": (14, 34), "sway": (0, 0)},
}
"""Degrees of the trunk: turned away, leant back, bent forward and leant aside."""
_PAST_SHOULDER = [0.14, 0.0, 0.04]
"""Metres outward, up and forward by which a hand drawn back keeps clear of the shoulder, where the elbow would fold."""


def throw(rng: random.Random) -> Gesture:
    form = rng.choices(list(_THROWS), (5, 3, 2, 2))[0]
    side = BOTH if form == "throw-both" else rng.choices(SIDES, (1, 1))[0]
    lead = rng.choice(SIDES) if side == BOTH else OTHER_SIDE[side]
    twist, back, stoop, sway = (rng.uniform(*_TRUNK[form][name]) for name in ("twist", "back", "stoop", "sway"))
    hard = rng.choice(["hard", "", "", "easy"])
    snap = {"hard": rng.uniform(0.8, 0.95), "": rng.uniform(0.95, 1.15), "easy": rng.uniform(1.1, 1.3)}[hard]
    stride = {"hard": rng.uniform(0.3, 0.5), "": rng.uniform(0.0, 0.4), "easy": rng.uniform(-0.2, 0.2)}[hard]
    stride = 0.0 if stride < 0.12 else stride
    phases = _Phases(rng, snap)
    chest = np.array([rng.uniform(0.04, 0.14), rng.uniform(-0.28, -0.12), rng.uniform(0.22, 0.32)])
    places = [np.array(place) + [rng.gauss(0, 0.025) for _ in range(3)] for place in _THROWS[form]]
    lifted = [0.15, 0.24, 0.24] if side == BOTH else 0.5 * (chest + places[0]) + _PAST_SHOULDER
    points = [chest, chest, lifted, places[0], places[0] + [0.0, 0.0, -0.03], *places[1:]]
    gathers, counters = rng.random() < 0.5, rng.random() < 0.65
    returns = rng.random() < 0.7
    sink = rng.uniform(0.01, 0.05)

    def change(body: StandingBody) -> None:
        way = phases.way(body)
        bends = [(0, 0, 0), (0, 0, 0), (-1, -back, -1), (-1, -back, -1), (0.6, stoop, 1), (0.5, 0.8 * stoop, 0.6)]
        turned, bent, leant = phases.trunk(body, [*[(a * twist, b, c * sway) for a, b, c in bends], (0, 0, 0)])
        sign = 1.0 if side == LEFT else -1.0
        if stride:
            step(body, lead, (0.0, stride), phases.go - 0.4, 0.4)
            if returns:
                step(body, lead, (0.0, -stride), phases.lower, 0.5)
        forth = phases.forth(body, returns=returns or not stride)
        body.shift(-sink * np.clip(forth, 0, 1), (0.45 * stride or 0.05) * forth)
        turn_hips(body, -sign * -0.35 * turned if side != BOTH else 0.0 * turned)
        body.lean(sign * turned if side != BOTH else 0.0 * turned, "up")
        body.turn(0, "left", 0.3 * bent)
        body.lean(0.7 * bent, "left")
        body.lean(-sign * leant, "forward")
        body.lean(-0.3 * bent - 4 * way, "left", _NECK)
        settle(body)
        path = glide(len(body.joints), phases.hand, points)
        for one in SIDES:
            if side in (one, BOTH):
                body.hold(one, way, path, lag=0.0, pole=(1.0, -0.4, -0.3))
            elif gathers or counters:
                _other_hand(body, one, way, phases.hand, chest, gathers=gathers, counters=counters)

    kinds = ["throw", form, "throw-hand" if side != BOTH else "throw-both"]
    kinds += [f"throw-{hard}"] if hard else []
    kinds += ["throw-step"] if stride > 0.2 else []
    return Gesture(phases.end + rng.uniform(0.35, 1.0), tuple(dict.fromkeys(kinds)), change, side)


class _Phases:
    """Seconds at which a throw goes from one phase to the next.

    Attributes:
        start: the hands go to the ball before the chest, which takes `gather`.
        begin: of the wind-up, which takes `wind`.
        go, pass_by, let_go: the arm comes forward, passes the body and lets go.
        stop: of the hand.
        lower: the hands go down, which takes `fall`.
    """

    def __init__(self, rng: random.Random, snap: float) -> None:
        """Draw the times; `snap`: factor of the seconds from `go` to `let_go`."""
        self.start, self.gather = rng.uniform(0.1, 0.9), rng.uniform(0.35, 0.7)
        wait = rng.choice([0.1, rng.uniform(0.1, 1.0)])
        self.wind, hang = rng.uniform(0.45, 0.9), rng.uniform(0.06, 0.3)
        self.begin = self.start + self.gather + wait
        self.go = self.begin + self.wind + hang
        self.pass_by, self.let_go = self.go + 0.14 * snap, self.go + 0.26 * snap
        self.stop = self.let_go + rng.uniform(0.22, 0.4)
        rest, self.fall = rng.uniform(0.1, 0.7), rng.uniform(0.5, 1.0)
        self.lower = self.stop + rest

    @property
    def end(self) -> float:
        return self.lower + self.fall

    @property
    def hand(self) -> list[float]:
        """Times of the eight places of the hand that throws."""
        middle, wound = self.begin + 0.5 * self.wind, self.begin + self.wind
        return [0.0, self.begin, middle, wound, self.go, self.pass_by, self.let_go, self.stop]

    def way(self, body: StandingBody) -> Array:
        """Share (T,) of the gesture."""
        hold = self.lower - self.start - self.gather
        return envelope(len(body.joints), self.start, self.gather, hold, self.fall)

    def trunk(self, body: StandingBody, bends: Sequence[tuple[float, float, float]]) -> Array:
        """Degrees (3, T) of the trunk, through seven bends."""
        times = [0.0, self.begin, self.begin + self.wind, self.go, self.let_go, self.stop, self.end]
        return glide(len(body.joints), times, bends).T

    def forth(self, body: StandingBody, *, returns: bool) -> Array:
        """Share (T,) of the weight that is on the foot ahead, and stays there unless it returns."""
        if returns:
            times = [0.0, self.begin, self.go - 0.1, self.let_go, self.stop, self.end]
            return glide(len(body.joints), times, [[0], [0], [-0.03], [1], [1], [0]])[:, 0]
        times = [0.0, self.go - 0.1, self.let_go, self.end]
        return glide(len(body.joints), times, [[0], [-0.02], [1], [0.9]])[:, 0]


def _other_hand(
    body: StandingBody,
    side: str,
    way: np.ndarray,
    times: list[float],
    chest: np.ndarray,
    *,
    gathers: bool,
    counters: bool,
) -> None:
    """The hand that does not throw: at the ball at first, pointing ahead while the other is drawn back, then home."""
    home, ahead = (0.24, -0.4, 0.04), (0.16, -0.06, 0.42)
    first = tuple(chest) if gathers else home
    points = [first, first, ahead if counters else home, ahead if counters else home, (0.3, -0.28, 0.08), home]
    path = glide(len(way), [0.0, times[1], *times[3:5], times[6], times[7] + 0.1], points)
    body.hold(side, way, path, lag=0.04)
