"""Sequences of postures with their times, and small changes of them; see `marey.drawing.postures`."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass, field

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.passing import pose
from marey.drawing.postures import STAND, HandPlace, Point, Posture, mirrored

TEMPOS = {"quick": (0.4, 0.6), "": (0.7, 1.1), "slow": (1.2, 1.9)}
"""Seconds of going down or up."""
FLOOR_PACES = {"quick": (0.7, 0.85), "": (0.95, 1.25), "slow": (1.4, 1.8)}
"""Factors of the seconds of a way to the floor or back."""


_HIPS_UP = 0.94
"""Metres of the hips of a body that stands."""
_LEGS_CARRY = 1.15
"""Metres a second at which legs that stay on the floor move the hips at most, in the middle of a way."""
_FASTEST = 1.5
"""How many times its mean speed a body has in the middle of a way between two stops."""
Step = tuple[float, Posture]
"""Seconds in which a posture is reached, and the posture."""


@dataclass
class Sequel:
    """Postures and the times at which they are reached, seconds."""

    times: list[float]
    postures: list[Posture] = field(default_factory=lambda: [STAND])

    def then(self, seconds: float, posture: Posture, hold: float = 0.0) -> None:
        """Reach a posture after `seconds` and hold it."""
        self.times.append(self.times[-1] + seconds)
        self.postures.append(posture)
        if hold > 0.0:
            self.times.append(self.times[-1] + hold)
            self.postures.append(posture)

    def carried(self, seconds: float, posture: Posture, hold: float = 0.0) -> None:
        """Reach a posture as by `then`, but no faster than legs carry hips that start and stop."""
        here, there = (each.pelvis or (0.0, _HIPS_UP, 0.0) for each in (self.postures[-1], posture))
        self.then(max(seconds, _FASTEST * math.dist(here, there) / _LEGS_CARRY), posture, hold)

    def mirrored(self) -> Sequel:
        """The same with left and right exchanged."""
        return Sequel(self.times, [mirrored(posture) for posture in self.postures])

    def either(self, rng: random.Random) -> Sequel:
        """The same or its mirror image, at random."""
        return self if rng.random() < 0.5 else self.mirrored()

    def gesture(self, rng: random.Random, kinds: Sequence[str], side: str = "", times: int = 1) -> Gesture:
        """The gesture that passes through the postures, then stays for a moment; empty kinds are left out."""
        seconds = self.times[-1] + rng.uniform(0.3, 1.0)
        told = tuple(filter(None, kinds))
        return Gesture(seconds, told, lambda body: pose(body, self.times, self.postures), side, times)


def both(hand: HandPlace) -> dict[str, HandPlace]:
    return dict.fromkeys(SIDES, hand)


def near(rng: random.Random, at: Point, far: float = 0.02) -> Point:
    """A random point at most `far` metres from another along each axis."""
    return (at[0] + rng.uniform(-far, far), at[1] + rng.uniform(-far, far), at[2] + rng.uniform(-far, far))
