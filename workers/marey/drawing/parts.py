"""Parts of drawn gestures: lengths of their phases, directions of arms, and the trunk's response."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import BOTH, SIDES
from marey.posing.standing import LEFT, StandingBody, direction, envelope

Array = NDArray[np.floating]


@dataclass(frozen=True)
class GesturePace:
    """Timing of a hand that goes up, stays and comes down, in seconds."""

    start: float
    rise: float
    hold: float
    fall: float

    @classmethod
    def draw(cls, rng: random.Random, rise: tuple[float, float], hold: tuple[float, float]) -> GesturePace:
        up = rng.uniform(*rise)
        return cls(rng.uniform(0.1, 1.3), up, rng.uniform(*hold), up * rng.uniform(0.9, 1.4))

    @classmethod
    def lasting(cls, seconds: float) -> GesturePace:
        """A hand that is up in the first frame already and stays for `seconds`."""
        return cls(-1.0, 0.5, seconds + 1.0, 0.5)

    @property
    def seconds(self) -> float:
        return self.start + self.rise + self.hold + self.fall

    def total(self, rng: random.Random) -> float:
        """Duration with a random time of standing after it, seconds."""
        return self.seconds + rng.uniform(0.25, 1.3)

    def way(self, body: StandingBody) -> Array:
        return envelope(len(body.joints), self.start, self.rise, self.hold, self.fall)


@dataclass(frozen=True)
class DrawnArm:
    """Final directions of an arm, its swing in degrees, and the delay of the forearm in seconds."""

    upper: Array
    fore: Array
    swing: float
    lag: float


def drawn_arm(rng: random.Random, form: Mapping[str, tuple]) -> DrawnArm:
    upper, fore = (direction(*(rng.uniform(*limits) for limits in form[bone])) for bone in ("upper", "fore"))
    return DrawnArm(upper, fore, rng.uniform(*form.get("swing", (0, 0))), rng.uniform(0.0, 0.12))


def arms_of(side: str) -> tuple[str, ...]:
    return SIDES if side == BOTH else (side,)


def respond(body: StandingBody, way: Array, side: str, twist: float, sway: float) -> None:
    """Turn the trunk towards a lifted arm by `twist` and lean it away by `sway`, in degrees."""
    if side != BOTH:
        sign = 1.0 if side == LEFT else -1.0
        body.lean(sign * sway * way, "forward")
        body.lean(-sign * twist * way, "up", (6, 9))
