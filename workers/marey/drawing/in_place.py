"""Gaits in place: a body that stands, walks, marches, jogs or runs on the spot, and stands."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES, Gesture
from marey.motion.filters import smooth_seconds
from marey.posing.limbs import BONE_LENGTHS, FPS
from marey.posing.standing import LEGS, OTHER_SIDE, SIGN, StandingBody, eased

Array = NDArray[np.floating]


@dataclass(frozen=True)
class GaitForm:
    """How a gait is done in place.

    Attributes:
        step_s: seconds from one step to the next.
        air: how long a foot is in the air, in steps; more than 1: both are between two steps.
        thigh, shank: degrees of a lifted thigh ahead of the vertical, and of the shank below it behind it.
        toes: degrees by which the toes of a lifted foot hang.
        sinks, bobs: metres by which the hips are lower than those of who stands, and sink further in the middle of a
            step.
        sways: metres by which they go over the foot that stands.
        upper, elbow, swings: degrees of the upper arms ahead of the vertical, of the bent elbows, and of the swing.
        leans, twists: degrees of the trunk, forward and about the vertical.
    """

    step_s: float
    air: float
    thigh: float
    shank: float
    toes: float
    sinks: float
    bobs: float
    sways: float
    upper: float
    elbow: float
    swings: float
    leans: float
    twists: float


FORMS = {
    "walk": GaitForm(0.55, 0.84, 40, 16, 14, 0.008, 0.008, 0.03, 2, 18, 17, 1, 3),
    "march": GaitForm(0.54, 0.86, 76, 4, 18, 0.006, 0.006, 0.028, 2, 26, 30, -1, 3),
    "jog": GaitForm(0.37, 1.14, 42, 56, 22, 0.03, 0.035, 0.018, -12, 88, 24, 4, 5),
    "run": GaitForm(0.32, 1.2, 56, 60, 24, 0.035, 0.035, 0.014, -10, 92, 34, 6, 6),
    "sprint": GaitForm(0.27, 1.22, 66, 62, 24, 0.04, 0.035, 0.012, -8, 92, 42, 8, 7),
}
"""Gaits by name."""
TEMPOS = {"slow": (1.2, 1.3), "": (0.96, 1.05), "fast": (0.84, 0.9)}
"""How many times as long a step takes, by pace."""
KNEES_HIGH = 84.0
"""Degrees of a thigh where the knees go high."""
_BEGINS_S = 0.7
"""Seconds in which steps, arms and trunk come to their full size, and back."""
_SHORTEST_S = 0.23
"""Seconds of the quickest step: a foot stands for two frames at least."""


def gait_in_place(
    rng: random.Random,
    gait: str,
    *,
    seconds: float,
    pace: str = "",
    knees_high: bool = False,
    waits: tuple[float, float] = (0.3, 0.5),
) -> Gesture:
    """A body that steps in place.

    Args:
        rng: decides everything that is not given.
        gait: of `FORMS`.
        seconds: of the whole.
        pace: slow, fast or empty.
        knees_high: the thighs come up to the level.
        waits: seconds that the body stands before it and after it, about.
    """
    form, first = FORMS[gait], rng.choice(SIDES)
    step_s = max(form.step_s * rng.uniform(*TEMPOS[pace]), _SHORTEST_S)
    form = replace(form, step_s=step_s, **({"thigh": KNEES_HIGH, "shank": min(form.shank, 30.0)} if knees_high else {}))
    moves = max(seconds - sum(waits), 2 * step_s)
    steps = max(round(moves / step_s - form.air + 1), 2)
    begins = max(seconds - (steps - 1 + form.air) * step_s - waits[1], min(waits[0], 0.1))

    def change(body: StandingBody) -> None:
        time = (np.arange(len(body.joints)) / FPS - begins) / step_s  # in steps
        ends = steps - 1 + form.air
        ramp = min(_BEGINS_S / step_s, 0.4 * ends)
        size = eased((time + 0.3) / ramp) * (1 - eased((time - ends - 0.3 + ramp) / ramp))
        lifts = {side: _lifts(time, steps, form.air, side != first) for side in SIDES}
        _move_trunk(body, form, time, size, first)
        for side in SIDES:
            share = lifts[side] * (0.55 + 0.45 * size)
            _lift_leg(body, side, form, share)
            swing_running_arm(body, side, form, size, _phase(time, OTHER_SIDE[side], first))

    return Gesture(seconds, (f"{gait}-in-place",), change, times=steps, fills=True)


def _lifts(time: Array, steps: int, air: float, later: bool) -> Array:
    """Return how much a foot is lifted (T,), 0 to 1; `later`: it is the second one.

    Args:
        time: (T,) in steps.
        steps: of both feet.
        air: in steps.
        later: the other foot steps first.
    """
    found = np.zeros(len(time))
    for number in range(int(later), steps, 2):
        share = np.clip((time - number) / air, 0.0, 1.0)
        found += np.sin(np.pi * share) ** 1.4
    return found


def _phase(time: Array, side: str, first: str) -> Array:
    """Return -1 to 1 (T,): by how much the foot of a side is ahead in its round."""
    return (1.0 if side == first else -1.0) * np.sin(np.pi * np.clip(time, 0.0, None))


def _move_trunk(body: StandingBody, form: GaitForm, time: Array, size: Array, first: str) -> None:
    """Lower, sway, lean and twist the trunk."""
    phase = _phase(time, first, first)
    middle = np.sin(np.pi * (time - 0.5 * (form.air - 1.0))) ** 2  # highest in the middle of a step
    body.shift(
        -size * (form.sinks + form.bobs * middle),
        0.0,
        -SIGN[first] * form.sways * smooth_seconds(size * phase, 0.04, FPS),
    )
    body.lean(form.leans * size, "left")
    body.lean(SIGN[first] * form.twists * size * phase, "up")


def _lift_leg(body: StandingBody, side: str, form: GaitForm, share: Array) -> None:
    """Lift a foot: first off the floor, then to its place."""
    hip, knee, ankle, toe = LEGS[side]
    thigh, shank, hangs = (np.radians(each) for each in (form.thigh, form.shank, form.toes))
    bent = BONE_LENGTHS[knee] * np.array([0.0, -np.cos(thigh), np.sin(thigh)])
    below = bent + BONE_LENGTHS[ankle] * np.array([0.0, -np.cos(shank), -np.sin(shank)])
    out = np.array([0.02, 0.0, 0.0])
    weights = np.stack([share**2, eased(1.15 * share) * 0.5 + 0.5 * share, share**1.6], axis=-1)
    foot = body.local(body.joints[:, toe] - body.joints[:, ankle], side)
    angle = hangs * eased(1.3 * share)
    cosine, sine = np.cos(angle), np.sin(angle)
    hung = np.stack(
        [foot[:, 0], foot[:, 1] * cosine - foot[:, 2] * sine, foot[:, 2] * cosine + foot[:, 1] * sine], axis=-1
    )
    for joint, place in ((knee, bent + out), (ankle, below + out)):
        wanted = body.joints[:, hip] + body.world(np.tile(place, (len(share), 1)), side)
        body.joints[:, joint] += body.world(weights * body.local(wanted - body.joints[:, joint], side), side)
    body.joints[:, toe] = body.joints[:, ankle] + body.world(hung, side)


def swing_running_arm(body: StandingBody, side: str, form: GaitForm, size: Array, phase: Array) -> None:
    """Swing an arm with the foot of the other side."""
    upper = np.radians(form.upper + form.swings * phase)
    fore = upper + np.radians(form.elbow + 0.25 * form.swings * phase)
    out = np.full(len(size), 0.16)
    ways = [
        np.stack([aside, -np.cos(angle), np.sin(angle)], axis=-1) for aside, angle in ((out, upper), (-0.6 * out, fore))
    ]
    unit = [way / np.linalg.norm(way, axis=-1, keepdims=True) for way in ways]
    body.move_arm(side, size, unit[0], unit[1], 0.0, straight=True)
