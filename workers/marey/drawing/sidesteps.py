"""Steps aside: one foot goes out, the other one follows."""

from __future__ import annotations

import random
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import Gesture
from marey.drawing.stances import settle
from marey.posing.curves import blurred
from marey.posing.limbs import FPS
from marey.posing.standing import ARMS, LEGS, OTHER_SIDE, SIGN, StandingBody, eased, envelope

Array = NDArray[np.floating]


@dataclass(frozen=True)
class _Pace:
    """How steps aside are made at a pace.

    Attributes:
        seconds, metres: limits of those of a step.
        leads, follows: shares of a step in which the one foot and the other are in the air.
        sinks: metres by which the body sinks.
        arms: degrees by which the arms are lifted.
        hops: metres by which the body rises while both feet are in the air.
    """

    seconds: tuple[float, float]
    metres: tuple[float, float]
    leads: tuple[float, float]
    follows: tuple[float, float]
    sinks: float
    arms: float
    hops: float = 0.0


PACES = {
    "slow": _Pace((1.0, 1.25), (0.3, 0.38), (0.0, 0.45), (0.5, 0.95), 0.01, 6.0),
    "": _Pace((0.62, 0.74), (0.44, 0.52), (0.0, 0.52), (0.46, 0.98), 0.02, 8.0),
    "fast": _Pace((0.3, 0.33), (0.6, 0.66), (0.0, 0.6), (0.4, 1.0), 0.06, 20.0),
    "gallop": _Pace((0.46, 0.52), (0.6, 0.68), (0.0, 0.6), (0.22, 0.86), 0.03, 26.0, 0.055),
}
_SINGLE = {"slow": (0.43, 0.48), "": (0.54, 0.64), "fast": (0.54, 0.64), "gallop": (0.6, 0.68)}
"""Metres of a step that is the only one, by pace."""
_LIFT = 0.07
_FARTHEST = 0.7
"""Metres of a step at most."""
_HIPS_S = 0.13
"""Standard deviation of the filter of the ways of the feet whose middle the hips follow, seconds."""


def sidestep(
    rng: random.Random,
    side: str,
    *,
    count: int | None = None,
    pace: str = "",
    seconds: float = 3.0,
    metres: float | None = None,
    ahead: float = 0.0,
) -> Gesture:
    """Steps to a side, one after the other; the body faces ahead.

    Args:
        rng: decides lengths and times.
        side: left or right.
        count: of the steps; None = as many as there is time for.
        pace: slow, fast, gallop: with a hop in each step, or empty: as one walks.
        seconds: that it has to fill, without a `count`.
        metres: that the steps go in all; None = as far as they come.
        ahead: degrees by which they go ahead of the side, less than 0: behind it.
    """
    form = PACES[pace]
    period, lift = rng.uniform(*form.seconds), _LIFT * rng.uniform(0.8, 1.1)
    far = rng.uniform(*(_SINGLE[pace] if count == 1 else form.metres))
    start, rests = rng.uniform(0.25, 0.45), rng.uniform(0.5, 0.8)
    steps = count or max(2, round((seconds - start - rests) / period))
    if metres is not None:
        steps = count or max(round(metres / far), 1)
        far = min(metres / steps, _FARTHEST)

    def change(body: StandingBody) -> None:
        time = np.arange(len(body.joints)) / FPS - start
        way = envelope(len(time), start - 0.2, 0.3, steps * period, 0.5)
        body.lean(6.0 * way, "left")
        for arm in ARMS:
            body.lift_arm(arm, form.arms * way)
        feet = {
            side: _foot(time / period, steps, form.leads, far, lift),
            OTHER_SIDE[side]: _foot(time / period, steps, form.follows, far, lift),
        }
        hips = blurred(np.mean([foot[:, 0] for foot in feet.values()], axis=0), _HIPS_S * FPS)
        out, forward = np.cos(np.radians(ahead)), np.sin(np.radians(ahead))
        body.shift(-form.sinks * way, forward * hips, left=SIGN[side] * out * hips)
        for one, foot in feet.items():
            aside = SIGN[one] * SIGN[side] * out * foot[:, 0]
            moved = body.world(np.stack([aside, foot[:, 1], forward * foot[:, 0]], axis=1), one)
            body.joints[:, LEGS[one][2:]] += moved[:, None]
        settle(body)
        if form.hops:  # settled feet are on the floor
            body.joints[..., 1] += form.hops * _in_air(time / period, steps, form)[:, None]

    return Gesture(start + steps * period + rests, ("sidestep",), change, side, steps)


def _in_air(steps: Array, count: int, form: _Pace) -> Array:
    """Return how high a body is in its hops (T,), 0 to 1, at a time in steps."""
    share = (steps % 1.0 - form.follows[0]) / max(form.leads[1] - form.follows[0], 1e-6)
    rises = 4 * share * (1 - share)
    return np.where((steps >= 0) & (steps < count), np.clip(rises, 0.0, 1.0), 0.0)


def _foot(steps: Array, count: int, swings: tuple[float, float], far: float, lift: float) -> Array:
    """Return how far a foot is aside and over the floor (T, 2), metres.

    Args:
        steps: (T,) time, in steps.
        count: of the steps.
        swings: shares of a step in which the foot is in the air.
        far: metres of a step.
        lift: metres over the floor.
    """
    place = np.zeros((len(steps), 2))
    for number in range(count):
        share = eased((steps - number - swings[0]) / (swings[1] - swings[0]))
        place += np.stack([far * share, 4 * lift * share * (1 - share)], axis=1)
    return place
