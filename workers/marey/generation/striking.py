"""Punches, drawn on the body that a network made.

The network gives the footwork, the stance and the turns of a fight, but its fists seldom go out: a punch lasts three of
its tokens. The guard and the ways of the fists are drawn with a turn of the trunk; the legs stay. Punches of which the
number or the order is stated are drawn on a body that stands in guard, whose feet stay where they are, unless the
prompt has them move; it ends soon after the last one.
"""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import smooth
from marey.drawing.guards import drawn_stance
from marey.drawing.stances import settle, turn_hips
from marey.generation.fine_wish import FineWish
from marey.motion.rotations import from_rotvec, rotate
from marey.posing.standing import ARMS, LEFT, LEGS, OTHER_SIDE, RIGHT, SIGN, StandingBody, eased, way_through
from marey.posing.still import standing_still
from marey.vocabulary.blows import stated_blows

Array = NDArray[np.floating]
Point = tuple[float, float, float]

GUARD: Mapping[str, Point] = {LEFT: (0.06, -0.02, 0.22), RIGHT: (0.08, -0.05, 0.17)}
"""Places of the wrists in guard: outward, up and forward of the middle of the shoulders, metres; the left leads."""
LEAD_M = 0.06
"""Metres by which the fist of the leading hand goes further: its shoulder is ahead of the other in the stance."""
ELBOW = (0.45, -1.0, -0.1)
FIRST_S, LAST_S = 0.5, 0.35
"""Seconds in guard before the first strike and after the last one, at least."""
SOON_S = 0.15, 0.3
"""Seconds before the first strike behind another movement."""
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
        hips: share of the twist that the hips have, on feet that pivot with them.
        sink: metres by which the hips go down at these times; empty = as far as the trunk turns.
    """

    times: tuple[float, ...]
    way: tuple[Point, ...]
    twist: tuple[float, ...]
    elbow: Point = ELBOW
    hips: float = 0.0
    sink: tuple[float, ...] = ()

    def weighted(self, weight: str) -> _Strike:
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
_STRAIGHT = _Strike((0.0, 0.12, 0.19, 0.44), ((-0.02, 0.0, 0.66), (-0.02, 0.0, 0.66)), (0.0, 24.0, 24.0, 0.0))
_HOOK = _Strike(
    (0.0, 0.22, 0.31, 0.37, 0.45, 0.8),
    ((0.34, -0.04, 0.0), (0.46, 0.14, 0.28), (0.06, 0.18, 0.53), (-0.16, 0.14, 0.38)),
    (0.0, -30.0, 4.0, 52.0, 62.0, 0.0),
    (1.0, 0.35, -0.2),
    0.45,
    (0.0, 0.05, 0.03, 0.01, 0.0, 0.0),
)
_UPPERCUT = _Strike(
    (0.0, 0.26, 0.38, 0.47, 0.56, 0.92),
    ((0.16, -0.30, 0.06), (0.07, -0.17, 0.2), (-0.02, 0.06, 0.44), (-0.05, 0.23, 0.4)),
    (0.0, -20.0, -6.0, 26.0, 30.0, 0.0),
    (0.3, -1.0, -0.2),
    0.5,
    (0.0, 0.10, 0.07, -0.015, -0.02, 0.0),
)
_KINDS: Mapping[str, tuple[_Strike, str]] = {
    "hook": (_HOOK, ""),
    "haymaker": (_HOOK, ""),
    "uppercut": (_UPPERCUT, RIGHT),
    "jab": (_STRAIGHT, LEFT),
    "cross": (_STRAIGHT, RIGHT),
    "": (_STRAIGHT, ""),
}
"""Way of each kind of punch, and the hand that does it if none is named; empty = the one that did not strike last."""
_FOOTWORK = re.compile(
    r"\b(?:step|walk|advanc|retreat|circl|footwork|bounc|hop|jump|lung|run|dash|mov|charg|danc|spin|turn|shuffl|kick"
    r"|shadow|spar(?:s|ring)\b|boxes\b)"
)
"""Words of feet that move."""
STRIDE_M = 0.04
"""Metres by which the hips go ahead in a blow."""
PIVOTS, LIFTS_M = 1.3, 0.04
"""Degrees by which a foot pivots for each of the hips, and metres by which its heel rises."""
AFTER_S = (0.6, 0.9)
"""Seconds in guard after the last one of a stated number."""
_ONE = re.compile(
    r"\b(?:a|an|one|single)\b(?: [\w-]+){0,3} (?:punch|jab|hook|uppercut|cross|blow)\b(?! (?:combo|combination))"
    r"|^(?:(?:left|right|lead|rear)[ -](?:hand )?)?(?:jab|hook|uppercut|cross|haymaker|punch)\b"
)
_NAMED_ONCE = re.compile(r"\b(?:hook|uppercut|jab|cross|haymaker)\b")
_GOES_ON = re.compile(r"\b(?:practi[sc]|train|work|drill|repeat|again|combo|series|flurry|bag)\w*")
"""Words of a single punch, and of blows that go on and on."""


def punched(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
    """Return joints (T, 22, 3) of a body in guard that punches, `count` times or in rows of a few; None if there is no
    time for a punch."""
    kinds, count = _row(wish, rng)
    on_spot = stands(wish)
    own_end = on_spot and count is not None and not wish.fixed
    seconds = None if own_end else len(joints) / fps
    strikes = list(_timed(seconds, kinds, count, rng, at_once=bool(wish.beside[0])))
    if not strikes:
        return None
    if on_spot:
        ends = strikes[-1][0] + strikes[-1][1].seconds + float(rng.uniform(*AFTER_S))
        frames = round(ends * fps) if own_end else len(joints)
        body = _in_stance(frames, random.Random(int(rng.integers(2**62))))  # noqa: S311
    else:
        body = StandingBody(joints)
    return _struck(body, fps, strikes, drives=on_spot)


def stands(wish: FineWish) -> bool:
    """Return True if the punches are those of a body that stays in guard, which is drawn as a whole."""
    return not _FOOTWORK.search(wish.prompt.lower())


def _struck(body: StandingBody, fps: float, strikes: list[tuple[float, _Strike, str]], *, drives: bool) -> Array:
    """Draw the guard and the strikes; the hips go ahead with these if it `drives` them."""
    frames = len(body.joints)
    time, twist, hips = np.arange(frames) / fps, np.zeros(frames), np.zeros(frames)
    sinks = np.zeros(frames)
    pivots = {side: np.zeros(frames) for side in ARMS}
    ways = {side: np.tile(GUARD[side], (frames, 1)) for side in ARMS}
    elbows = {side: np.tile(ELBOW, (frames, 1)) for side in ARMS}
    for start, strike, side in strikes:
        inside = (time >= start) & (time < start + strike.seconds)
        points = [GUARD[side], *strike.on(side), GUARD[side]]
        since = time[inside] - start
        ways[side][inside] = way_through(since, strike.times, points)
        turned = way_through(since, strike.times, strike.twist)
        twist[inside] -= SIGN[side] * turned
        hips[inside] -= SIGN[side] * strike.hips * turned
        pivots[side][inside] += strike.hips * np.maximum(turned, 0.0)
        if strike.sink:
            sinks[inside] += way_through(since, strike.times, strike.sink)
        lifted = eased(np.minimum(since, strike.seconds - since) / 0.12)[:, None]
        elbows[side][inside] = (1 - lifted) * np.array(ELBOW) + lifted * np.array(strike.elbow)
    twist = smooth(twist, SMOOTH_S, fps)
    if drives:
        ahead = smooth(np.abs(twist) / 36.0, 0.05, fps)
        body.shift(-0.3 * STRIDE_M * ahead - smooth(sinks, SMOOTH_S, fps), STRIDE_M * ahead)
        hips = smooth(hips, SMOOTH_S, fps)
        turn_hips(body, hips)
        for side in ARMS:
            _pivot(body, side, smooth(pivots[side], SMOOTH_S, fps))
        settle(body)
    body.lean(twist - hips if drives else twist, "up")
    for side in ARMS:
        body.hold(side, np.ones(frames), smooth(ways[side], SMOOTH_S, fps), pole=smooth(elbows[side], 0.05, fps))
    return body.solved()


def _pivot(body: StandingBody, side: str, degrees: Array) -> None:
    """Turn the foot of the hand that strikes inward about its toes, (T,) degrees, its heel lifted a little."""
    _, _, ankle, toe = LEGS[side]
    about = np.array([0.0, 1.0, 0.0]) * np.radians(-SIGN[side] * PIVOTS * degrees)[:, None]
    heel = rotate(from_rotvec(about), body.joints[:, ankle] - body.joints[:, toe])
    heel[:, 1] += LIFTS_M * np.clip(degrees / 25.0, 0.0, 1.0)
    body.joints[:, ankle] = body.joints[:, toe] + heel


def _in_stance(frames: int, rng: random.Random) -> StandingBody:
    """Return a body that stands with its left foot ahead and bent knees."""
    body = StandingBody(standing_still(frames, rng))
    drawn_stance(rng, LEFT, -2.0, None)(body, np.ones(frames))
    return body


def _timed(
    seconds: float | None,
    kinds: list[tuple[_Strike, str]],
    count: int | None,
    rng: np.random.Generator,
    *,
    at_once: bool = False,
) -> Iterator[tuple[float, _Strike, str]]:
    """Yield start, way and hand of each strike, as many as there is time for; without `seconds`, for all of `count`;
    `at_once`: soon, out of another movement."""
    at, number, row = (
        float(rng.uniform(*SOON_S)) if at_once else FIRST_S + float(rng.uniform(0.0, 0.4)),
        0,
        int(rng.integers(*ROW, endpoint=True)),
    )
    if count is not None and seconds is not None:
        taken = sum(kinds[k % len(kinds)][0].seconds + BETWEEN_S[1] for k in range(count))
        at = max(0.15, min(at, (seconds - taken) / 2))
    ends = np.inf if seconds is None else seconds - LAST_S
    while (count is None or number < count) and at + kinds[number % len(kinds)][0].seconds <= ends:
        strike, side = kinds[number % len(kinds)]
        yield at, strike, side
        number, row, at = number + 1, row - 1, at + strike.seconds + float(rng.uniform(*BETWEEN_S))
        if not row and count is None:
            at, row = at + float(rng.uniform(*PAUSE_S)), int(rng.integers(*ROW, endpoint=True))


def _row(wish: FineWish, rng: np.random.Generator) -> tuple[list[tuple[_Strike, str]], int | None]:
    """Return ways and hands in the order of the prompt, a jab and a cross where it names no kind, and the number of
    strikes; None = any number."""
    last, found = str(rng.choice([LEFT, RIGHT])), list[tuple[_Strike, str]]()
    blows = stated_blows(wish.prompt)
    side = "" if any(each.side for each in blows) else wish.side  # of "jab, cross, left hook" only the hook is left
    for each in blows:
        strike, usual = _KINDS[each.kind]
        last = each.side or side or usual or OTHER_SIDE[last]
        found.append((strike.weighted(each.weight), last))
    if len(found) > 1:
        return found, len(found)
    text = wish.prompt.lower()
    once = _ONE.search(text) or (len(found) == 1 and _NAMED_ONCE.search(text) and not _GOES_ON.search(text))
    count = wish.count or (1 if once else None)
    return found or [(_STRAIGHT, each) for each in ([wish.side] if wish.side else [LEFT, RIGHT])], count
