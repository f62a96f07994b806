"""Marches ahead: even steps on straight legs, with raised knees or as on parade, from standing to standing."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.drawing.footsteps import Footstep, Manner, stepped, swing_arms_with
from marey.drawing.gesture import Gesture
from marey.posing.limbs import FPS
from marey.posing.standing import StandingBody, eased

Array = NDArray[np.floating]

STEP_S = {"slow": (0.72, 0.8), "": (0.5, 0.55), "fast": (0.42, 0.45)}
"""Seconds from one step to the next, by pace."""


@dataclass(frozen=True)
class MarchStyle:
    """How the steps of a march are made.

    Attributes:
        metres: limits of the length of a step.
        lift: metres of the toes over the floor.
        peak: share of a step at which the foot is highest.
        throw: metres by which the foot is further ahead there.
        heel: degrees by which the heel rises first.
        arms: degrees by which the arms swing.
    """

    metres: tuple[float, float]
    lift: float
    peak: float
    throw: float
    heel: float
    arms: float


STYLES = {
    "": MarchStyle((0.5, 0.56), 0.22, 0.46, 0.02, 22.0, 36.0),
    "knees": MarchStyle((0.46, 0.52), 0.4, 0.5, 0.0, 20.0, 40.0),
    "goose": MarchStyle((0.6, 0.66), 0.32, 0.68, 0.24, 4.0, 40.0),
}
"""Styles: plain, with raised knees, and with straight legs thrown ahead."""
_SWINGS = 0.86
"""Share of the time to the next step in which a foot is in the air."""
_FOLLOWS_S = 0.18
"""Seconds over which the hips follow the feet."""
_UPRIGHT = -3.0
"""Degrees by which the trunk leans forward."""


def march(
    rng: random.Random, count: int, *, style: str = "", pace: str = "", back: bool = False, waits: tuple[float, float]
) -> Gesture:
    """A body that stands, marches some steps, and halts: the last step brings a foot beside the other.

    Args:
        rng: decides everything that is not given.
        count: of the steps, 2 or more.
        style: key of `STYLES`.
        pace: slow, fast or empty.
        back: they go back.
        waits: seconds that the body stands before it and after it.
    """
    form, interval = STYLES[style], rng.uniform(*STEP_S[pace])
    far, first = rng.uniform(*form.metres) * (-0.7 if back else 1.0), rng.choice((0, 0, 0, 1))
    steps = [
        Footstep(
            (first + number) % 2,
            waits[0] + number * interval,
            _SWINGS * interval,
            forward=far * min(number + 1, count - 1),
        )
        for number in range(count)
    ]
    end = waits[0] + count * interval
    manner = Manner(form.lift, form.heel, 0.015, 0.0, form.peak, form.throw)

    def change(body: StandingBody) -> None:
        time = np.arange(len(body.joints)) / FPS
        body.lean(_UPRIGHT * eased((time - waits[0] + 0.3) / 0.5), "left")
        swing_arms_with(body, steps, form.arms)
        body.joints[:] = stepped(body.joints, steps, manner, _FOLLOWS_S)

    return Gesture(end + waits[1], ("walk-backward" if back else "walk", "march"), change, times=count)


def steps_in(seconds: float, pace: str, waits: Sequence[float]) -> int:
    """Return how many steps of a march take so many seconds, with the time that the body stands; 2 or more."""
    return max(2, round((seconds - sum(waits)) / (sum(STEP_S[pace]) / 2)))
