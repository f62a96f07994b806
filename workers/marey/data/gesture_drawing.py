"""Parts of drawn gestures: lengths of their phases, directions of arms, and the trunk's response."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.data.part import Part
from marey.posing.standing import LEFT, RIGHT, StandingBody, direction, envelope

Array = NDArray[np.floating]

SIDES = (LEFT, RIGHT)
BOTH = "both"


@dataclass(frozen=True)
class Gesture:
    """A drawn gesture.

    Attributes:
        seconds: its length, including the time standing before and after it.
        kinds: keys of the files `gestures*.toml` that apply to it.
        change: applies it to a body of that length.
        side: left, right, both or empty.
        times: number of bows.
        base: what is taken of a captured clip before the change, (T, 22, 3), or None if the clip does not do; without
            it, `seconds` of an idle.
        content: the action of the captured clips that it may be put onto, or empty for all clips of its kind.
        untrue: see `marey.data.spoken.spoken`.
    """

    seconds: float
    kinds: tuple[str, ...]
    change: Callable[[StandingBody], None]
    side: str = ""
    times: int = 1
    base: Callable[[Part], Array | None] | None = None
    content: str = ""
    untrue: str = ""


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
