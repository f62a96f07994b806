"""Bodies that swim in water that is not there."""

from __future__ import annotations

import random

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.tumbling import BODY, WholeMotion, tumble
from marey.posing.curves import closed
from marey.posing.limbs import FPS
from marey.posing.standing import LEFT, StandingBody

Array = NDArray[np.floating]

_FORMS = {"freestyle": 5, "breaststroke": 4, "backstroke": 2, "under": 2, "tread": 3}
_RATES = {"quick": (0.85, 1.1), "": (0.6, 0.8), "slow": (0.42, 0.55)}
"""Strokes a second."""
# Places of a wrist before the middle of the shoulders: outward, up (towards the head) and forward (of the chest), at
# even parts of a stroke.
_FREESTYLE = (
    (0.1, 0.52, 0.04),
    (0.14, 0.3, 0.36),
    (0.04, -0.1, 0.4),
    (0.14, -0.46, 0.14),
    (0.3, -0.2, -0.16),
    (0.28, 0.25, -0.12),
)
_BACKSTROKE = (
    (0.14, 0.52, -0.04),
    (0.42, 0.2, -0.12),
    (0.38, -0.16, -0.1),
    (0.2, -0.48, 0.02),
    (0.16, -0.2, 0.42),
    (0.14, 0.25, 0.42),
)
_BREASTSTROKE = (
    (0.02, 0.54, 0.06),
    (0.02, 0.54, 0.06),
    (0.34, 0.32, 0.12),
    (0.4, -0.02, 0.2),
    (0.02, -0.1, 0.26),
    (0.0, 0.24, 0.2),
)
_UNDER = (
    (0.02, 0.54, 0.04),
    (0.36, 0.34, 0.08),
    (0.42, 0.0, 0.14),
    (0.22, -0.46, 0.06),
    (0.08, -0.24, 0.2),
    (0.02, 0.2, 0.2),
)
_FROG = (
    (0.1, -0.86, 0.0),
    (0.1, -0.86, 0.0),
    (0.1, -0.86, 0.0),
    (0.1, -0.72, 0.1),
    (0.22, -0.46, 0.16),
    (0.36, -0.66, 0.04),
)
"""Ankles before the pelvis at even parts of a breaststroke."""


def swim(rng: random.Random, form: str = "", *, seconds: float | None = None, moves: bool | None = None) -> Gesture:
    """A body that swims.

    Args:
        rng: decides everything that is not given.
        form: freestyle, breaststroke, backstroke, under (water) or tread (water, upright).
        seconds: for how long.
        moves: it gets ahead.
    """
    form = form or rng.choices(list(_FORMS), list(_FORMS.values()))[0]
    tempo = rng.choice(["quick", "", "", "slow"])
    rate, start = rng.uniform(*_RATES[tempo]), rng.random()
    lasts = rng.uniform(2.5, 8.5) if seconds is None else seconds
    moves = (form != "tread" and rng.random() < 0.6) if moves is None else moves
    speed = rng.uniform(0.5, 0.95) * rate / 0.7 if moves else 0.0
    shape = {
        "height": rng.uniform(0.75, 1.1),
        "pitch": rng.uniform(76, 88),
        "kick": rng.uniform(2.4, 3.2),
        "beat": rng.uniform(0.1, 0.15),
        "roll": rng.uniform(12, 24),
        "lean": rng.uniform(8, 24),
    }

    def change(body: StandingBody) -> None:
        phase = start + rate * np.arange(len(body.joints)) / FPS
        tumble(body, _motion(form, phase, speed, rate, shape))

    kinds = ["swim", f"swim-{form}", "swim-moves" if moves else "", f"swim-{tempo}" if tempo else ""]
    strokes = {
        "freestyle": "breast|back|butterfly|tread|paddle",
        "breaststroke": "crawl|freestyle|back|butterfly|tread|paddle",
        "backstroke": "crawl|freestyle|breast|butterfly|tread|paddle|forward",
        "under": "crawl|freestyle|back|butterfly|tread|paddle",
        "tread": "crawl|freestyle|breast|back|butterfly|forward",
    }
    return Gesture(lasts, tuple(filter(None, kinds)), change, untrue=rf"({strokes[form]})")


