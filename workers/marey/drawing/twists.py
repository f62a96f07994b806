"""Trunks that turn from side to side over feet that stay, and standing crunches."""

from __future__ import annotations

import random

import numpy as np

from marey.drawing.gesture import BOTH, SIDES, Gesture
from marey.drawing.stances import settle, turn_hips
from marey.posing.limbs import FPS
from marey.posing.standing import StandingBody, direction, eased, envelope

_ARMS = {
    "twist-out": {"azimuth": (78, 96), "up": (-8, 8), "fore": (78, 96), "fore_up": (-6, 8)},
    "twist-bent": {"azimuth": (60, 88), "up": (-22, -4), "fore": (-80, -50), "fore_up": (-4, 14)},
    "twist-guard": {"azimuth": (24, 50), "up": (-62, -44), "fore": (-40, -15), "fore_up": (30, 58)},
    "twist-head": {"azimuth": (96, 112), "up": (22, 40), "fore": (-150, -120), "fore_up": (16, 32)},
    "twist-hips": {"azimuth": (98, 118), "up": (-54, -42), "fore": (-40, -18), "fore_up": (-48, -34)},
    "twist-loose": {"azimuth": (30, 60), "up": (-66, -50), "fore": (0, 25), "fore_up": (-48, -22)},
}
"""Directions of upper arm and forearm, degrees; see `direction`."""


def twist(rng: random.Random) -> Gesture:
    form = rng.choices(list(_ARMS), (4, 4, 3, 2, 3, 3))[0]
    tempo = rng.choice(["slow", "", "", "quick"])
    seconds = rng.uniform(*{"slow": (2.2, 3.0), "": (1.3, 2.0), "quick": (0.8, 1.15)}[tempo])
    times = rng.randint(2, max(2, min(7, int(6.6 / seconds))))
    degrees = rng.uniform(24, 58)
    follow = rng.uniform(0.05, 0.4)  # share of the turn by which the hips follow
    start, rise = rng.uniform(0.1, 0.7), rng.uniform(0.45, 0.8)
    first = rng.choice((-1.0, 1.0))
    limits = _ARMS[form]
    upper, fore = (
        direction(rng.uniform(*limits[azimuth]), rng.uniform(*limits[up]))
        for azimuth, up in (("azimuth", "up"), ("fore", "fore_up"))
    )
    look, bend, lasts = rng.uniform(-0.2, 0.8), rng.uniform(0.01, 0.05), times * seconds
    hips = follow * degrees if form != "twist-hips" else 0.1 * degrees

    def change(body: StandingBody) -> None:
        frames = len(body.joints)
        t = np.arange(frames) / FPS
        way = envelope(frames, start, rise, lasts + 0.2, rise)
        x = np.clip((t - start - 0.7 * rise) / lasts, 0.0, 1.0)
        ends = eased(x * times / 0.4) * eased((1 - x) * times / 0.4)
        swing = first * np.sin(2 * np.pi * times * x) * (0.35 + 0.65 * ends)
        for side in SIDES:
            body.move_arm(side, way, upper, fore, 0.03)
        body.lean((degrees + 0.1 * hips) * swing, "up")
        body.lean(-(1 - look) * 0.5 * degrees * swing, "up", (12,))
        turn_hips(body, hips * swing)
        body.shift(-bend * way)
        settle(body)

    kinds = ("twist", form, *([f"twist-{tempo}"] if tempo else []), *(["twist-many"] if times > 3 else []))
    return Gesture(start + 1.7 * rise + lasts + rng.uniform(0.4, 0.9), kinds, change, BOTH, untrue="hips")
