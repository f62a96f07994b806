"""Skids: a body that slides to a stop out of a run, leaning back over both feet, and comes upright."""

from __future__ import annotations

import random
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES
from marey.drawing.passing import pose
from marey.drawing.postures import FootPlace, HandPlace, Posture
from marey.drawing.sequels import Sequel
from marey.posing.limbs import FPS
from marey.posing.standing import OTHER_SIDE, StandingBody
from marey.posing.still import standing_still

Array = NDArray[np.floating]

LEAD_S = 0.35
"""Seconds at full speed before it slows down, in which a run passes into it."""
SLIDES_S, SHORT_S = 0.85, 0.5
"""Seconds in which a body slides to a stop, and in which it stops abruptly."""
_RISES_S, _STANDS_S = 0.45, 0.5
_OUT, _FLAT, _LIFTED = 0.13, 0.07, 0.13
_AHEAD, _BEHIND = 0.32, 0.04
"""Metres of the foot that leads before the body, and of the other one."""


def skid(rng: random.Random, speed: float, *, short: bool = False) -> Array:
    """Return joints (T, 22, 3) of a body that faces +Z, slides ahead to a stop and stands.

    Args:
        rng: decides sizes, and the foot that leads.
        speed: at which it begins, metres a second.
        short: it stops abruptly, and hardly slides.
    """
    leads, lasts = rng.choice(SIDES), SHORT_S if short else SLIDES_S
    deep = (0.6 if short else 1.0) * rng.uniform(0.9, 1.1)
    ahead, behind = (FootPlace((_OUT, _FLAT, at), drags=True) for at in (_AHEAD, _BEHIND))
    arms = {
        leads: HandPlace((0.36, -0.24, 0.12), "shoulder", (0.2, -0.7, -0.6)),
        OTHER_SIDE[leads]: HandPlace((0.3, -0.2, 0.28), "shoulder", (0.6, -0.7, -0.2)),
    }
    slides = Posture(
        (0.0, 0.92 - 0.12 * deep, -0.1 * deep),
        (-7 * deep, 0, 0),
        (-9 * deep, 0, 0),
        (12 * deep, 0, 0),
        hands=arms,
        feet={leads: ahead, OTHER_SIDE[leads]: behind},
    )
    low = replace(slides, pelvis=(0.0, 0.89 - 0.15 * deep, 0.02), tilt=(-2, 0, 0), spine=(4, 0, 0), neck=(4, 0, 0))
    done = Sequel([0.0], [slides])
    done.then(LEAD_S + 0.5 * lasts, slides)
    done.then(0.5 * lasts, low, 0.1)
    stands = {leads: ahead, OTHER_SIDE[leads]: FootPlace((_OUT, _LIFTED, 0.5 * (_AHEAD + _BEHIND)))}
    done.then(0.5 * _RISES_S, Posture((0.0, 0.9, 0.18), (1, 0, 0), (2, 0, 0), feet=stands))
    done.then(0.5 * _RISES_S, Posture((0.0, 0.93, _AHEAD), feet=dict.fromkeys(SIDES, replace(ahead, drags=False))))
    frames = round((done.times[-1] + _STANDS_S) * FPS) + 1
    body = StandingBody(standing_still(frames, rng))
    pose(body, done.times, done.postures)
    joints = body.solved()
    left = 1.0 - np.clip((np.arange(frames) / FPS - LEAD_S) / lasts, 0.0, 1.0)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (left[1:] ** 2 + left[:-1] ** 2))]) * speed / FPS
    joints[..., 2] += way[:, None]
    return joints