def _motion(form: str, phase: Array, speed: float, rate: float, shape: dict[str, float]) -> WholeMotion:
    """The motion of a form over `phase` (T,), strokes, at `speed` metres a second."""
    zero, turn = np.zeros_like(phase), 2 * np.pi * phase
    head = -1.0 if form == "backstroke" else 1.0
    ahead = head * speed * (phase - phase[0]) / rate
    height, pitch = shape["height"] + 0.015 * np.sin(turn), np.full_like(phase, shape["pitch"])
    rolls, spine, neck = zero, zero, zero - 12.0
    tread = form == "tread"
    if form == "freestyle":
        rolls = shape["roll"] * np.sin(turn + 0.6)
    elif form == "backstroke":
        pitch, rolls, neck = -pitch, 0.8 * shape["roll"] * np.sin(turn + 0.6), zero + 6.0
    elif tread:
        height, pitch, neck = shape["height"] + 0.25 + 0.02 * np.sin(2 * turn), zero + shape["lean"], zero - 8.0
    else:
        rise = 0.5 - 0.5 * np.cos(2 * np.pi * (phase - 0.12))
        lifted = 0.0 if form == "under" else 1.0
        pitch, spine, neck = pitch - 6 * lifted * rise, -12 * lifted * rise, -8 - 14 * lifted * rise
    stack = (
        np.stack([zero, height, ahead], -1),
        np.stack([pitch, rolls, zero], -1),
        np.stack([spine, zero, zero], -1),
        np.stack([neck, zero, zero], -1),
    )
    hands = {side: {BODY: _hand(form, side, phase)} for side in SIDES}
    feet = {side: {BODY: _foot(form, side, phase, shape)} for side in SIDES}
    splay = zero + (0.5 if form in ("breaststroke", "tread") else 0.12)
    return WholeMotion(*stack, hands, feet, zero, splay)


def _hand(form: str, side: str, phase: Array) -> tuple[Array, Array, Array]:
    own = phase + (0.5 if side == LEFT and form in ("freestyle", "backstroke") else 0.0)
    towards = (0.9, 0.2, -0.5)
    if form == "tread":
        turn = 2 * np.pi * 1.6 * phase
        place = np.stack([0.36 + 0.14 * np.sin(turn), -0.3 + 0.04 * np.cos(turn), 0.26 + 0.06 * np.cos(2 * turn)], -1)
        towards = (0.7, -0.5, -0.6)
    else:
        points = {"freestyle": _FREESTYLE, "backstroke": _BACKSTROKE, "breaststroke": _BREASTSTROKE, "under": _UNDER}
        place = closed(points[form], own)
    return np.ones((len(phase), 1)), place, np.tile(towards, (len(phase), 1))


def _foot(form: str, side: str, phase: Array, shape: dict[str, float]) -> tuple[Array, Array, Array]:
    half = np.pi if side == LEFT else 0.0
    zero = np.zeros_like(phase)
    toes = np.tile((0.05, -0.9, 0.3), (len(phase), 1))
    if form == "tread":
        turn = 2 * np.pi * 1.3 * phase + half
        place = np.stack([0.22 + 0.1 * np.sin(turn), -0.62 + 0.08 * np.cos(turn), 0.1 + 0.16 * np.sin(turn)], -1)
        toes = np.tile((0.35, -0.7, 0.6), (len(phase), 1))
    elif form == "breaststroke":
        place = closed(_FROG, phase)
        toes = closed(((0.05, -0.9, 0.2),) * 3 + ((0.2, -0.8, 0.4), (0.7, -0.4, 0.5), (0.6, -0.6, 0.4)), phase)
    else:
        turn = 2 * np.pi * shape["kick"] * (phase - phase[0]) + half
        place = np.stack([zero + 0.09, zero - 0.86, 0.03 + shape["beat"] * np.sin(turn)], -1)
    return np.ones((len(phase), 1)), place, toes
