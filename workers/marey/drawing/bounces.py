"""Bounces on the toes of a body that waits for something to happen: in guard, as a boxer, or with loose arms."""

from __future__ import annotations

import random

import numpy as np

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.guards import drawn_stance
from marey.posing.limbs import FPS
from marey.posing.standing import LEFT, RIGHT, StandingBody, envelope

_HEELS, _KNEES = (7.0, 21.0), 0.016
"""Degrees by which the heels are up, at least and at most, and metres by which the knees let the hips down and up."""
_HANDS = {
    "guard": {LEFT: (0.06, -0.02, 0.26), RIGHT: (0.08, -0.05, 0.19)},
    "loose": {LEFT: (0.16, -0.32, 0.16), RIGHT: (0.16, -0.32, 0.16)},
}
"""Places of the wrists: outward, up and forward of the middle of the shoulders, metres."""
_ELBOW = (0.45, -1.0, -0.1)


def toe_bounces(rng: random.Random, *, seconds: float, guard: bool = False, sways: bool = False) -> Gesture:
    """A body that bounces on its toes without leaving the floor.

    Args:
        rng: decides sizes and times.
        seconds: of the whole.
        guard: in the stance of a boxer, from the first frame to the last.
        sways: its weight goes from foot to foot.
    """
    hz, lead = rng.uniform(2.05, 2.4), rng.choice((LEFT, LEFT, LEFT, RIGHT))
    stance = drawn_stance(rng, lead, -2.0, None) if guard else None
    aside, aside_hz = (0.055, hz / 2) if sways else (rng.uniform(0.015, 0.025), hz / 4)
    hands = _HANDS["guard" if guard else "loose"]
    begins = -1.0 if guard else 0.2

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        t = np.arange(frames) / FPS
        held = np.ones(frames) if guard else envelope(frames, begins, 0.65, max(seconds - 1.7, 0.3), 0.65)
        way = envelope(frames, 0.05, 0.35, max(seconds - 0.85, 0.3), 0.35) if guard else held
        if stance is not None:
            stance(body, held)
        beat = np.sin(2 * np.pi * hz * t)
        body.shift(_KNEES * way * (beat - 1.0), 0.0, aside * way * np.sin(2 * np.pi * aside_hz * t))
        low, high = _HEELS
        body.rise_on_toes(way * (low + 0.5 * (high - low) * (1.0 + beat)))
        for side in SIDES:
            one = side if lead == LEFT else {LEFT: RIGHT, RIGHT: LEFT}[side]
            sign = 1.0 if side == LEFT else 0.8
            bob = sign * np.outer(0.014 * way * np.sin(2 * np.pi * hz * t - 0.9), (0.0, 1.0, 0.5))
            body.hold(one, held, np.asarray(hands[side]) + bob, lag=0.0, pole=_ELBOW)

    return Gesture(seconds, ("toe-bounce",), change, fills=True)
