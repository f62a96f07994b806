"""Flights of a body that leaves the floor and lands: feet that roll over the toes, and hips on a parabola."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from marey.drawing.gesture import Gesture
from marey.drawing.passing import pose
from marey.drawing.postures import FootPlace, Point, Posture
from marey.drawing.sequels import Sequel
from marey.motion.rotations import normalize
from marey.motion.skeleton import HUMANML3D
from marey.posing.limbs import GRAVITY
from marey.posing.standing import LEFT, RIGHT, SIGN, StandingBody

_LEGS = {LEFT: (7, 10), RIGHT: (8, 11)}
_LENGTH = {side: float(np.linalg.norm(HUMANML3D.offsets[toe])) for side, (_, toe) in _LEGS.items()}
_SHARES = (0.12, 0.3, 0.5, 0.7, 0.88)
"""Shares of a flight at which it passes a posture."""
_TOE, _ANKLE = 0.01, 0.07  # metres over the floor of a foot that stands; see `FootPlace`


@dataclass(frozen=True)
class StandingFoot:
    """A foot of an idle: its ankle, outward and forward of the middle of both, and its direction on the floor."""

    side: str
    out: float
    forward: float
    towards: tuple[float, float]
    """Outward and forward, of length 1."""

    def flat(self, forward: float = 0.0, up: float = 0.0, left: float = 0.0) -> FootPlace:
        """The foot flat, moved by metres."""
        return FootPlace((self.out + SIGN[self.side] * left, _ANKLE + up, self.forward + forward))

    def tiptoe(self, degrees: float, forward: float = 0.0, up: float = 0.0, left: float = 0.0) -> FootPlace:
        """The foot with its heel lifted about the toes until it points down by degrees below level, moved by metres."""
        length, pitch = _LENGTH[self.side], math.radians(degrees)
        level = math.sqrt(length**2 - (_ANKLE - _TOE) ** 2) - length * math.cos(pitch)
        at = (
            self.out + SIGN[self.side] * left + level * self.towards[0],
            _TOE + length * math.sin(pitch) + up,
            self.forward + level * self.towards[1] + forward,
        )
        return FootPlace(at, self.pointing(degrees))

    def pointing(self, degrees: float) -> Point:
        """The direction of the foot turned down to degrees below level."""
        pitch = math.radians(degrees)
        return (self.towards[0] * math.cos(pitch), -math.sin(pitch), self.towards[1] * math.cos(pitch))


StandingFeet = dict[str, StandingFoot]
"""Both feet of an idle by side."""


def standing_feet(body: StandingBody) -> StandingFeet:
    """Measure the feet of an idle by side; see `StandingFoot`."""
    joints = body.joints
    middle = joints[:, [7, 8]].mean((0, 1))
    across = (joints[:, 1] - joints[:, 2]).mean(0) * np.array([1.0, 0.0, 1.0])
    left = normalize(across)
    forward = np.cross(left, [0.0, 1.0, 0.0])
    feet = {}
    for side, (ankle, toe) in _LEGS.items():
        out = left if side == LEFT else -left
        at = joints[:, ankle].mean(0) - middle
        pointed = (joints[:, toe] - joints[:, ankle]).mean(0)
        towards = normalize(np.array([pointed @ out, pointed @ forward]))
        feet[side] = StandingFoot(side, float(at @ out), float(at @ forward), (float(towards[0]), float(towards[1])))
    return feet


def flight_height(seconds: float) -> float:
    """Metres by which a body rises that comes back to the same height after `seconds`."""
    return GRAVITY * seconds**2 / 8


def fly(
    done: Sequel, seconds: float, leaving: Posture, landing: Posture, shaped: Callable[[float, float], Posture]
) -> None:
    """Add a flight to a sequence that stands at the posture in which it leaves the floor.

    Args:
        done: the sequence.
        seconds: length of the flight.
        leaving, landing: postures at both ends, with the place of the pelvis.
        shaped: the posture in the air, of the share of the flight and the metres by which the body has risen; its
            pelvis is ignored.
    """
    start, end = (np.array(posture.pelvis) for posture in (leaving, landing))
    before = 0.0
    for share in _SHARES:
        rise = 4 * share * (1 - share) * flight_height(seconds)
        at = (1 - share) * start + share * end + np.array([0.0, rise, 0.0])
        done.then((share - before) * seconds, replace(shaped(share, rise), pelvis=(at[0], at[1], at[2])))
        before = share
    done.then((1 - before) * seconds, landing)


def on_feet(
    sequel: Callable[[StandingFeet], Sequel],
    kinds: Sequence[str],
    after: float,
    *,
    side: str = "",
    mirror: bool = False,
    times: int = 1,
) -> Gesture:
    """The gesture of postures over the feet of an idle, whose places are known only once it is chosen.

    Args:
        sequel: makes the postures from the feet by side; its times do not depend on them.
        kinds: see `Gesture`; empty ones are left out.
        after: seconds that the last posture is held.
        side, times: see `Gesture`.
        mirror: exchange left and right.
    """

    def change(body: StandingBody) -> None:
        feet = standing_feet(body)
        if not mirror:
            done = sequel(feet)
        else:
            swapped = {LEFT: replace(feet[RIGHT], side=LEFT), RIGHT: replace(feet[LEFT], side=RIGHT)}
            done = sequel(swapped).mirrored()
        pose(body, done.times, done.postures)

    seconds = sequel({one: StandingFoot(one, 0.09, 0.0, (0.2, 0.98)) for one in _LEGS}).times[-1]
    return Gesture(seconds + after, tuple(filter(None, kinds)), change, side, times)


def stride_ahead(feet: StandingFeet, far: float, heel: float = 0.0, rear: float = 0.0) -> dict[str, FootPlace]:
    """Return both feet, the left one `far` metres ahead, the heel of the right one lifted until the foot points down by
    `heel` degrees."""
    back = feet[RIGHT].tiptoe(heel, rear) if heel else feet[RIGHT].flat(rear)
    return {LEFT: feet[LEFT].flat(far), RIGHT: back}


def come_together(done: Sequel, feet: StandingFeet, at: float = 0.0) -> Sequel:
    """Add the end of a movement: the feet come together, metres forward of where they stood, and the body stands."""
    done.then(0.6, Posture((0.0, 0.94, at), feet={side: foot.flat(at) for side, foot in feet.items()}))
    return done
