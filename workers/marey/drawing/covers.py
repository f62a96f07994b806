"""Blocks with both arms, out of a guard and back into it."""

from __future__ import annotations

import random
from collections.abc import Mapping

import numpy as np

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.guards import drawn_stance, near
from marey.drawing.stances import settle
from marey.posing.standing import LEFT, RIGHT, StandingBody, envelope

_GUARD = {LEFT: (0.1, 0.0, 0.3), RIGHT: (0.1, 0.0, 0.23)}
_LOWER, _HIGHEST = 0.28, -0.1
"""Metres by which the hands of the guard are lower than in the block, and over the shoulders at most."""
_GUARD_POLE = (0.5, -1.0, -0.2)
_FORMS: Mapping[str, tuple[dict[str, tuple[float, float, float]], tuple[float, float, float]]] = {
    "face": ({LEFT: (0.05, 0.17, 0.25), RIGHT: (0.05, 0.17, 0.23)}, (0.3, -1.0, 0.25)),
    "high": ({LEFT: (0.0, 0.33, 0.22), RIGHT: (0.0, 0.3, 0.2)}, (0.9, -0.3, 0.4)),
    "cross": ({LEFT: (-0.06, 0.14, 0.36), RIGHT: (-0.07, 0.08, 0.29)}, (0.7, -0.9, 0.1)),
    "high-cross": ({LEFT: (-0.06, 0.33, 0.3), RIGHT: (-0.07, 0.29, 0.24)}, (0.9, -0.4, 0.3)),
    "middle": ({LEFT: (0.03, -0.06, 0.3), RIGHT: (0.03, -0.1, 0.26)}, (0.4, -1.0, 0.1)),
}
"""Where the hands go from the middle of the shoulders, and where the elbows point."""


def cover(rng: random.Random, form: str = "face", times: int = 1, *, stands_first: bool = False) -> Gesture:
    """A body in guard that blocks with both forearms.

    Args:
        rng: decides sizes and times.
        form: where: before the face, high over the head, crossed, crossed and high, or before the middle.
        times: how often.
        stands_first: it steps into the guard, and out of it again.
    """
    start = 0.1 if stands_first else -2.0
    at, phases = (1.0 if stands_first else rng.uniform(0.5, 0.8)), list[tuple[float, float, float, float]]()
    for _ in range(times):
        rise, hold, fall = rng.uniform(0.16, 0.22), rng.uniform(0.4, 0.6) if times > 1 else rng.uniform(0.7, 1.0), 0.35
        phases.append((at, rise, hold, fall))
        at += rise + hold + fall + rng.uniform(0.2, 0.4)
    end = at + 0.3 if stands_first else None
    stance = drawn_stance(rng, LEFT, start, end)
    goes, pole = _FORMS[form]
    places = {side: np.array(near(rng, place, 0.01)) for side, place in goes.items()}
    guards = {
        side: np.array([out, min(places[side][1] - _LOWER, _HIGHEST), ahead])
        for side, (out, _, ahead) in _GUARD.items()
    }
    sink, bent = rng.uniform(0.02, 0.04), rng.uniform(3, 8)

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        way = envelope(frames, start, 0.55, 60.0 if end is None else end - start - 0.55, 0.7)
        up = np.sum([envelope(frames, *phase) for phase in phases], axis=0)
        stance(body, way)
        body.shift(-sink * up, -0.02 * up)
        body.lean(bent * up, "left")
        settle(body)
        for side in SIDES:
            share = up[:, None]
            path = (1 - share) * guards[side] + share * places[side]
            body.hold(side, way, path, pole=(1 - share) * np.array(_GUARD_POLE) + share * np.array(pole))

    seconds = at + 0.4 if end is None else end + 1.1
    return Gesture(seconds, ("block", f"block-{form}", "guard"), change, BOTH, times)
