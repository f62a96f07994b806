"""Runs backward: quick steps on bent knees with both feet in the air between them, the trunk over the toes."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from marey.drawing.footsteps import Footstep, Manner, stepped
from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.in_place import FORMS, swing_running_arm
from marey.motion.filters import smooth_seconds
from marey.posing.limbs import FPS
from marey.posing.standing import SIGN, StandingBody, eased

Array = NDArray[np.floating]


@dataclass(frozen=True)
class BackRun:
    """How a run backward is done.

    Attributes:
        step_s: seconds from one step to the next.
        metres: of a step.
        arms: name of the gait in `marey.drawing.in_place` whose arms it has.
        leans: degrees of the trunk, forward.
    """

    step_s: float
    metres: float
    arms: str
    leans: float


BACK_RUNS = {"jog": BackRun(0.35, 0.58, "jog", 11.0), "run": BackRun(0.31, 0.68, "run", 14.0)}
"""Runs backward by name."""
TEMPOS = {"slow": 1.2, "": 1.0, "fast": 0.88}
"""How many times as long a step takes, by pace."""
_AIR = 1.22
"""How long a foot is in the air, in steps: more than 1, so that both are between two."""
_LIFT, _HEEL, _SINKS, _BOB, _FOLLOWS_S = 0.13, 42.0, 0.035, 0.035, 0.16
"""Metres by which a foot is lifted, degrees by which its heel is, metres by which the hips sink, and rise in each
flight, and seconds over which they follow the feet."""
_BEGINS_S = 0.4
"""Seconds in which arms and trunk come to their place, and back."""


def run_back(
    rng: random.Random, count: int, *, form: str = "jog", pace: str = "", waits: tuple[float, float]
) -> Gesture:
    """A body that stands, runs some steps backward, and stands.

    Args:
        rng: decides everything that is not given.
        count: of the steps, 3 or more.
        form: key of `BACK_RUNS`.
        pace: slow, fast or empty.
        waits: seconds that the body stands before it and after it.
    """
    run, first = BACK_RUNS[form], rng.choice((0, 1))
    interval = run.step_s * TEMPOS[pace] * rng.uniform(0.97, 1.04)
    far = run.metres * rng.uniform(0.95, 1.05)
    steps = [
        Footstep(
            (first + number) % 2,
            waits[0] + number * interval,
            _AIR * interval,
            forward=-far * min(number + 1, count - 1),
        )
        for number in range(count)
    ]
    end = waits[0] + (count - 1 + _AIR) * interval
    manner = Manner(_LIFT, _HEEL, 0.012, 0.0)
    arms = FORMS[run.arms]

    def change(body: StandingBody) -> None:
        time = np.arange(len(body.joints)) / FPS
        size = eased((time - waits[0] + 0.1) / _BEGINS_S) * (1 - eased((time - end + 0.1) / _BEGINS_S))
        at = (time - waits[0]) / interval
        body.lean(run.leans * size, "left")
        phase = np.sin(np.pi * np.clip(at, 0.0, None))
        for side in SIDES:
            swing_running_arm(body, side, arms, size, SIGN[side] * SIGN[SIDES[first]] * phase)
        body.shift(-_SINKS * size)
        body.joints[:] = stepped(body.joints, steps, manner, _FOLLOWS_S)
        body.joints[..., 1] += _BOB * _flies(steps, time)[:, None]

    return Gesture(end + waits[1], ("walk-backward", "run"), change, times=count)


def _flies(steps: Sequence[Footstep], time: Array) -> Array:
    """Return how high a body is in its flights (T,), 0 to 1: while both feet are in the air."""
    found = np.zeros(len(time))
    for before, after in pairwise(steps):
        ends = before.start + before.seconds
        share = np.clip((time - after.start) / max(ends - after.start, 1e-6), 0.0, 1.0)
        found += 4 * share * (1 - share)
    return smooth_seconds(np.clip(found, 0.0, 1.0), 0.03, FPS)


def back_steps_in(seconds: float, form: str, pace: str, waits: Sequence[float]) -> int:
    """Return how many steps of a run backward take so many seconds, with the time that the body stands; 3 or more."""
    step_s = BACK_RUNS[form].step_s * TEMPOS[pace]
    return max(3, round((seconds - sum(waits)) / step_s - _AIR + 1))
