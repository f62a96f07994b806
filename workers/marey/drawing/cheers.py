"""Bodies that cheer: arms thrown up, pumped fists and jumps of joy."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.hops import jumps
from marey.drawing.parts import arms_of
from marey.posing.limbs import FPS
from marey.posing.standing import StandingBody, envelope, stations

Array = NDArray[np.floating]

_PUMPS = {
    "cheer-both": {"low": ((0.14, 0.24), (0.06, 0.22), (0.1, 0.2)), "high": ((0.1, 0.26), (0.4, 0.47), (0.04, 0.14))},
    "cheer-wide": {"low": ((0.26, 0.36), (0.12, 0.26), (0.06, 0.14)), "high": ((0.3, 0.4), (0.36, 0.44), (0.0, 0.1))},
    "cheer-one": {
        "low": ((0.12, 0.22), (-0.04, 0.12), (0.12, 0.22)),
        "high": ((0.14, 0.26), (0.4, 0.48), (0.04, 0.16)),
    },
    "cheer-yes": {
        "low": ((0.12, 0.2), (-0.36, -0.26), (0.14, 0.22)),
        "high": ((0.08, 0.16), (0.02, 0.18), (0.26, 0.36)),
    },
    "cheer-jump": {"low": ((0.2, 0.3), (0.1, 0.24), (0.08, 0.18)), "high": ((0.16, 0.3), (0.38, 0.46), (0.02, 0.12))},
}
"""Where a fist is down and up while it is pumped: outward, up and forward of the middle of the shoulders, metres."""


def cheer(rng: random.Random, *, times: int | None = None) -> Gesture:
    form = rng.choices(list(_PUMPS), (5, 3, 4, 4, 4))[0]
    low, high = (np.array([rng.uniform(*limits) for limits in _PUMPS[form][name]]) for name in ("low", "high"))
    side = rng.choice(SIDES) if form in ("cheer-one", "cheer-yes") else BOTH
    if form == "cheer-yes" and rng.random() < 0.4:
        side = BOTH
    times = times or rng.choices((1, 2, 3, 4, 6), (3, 3, 3, 2, 1))[0]
    start, wind, up, down = (
        rng.uniform(0.1, 0.8),
        rng.uniform(0.3, 0.5),
        rng.uniform(0.16, 0.24),
        rng.uniform(0.16, 0.26),
    )
    hold, pause = rng.uniform(0.3, 2.2) if times < 3 else rng.uniform(0.2, 0.7), rng.uniform(0.02, 0.12)
    fall, back, dip = rng.uniform(0.5, 0.9), rng.uniform(1, 9), rng.uniform(0.02, 0.07)
    crouch = rng.uniform(2, 9) if form != "cheer-yes" else rng.uniform(8, 18)
    pulls = form == "cheer-yes"  # the fists are up first and are pulled down
    jumped = jumps(rng, (), start + 0.1, rng.uniform(0.3, 0.4), times) if form == "cheer-jump" else None
    first = start + wind
    if pulls:
        times_at, points = _pumps(first, times, (high, low), (down, pause, up))
    else:
        times_at, points = _pumps(first, times, (low, high), (up, pause, down))
    end = times_at[-1] + hold
    if jumped is not None:
        end = max(end, jumped.seconds - fall - 0.2)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        if jumped is not None:
            jumped.change(body)
        way = envelope(frames, start, wind, end - start - wind, fall)
        path = stations(frames, times_at, np.stack(points))
        raised = np.clip((path[:, 1] - low[1]) / (high[1] - low[1]), 0.0, 1.0)
        if jumped is None:
            body.shift(-dip * way * (1 - raised))
        body.lean(way * (crouch * (1 - raised) - back * raised), "left")
        body.lean(-0.8 * back * way * raised, "left", (12,))
        shake = 0.012 * np.sin(2 * np.pi * 2.3 * np.arange(frames) / FPS)[:, None] * np.array([0.6, 1.0, 0.0])
        for one in arms_of(side):
            body.hold(one, way, path + shake, lag=0.0, pole=(1.0, -0.5, 0.0))

    kinds = ["cheer" if not pulls else "", form if side != BOTH or form != "cheer-yes" else "cheer-yes-both"]
    kinds += ["cheer-many" if times > 2 else ""]
    untrue = "arms|hands|pose|air" if pulls else "pump|dance|crowd"
    untrue += "|arms|hands" if side != BOTH else ""
    seconds = end + fall + rng.uniform(0.2, 0.8)
    return Gesture(seconds, tuple(filter(None, kinds)), change, side, times, untrue=untrue)


def joy_jump(rng: random.Random, times: int) -> Gesture:
    """Jumps with both fists thrown up, as often as `times`."""
    gesture = cheer(rng, times=times)
    while "cheer-jump" not in gesture.kinds:
        gesture = cheer(rng, times=times)
    return gesture


def _pumps(
    first: float, times: int, ends: tuple[Array, Array], seconds: tuple[float, float, float]
) -> tuple[list[float], list[Array]]:
    """Times and places (3,) of a fist that is pumped `times` times from the first of `ends` to the second, where it
    stays.

    Args:
        seconds: of a pump, of the pause after it, and of the way back.
    """
    (home, there), (out, pause, back) = ends, seconds
    at, points = [first], [home]
    for k in range(times):
        for length, point in ((out, there), (pause, there), (back, home)):
            if point is there or k < times - 1:
                at.append(at[-1] + length)
                points.append(point)
    return at, points
