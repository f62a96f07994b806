"""Dodges, drawn on a body that stands: networks know the crouch of a duck, and little else.

The body stands as it does in the calmest second of the motion that the network made, and goes down, aside or back at
once.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from marey.generation.calm import calm
from marey.generation.fine_wish import FineWish
from marey.posing.standing import ARMS, LEFT, OTHER_SIDE, RIGHT, SIGN, StandingBody, eased

Array = NDArray[np.floating]

OUT_S, HOLD_S, BACK_S = 0.26, (0.2, 0.45), 0.55
"""Seconds in which a body gets out of the way, stays there, and comes back."""
FIRST_S, PAUSE_S = (0.5, 0.9), (0.7, 1.3)
"""Seconds before the first dodge, and between two."""
EARLIEST_S, LEAST_S = 0.1, 0.5
"""Seconds before the first of several dodges, and between the starts of two, at least."""
_DUCKS = re.compile(r"\b(?:ducks?|ducking|ducked|crouch\w*|under|below)\b")
_BACK = re.compile(r"\b(?:back|backwards?|away from)\b")
_SPRINGS = re.compile(r"\b(?:hop|jump|leap|spr[iau]ng|dash|div|roll|step|skip|run|rush|scurr)")
"""Words of dodges in which the feet leave their place."""
ASIDE, BACK, DOWN = (0.13, 30.0), (0.10, 26.0), (0.34, 26.0)
"""Metres that the hips go, and degrees that the trunk leans: to a side, back, and down."""
LOWEST = 0.56
"""Metres over the floor to which the hips go down at most."""
READY, COVERS = (0.14, -0.22, 0.24), (0.11, -0.10, 0.26)
"""Places of the hands before and after, and meanwhile: outward, up, forward of the middle of the shoulders, metres."""


def dodges_well(joints: Array, fps: float, wish: FineWish) -> bool:
    """Return True if the feet are to leave their place, which is not drawn."""
    del joints, fps
    return not stays(wish)


def stays(wish: FineWish) -> bool:
    """Return True if the feet stay where they are."""
    return not _SPRINGS.search(wish.prompt.lower())


def dodged(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
    """Return joints (T, 22, 3) of a body that stands and dodges; None if there is no time for it."""
    body = StandingBody(calm(joints, fps, rng))
    text = wish.prompt.lower()
    side = wish.side or str(rng.choice([LEFT, RIGHT]))
    ways = list(_ways(len(joints) / fps, wish.count, rng))
    if not ways:
        return None
    way, lean = np.zeros(len(joints)), np.zeros(len(joints))
    time = np.arange(len(joints)) / fps
    for number, (start, hold) in enumerate(ways):
        out = eased((time - start) / OUT_S) * (1 - eased((time - start - OUT_S - hold) / BACK_S))
        way += out
        lean += out * SIGN[side if wish.side or number % 2 == 0 else OTHER_SIDE[side]]
    if _DUCKS.search(text):
        far, degrees = DOWN
        room = float(np.median(body.joints[:, 0, 1] - body.joints[:, [10, 11], 1].min(1))) - LOWEST
        body.shift(-float(np.clip(room, 0.05, far)) * way)
        body.bow(degrees * way, arms_hang=0.3, head=-0.5)
    elif not wish.side and _BACK.search(text):
        far, degrees = BACK
        body.shift(-0.05 * way, forward=-far * way)
        body.lean(-degrees * way, "left")
    else:
        far, degrees = ASIDE
        body.shift(-0.06 * way, left=far * lean)
        body.lean(-degrees * lean, "forward")
    hands = np.array(READY) + way[:, None] * (np.array(COVERS) - np.array(READY))
    for arm in ARMS:
        body.hold(arm, np.ones(len(joints)), hands)
    return body.solved()


def _ways(seconds: float, count: int | None, rng: np.random.Generator) -> Iterator[tuple[float, float]]:
    """Yield the start of each dodge, and for how long it is held; a stated number has less time between two if there is
    no more."""
    at, found = float(rng.uniform(*FIRST_S)), list[tuple[float, float]]()
    while count is None or len(found) < count:
        hold = float(rng.uniform(*HOLD_S))
        ends = at + OUT_S + hold + BACK_S
        if ends > seconds + 0.1:
            yield from _hurried(seconds, count) if count is not None and count > 1 else found
            return
        found.append((at, hold))
        at = ends + float(rng.uniform(*PAUSE_S))
    yield from found


def _hurried(seconds: float, count: int) -> Iterator[tuple[float, float]]:
    """Yield as many dodges as there is time for, up to `count`, one out of the other."""
    last = seconds - OUT_S - HOLD_S[0] - BACK_S
    fits = min(count, int((last - EARLIEST_S) / LEAST_S) + 1) if last >= EARLIEST_S else 0
    for number in range(fits):
        yield EARLIEST_S + number * (last - EARLIEST_S) / max(fits - 1, 1), HOLD_S[0]
