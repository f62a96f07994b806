"""Dodges and kicks of a ball, drawn on a body that stands.

Networks make them seldom: of a duck they know the crouch, and of a ball the run-up. The body stands as it does in the
calmest second of the motion that the network made, and goes down, aside or back at once; or swings a leg through the
place of a ball.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import smooth
from marey.generation.fine_wish import FineWish
from marey.posing.standing import ARMS, LEFT, LEGS, OTHER_SIDE, RIGHT, SIGN, StandingBody, eased

Array = NDArray[np.floating]

CALM_S = 1.0
"""Seconds of the calmest part of a motion."""
BREATHES = 0.03
"""Metres by which a body that stands moves at most."""
OUT_S, HOLD_S, BACK_S = 0.26, (0.2, 0.45), 0.55
"""Seconds in which a body gets out of the way, stays there, and comes back."""
FIRST_S, PAUSE_S = (0.5, 0.9), (0.7, 1.3)
"""Seconds before the first dodge, and between two."""
_DUCKS = re.compile(r"\b(?:ducks?|ducking|ducked|crouch\w*|under|below)\b")
_BACK = re.compile(r"\b(?:back|backwards?|away from)\b")
_LEANS = re.compile(r"\b(?:duck|lean|slip|weav|bob|sway|head|tilt)")
"""Words of dodges in which the feet stay."""
ASIDE, BACK, DOWN = (0.13, 30.0), (0.10, 26.0), (0.24, 24.0)
"""Metres that the hips go, and degrees that the trunk leans: to a side, back, and down."""
LOWEST = 0.56
"""Metres over the floor to which the hips go down at most."""
READY, COVERS = (0.14, -0.22, 0.24), (0.11, -0.10, 0.26)
"""Places of the hands before and after, and meanwhile: outward, up, forward of the middle of the shoulders, metres."""


def dodges_well(joints: Array, fps: float, wish: FineWish) -> bool:
    """Return True if a dodge of the network is as good as one that is drawn: no lean is asked for, nor a duck."""
    del joints, fps
    return not _LEANS.search(wish.prompt.lower())


def dodged(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
    """Return joints (T, 22, 3) of a body that stands and dodges; None if there is no time for it."""
    body = StandingBody(calm(joints, fps))
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
    """Yield the start of each dodge, and for how long it is held."""
    at, number = float(rng.uniform(*FIRST_S)), 0
    while count is None or number < count:
        hold = float(rng.uniform(*HOLD_S))
        ends = at + OUT_S + hold + BACK_S
        if ends > seconds + 0.1:
            return
        yield at, hold
        at, number = ends + float(rng.uniform(*PAUSE_S)), number + 1


def calm(joints: Array, fps: float) -> Array:
    """Return as many frames of a body that stands: the calmest second of a motion, to and fro, in place."""
    long = max(min(round(CALM_S * fps), len(joints) - 1), 2)
    upright = joints[:, 15, 1] - joints[:, [10, 11], 1].min(1)
    moved = np.linalg.norm(np.diff(joints, axis=0), axis=-1).max(1)
    costs = [moved[k : k + long - 1].sum() - 0.5 * upright[k : k + long].min() for k in range(len(joints) - long + 1)]
    first = int(np.argmin(costs))
    part = smooth(joints[first : first + long].reshape(long, -1), 0.1, fps).reshape(long, -1, 3)
    mean = part.mean(0)
    part = mean + min(1.0, BREATHES / max(float(np.abs(part - mean).max()), 1e-6)) * (part - mean)
    to_and_fro = np.concatenate([part, part[-2:0:-1]])
    repeated = to_and_fro[np.arange(len(joints)) % len(to_and_fro)].copy()
    repeated[:, [7, 8, 10, 11]] = mean[[7, 8, 10, 11]]
    return repeated


KICK_S = (0.34, 0.13, 0.13, 0.65)
"""Seconds in which the leg of a ball's kick goes back, comes through the ball, follows through, and steps down."""
KICK_WAY = ((0.0, 0.0, 0.0), (0.02, 0.32, -0.44), (0.0, 0.06, 0.16), (-0.04, 0.40, 0.60), (0.0, 0.0, 0.0))
"""Places of the ankle meanwhile: outward, up and forward of where it stands, metres."""


def kicked_ball(joints: Array, fps: float, wish: FineWish, rng: np.random.Generator) -> Array | None:
    """Return joints (T, 22, 3) of a body that stands and kicks a ball; None if there is no time for it."""
    total, seconds = sum(KICK_S), len(joints) / fps
    if seconds < total + 0.4:
        return None
    side = wish.side or str(rng.choice([LEFT, RIGHT, RIGHT, RIGHT]))
    body, time = StandingBody(calm(joints, fps)), np.arange(len(joints)) / fps
    start = float(rng.uniform(0.2, 0.45)) * (seconds - total)
    times = start + np.concatenate([[0.0], np.cumsum(KICK_S)])
    place = np.stack([np.interp(time, times, each) for each in np.array(KICK_WAY).T], axis=-1)
    place = smooth(place, 0.035, fps)
    winds, strikes, ends = times[1], times[3], times[4]
    trunk = np.interp(time, [start, winds, strikes, ends], [0.0, 12.0, -10.0, 0.0])
    swing = np.interp(time, [start, winds, strikes, ends], [0.0, -1.0, 1.0, 0.0])
    on = _on(time, times)
    body.shift(-0.04 * on, left=-0.06 * SIGN[side] * on)
    body.lean(smooth(trunk, 0.05, fps), "left")
    body.lean(smooth(SIGN[side] * 14.0 * swing, 0.05, fps), "up")
    _, _, ankle, toe = LEGS[side]
    body.joints[:, [ankle, toe]] += body.world(place, side)[:, None]
    other = OTHER_SIDE[side]
    for arm, way in ((other, swing), (side, -swing)):
        body.turn(ARMS[arm][1], "left", smooth(-38.0 * way, 0.06, fps))
        body.lift_arm(arm, 22.0 * on)
    return body.solved()


def _on(time: Array, times: Array) -> Array:
    """Return how much of a kick there is, 0 to 1 (T,)."""
    return eased((time - times[0]) / 0.3) * (1 - eased((time - times[3]) / (times[4] - times[3])))
