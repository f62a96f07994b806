"""Punches, drawn on the body that a network made.

The network gives the footwork, the stance and the turns of a fight, but its fists seldom go out: a punch lasts three of
its tokens. The guard and the ways of the fists are drawn with a turn of the trunk; the legs stay.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import smooth
from marey.generation.fine_wish import FineWish
from marey.posing.standing import ARMS, LEFT, OTHER_SIDE, RIGHT, SIGN, StandingBody, eased, way_through

Array = NDArray[np.floating]
Point = tuple[float, float, float]

GUARD: Mapping[str, Point] = {LEFT: (0.06, -0.02, 0.22), RIGHT: (0.08, -0.05, 0.17)}
"""Places of the wrists in guard: outward, up and forward of the middle of the shoulders, metres; the left leads."""
ELBOW = (0.45, -1.0, -0.1)
FIRST_S, LAST_S = 0.5, 0.35
"""Seconds in guard before the first strike and after the last one, at least."""
PAUSE_S, BETWEEN_S = (0.7, 1.2), (0.02, 0.12)
"""Seconds between rows of strikes, and between the strikes of a row, where no number is asked for."""
ROW = (2, 3)
"""Strikes of a row."""
SMOOTH_S = 0.025
"""Standard deviation of the filter of the ways of fists, seconds."""


@dataclass(frozen=True)
class _Strike:
    """A way of a fist from the guard and back.

    Attributes:
        times: seconds.
        way: places of the wrist at these times, as `GUARD`, between the first and the last, which are the guard's.
        twist: degrees of the trunk at these times, to the other side.
        elbow: where it points meanwhile.
    """

    times: tuple[float, ...]
    way: tuple[Point, ...]
    twist: tuple[float, ...]
    elbow: Point = ELBOW

    @property
    def seconds(self) -> float:
        """Seconds from guard to guard."""
        return self.times[-1]


_STRAIGHT = _Strike((0.0, 0.12, 0.19, 0.44), ((-0.02, 0.0, 0.56), (-0.02, 0.0, 0.56)), (0.0, 24.0, 24.0, 0.0))
_HOOK = _Strike(
    (0.0, 0.2, 0.36, 0.44, 0.72),
    ((0.32, -0.04, 0.18), (-0.06, 0.05, 0.47), (-0.18, 0.04, 0.36)),
    (0.0, -14.0, 30.0, 36.0, 0.0),
    (1.0, 0.1, 0.0),
)
_UPPERCUT = _Strike(
    (0.0, 0.24, 0.4, 0.5, 0.8),
    ((0.18, -0.26, 0.12), (-0.05, 0.10, 0.50), (-0.06, 0.14, 0.48)),
    (0.0, -14.0, 26.0, 28.0, 0.0),
    (0.3, -1.0, -0.2),
)
_KINDS: Mapping[str, tuple[_Strike, str]] = {
    "hook": (_HOOK, ""),
    "haymaker": (_HOOK, ""),
    "uppercut": (_UPPERCUT, RIGHT),
    "jab": (_STRAIGHT, LEFT),
    "cross": (_STRAIGHT, RIGHT),
}
"""Way of each kind of punch, and the hand that does it if none is named; empty = the one that did not strike last."""
_KIND = re.compile(rf"\b(?:(left|right)(?:[ -]hand(?:ed)?)? )?({'|'.join(_KINDS)})(?!-)")
_ONE = re.compile(
    r"\b(?:a|an|one|single)\b(?: [\w-]+){0,3} (?:punch|jab|hook|uppercut|cross|blow)\b(?! (?:combo|combination))"
)
"""Words of a single punch."""


def punched(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
    """Return joints (T, 22, 3) of a body in guard that punches, `count` times or in rows of a few; None if there is no
    time for a punch."""
    seconds = len(joints) / fps
    strikes = list(_timed(seconds, wish, rng))
    if not strikes:
        return None
    body, time = StandingBody(joints), np.arange(len(joints)) / fps
    twist = np.zeros(len(joints))
    ways = {side: np.tile(GUARD[side], (len(joints), 1)) for side in ARMS}
    elbows = {side: np.tile(ELBOW, (len(joints), 1)) for side in ARMS}
    for start, strike, side in strikes:
        inside = (time >= start) & (time < start + strike.seconds)
        points = [GUARD[side], *strike.way, GUARD[side]]
        since = time[inside] - start
        ways[side][inside] = way_through(since, strike.times, points)
        twist[inside] -= SIGN[side] * way_through(since, strike.times, strike.twist)
        lifted = eased(np.minimum(since, strike.seconds - since) / 0.12)[:, None]
        elbows[side][inside] = (1 - lifted) * np.array(ELBOW) + lifted * np.array(strike.elbow)
    body.lean(smooth(twist, SMOOTH_S, fps), "up")
    for side in ARMS:
        body.hold(side, np.ones(len(joints)), smooth(ways[side], SMOOTH_S, fps), pole=smooth(elbows[side], 0.05, fps))
    return body.solved()


def _timed(seconds: float, wish: FineWish, rng: np.random.Generator) -> Iterator[tuple[float, _Strike, str]]:
    """Yield start, way and hand of each strike, as many as there is time for."""
    kinds, left = _kinds(wish, rng), wish.count
    if left is None and (named := len(_KIND.findall(wish.prompt.lower()))) > 1:
        left = named
    elif left is None and _ONE.search(wish.prompt.lower()):
        left = 1
    at, number, row = FIRST_S + float(rng.uniform(0.0, 0.4)), 0, int(rng.integers(*ROW, endpoint=True))
    if left is not None:
        taken = sum(kinds[k % len(kinds)][0].seconds + BETWEEN_S[1] for k in range(left))
        at = max(0.15, min(at, (seconds - taken) / 2))
    while (left is None or number < left) and at + kinds[number % len(kinds)][0].seconds + LAST_S <= seconds:
        strike, side = kinds[number % len(kinds)]
        yield at, strike, side
        number, row, at = number + 1, row - 1, at + strike.seconds + float(rng.uniform(*BETWEEN_S))
        if not row and left is None:
            at, row = at + float(rng.uniform(*PAUSE_S)), int(rng.integers(*ROW, endpoint=True))


def _kinds(wish: FineWish, rng: np.random.Generator) -> list[tuple[_Strike, str]]:
    """Return ways and hands in the order of the prompt; a jab and a cross where it names no kind."""
    found: list[tuple[_Strike, str]] = []
    last = str(rng.choice([LEFT, RIGHT]))
    named = _KIND.findall(wish.prompt.lower())
    side = "" if any(own for own, _ in named) else wish.side  # of "jab, cross, left hook" only the hook is left
    for own, kind in named:
        strike, usual = _KINDS[kind]
        last = own or side or usual or OTHER_SIDE[last]
        found.append((strike, last))
    return found or [(_STRAIGHT, side) for side in ([wish.side] if wish.side else [LEFT, RIGHT])]
