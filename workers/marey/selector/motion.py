"""Signals of a motion that rules read, computed once for the whole motion and sliced for its parts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import (
    ANKLES,
    ELBOWS,
    HEAD,
    HIPS,
    KNEES,
    NECK,
    PELVIS,
    SHOULDERS,
    TOES,
    WRISTS,
    body_frame,
    heading,
    trunk_up,
    velocity,
)
from marey.motion.body import STATURE, stature
from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds
from marey.motion.skeleton import HUMANML3D
from marey.quality.measure import check_joints

Array = NDArray[np.floating]
Bool = NDArray[np.bool_]

SHORTEST = 8
"""Frames of the shortest motion that is matched."""
UP = -0.28
"""Metres over the shoulders from which on a hand is up: the height of the chest."""
CHEST = HUMANML3D.index("spine3")
OFF_FLOOR = 0.04
"""Metres over its standing height from which a foot is off the floor."""
HIGH_UP = 0.3
"""Metres over the floor from which feet at the beginning of a motion stand on something."""

_REST = HUMANML3D.rest.astype(np.float64) * STATURE / stature(HUMANML3D)
_LEG = float(np.linalg.norm(_REST[1] - _REST[4]) + np.linalg.norm(_REST[4] - _REST[7]))
STANDING = {joint: float(_REST[joint, 1] - _REST[list(TOES), 1].min()) for joint in (PELVIS, CHEST, NECK, HEAD, 16, 17)}
"""Heights in metres of joints of a standing body of 1.75 m."""


class Signal:
    """A value for each frame of a `Motion`."""

    def __init__(self, compute: Callable[[Motion], Array]) -> None:
        self._compute = compute
        self._name = compute.__name__
        self.__doc__ = compute.__doc__

    def __get__(self, motion: Motion, owner: type[Motion]) -> Array:
        cache = motion.whole.cache
        if self._name not in cache:
            cache[self._name] = self._compute(motion.whole)
        return cache[self._name][motion.begin : motion.end]


@dataclass(frozen=True)
class AirPhase:
    """A stretch in which both feet are off the floor.

    Attributes:
        height: of the lower foot at the highest moment, metres.
        distance: of the hips over the floor, metres.
        seconds: length.
        apart: seconds between the moments at which the two feet leave the floor.
        turn: degrees, from a tenth of a second before it to a tenth after it; positive to the left.
    """

    height: float
    distance: float
    seconds: float
    apart: float
    turn: float


class Motion:
    """A motion, or a part of one, scaled to a body 1.75 m tall. Angles are in degrees, positive to the left."""

    def __init__(self, joints: NDArray[np.floating], fps: float) -> None:
        """Keep the joints.

        Args:
            joints: (T >= `SHORTEST`, 22, 3) metres, Y up, the floor at y = 0.
            fps: frames a second.

        Raises:
            InvalidInput: another shape, or numbers that are not finite.
        """
        joints = check_joints(joints, SHORTEST, where="selector")
        legs = [
            np.median(np.linalg.norm(joints[:, a] - joints[:, b], axis=-1))
            for pair in (zip(HIPS, KNEES, strict=True), zip(KNEES, ANKLES, strict=True))
            for a, b in pair
        ]
        scale = 2 * _LEG / max(float(np.sum(legs)), 1e-6)
        self.cache: dict[str, Array] = {"joints": joints * scale}
        self.fps = fps
        self.begin, self.end = 0, len(joints)
        self.whole = self

    def part(self, begin: int, end: int) -> Motion:
        """Return frames `begin` to `end` (exclusive) of this motion, sharing its signals."""
        part = object.__new__(Motion)
        part.cache, part.fps, part.whole = self.cache, self.fps, self.whole
        part.begin, part.end = self.begin + begin, self.begin + end
        return part

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.end - self.begin

    @property
    def seconds(self) -> float:
        """Length."""
        return self.frames / self.fps

    @property
    def joints(self) -> Array:
        """(T, 22, 3) metres."""
        return self.cache["joints"][self.begin : self.end]

    # -- the whole body

    @Signal
    def heading(self) -> Array:
        """(T,) heading, unwrapped."""
        return heading(self.joints, self.fps)

    @Signal
    def hips(self) -> Array:
        """(T,) height of the hips as a share of their standing height."""
        return self.joints[:, PELVIS, 1] / STANDING[PELVIS]

    @Signal
    def place(self) -> Array:
        """(T, 2) place of the hips over the floor, smoothed."""
        return smooth_seconds(self.joints[:, PELVIS], 0.1, self.fps)[:, [0, 2]]

    @Signal
    def flow(self) -> Array:
        """(T, 2) speed of the hips forward and to the left, smoothed over a step, metres a second."""
        forward, left = body_frame(
            velocity(smooth_seconds(self.joints[:, PELVIS], 0.25, self.fps), self.fps), self.heading
        )
        return np.stack([forward, left], axis=-1)

    @Signal
    def lean(self) -> Array:
        """(T,) degrees by which the trunk leans forward."""
        up = smooth_seconds(trunk_up(self.joints), 0.08, self.fps)
        forward, _ = body_frame(up, self.heading)
        return np.degrees(np.arctan2(forward, up[:, 1]))

    @Signal
    def tilt(self) -> Array:
        """(T,) degrees between the trunk and the vertical."""
        return np.degrees(np.arccos(np.clip(trunk_up(self.joints)[:, 1], -1, 1)))

    @Signal
    def lively(self) -> Array:
        """(T,) mean speed of the joints relative to the hips, smoothed over half a second, metres a second."""
        local = self.joints - self.joints[:, :1]
        return smooth_seconds(np.linalg.norm(velocity(local, self.fps), axis=-1).mean(axis=1), 0.5, self.fps)

    @Signal
    def pitch(self) -> Array:
        """(T,) degrees by which the head is tipped forward on the neck."""
        head = self.joints[:, HEAD] - self.joints[:, NECK]
        forward, _ = body_frame(head, self.heading)
        return np.degrees(np.arctan2(forward, head[:, 1]))

    # -- legs

    @Signal
    def feet(self) -> Array:
        """(T, 2) height of each foot over where it stands, metres."""
        ankle, toe = self.joints[:, list(ANKLES), 1] - 0.07, self.joints[:, list(TOES), 1]
        return np.minimum(ankle, toe)

    @Signal
    def foot_speed(self) -> Array:
        """(T, 2) speed of each ankle, metres a second."""
        points = smooth_seconds(self.joints[:, list(ANKLES)], 0.03, self.fps)
        return np.linalg.norm(velocity(points, self.fps), axis=-1)

    @Signal
    def step_speed(self) -> Array:
        """(T, 2) speed of the slower one of ankle and toe of each foot, metres a second."""
        toes = velocity(smooth_seconds(self.joints[:, list(TOES)], 0.03, self.fps), self.fps)
        return np.minimum(self.foot_speed, np.linalg.norm(toes, axis=-1))

    @Signal
    def foot_local(self) -> Array:
        """(T, 2, 3) each ankle from the hips: forward, up, left, metres."""
        return _local(self.joints[:, list(ANKLES)] - self.joints[:, [PELVIS]], self.heading)

    @Signal
    def knees(self) -> Array:
        """(T, 2) bend of each knee, degrees, 0 = straight."""
        return _bend(self.joints, HIPS, KNEES, ANKLES)

    @Signal
    def thighs(self) -> Array:
        """(T, 2) angle of each thigh over level, degrees: -90 hangs down."""
        thigh = self.joints[:, list(KNEES)] - self.joints[:, list(HIPS)]
        return np.degrees(np.arctan2(thigh[..., 1], np.hypot(thigh[..., 0], thigh[..., 2])))

    # -- arms

    @Signal
    def hands(self) -> Array:
        """(T, 2, 3) each wrist from the middle of the shoulders: forward, up, left, metres."""
        middle = self.joints[:, list(SHOULDERS)].mean(axis=1, keepdims=True)
        return _local(smooth_seconds(self.joints[:, list(WRISTS)] - middle, 0.03, self.fps), self.heading)

    @Signal
    def reach(self) -> Array:
        """(T, 2, 3) each wrist from its own shoulder: forward, up, left, metres."""
        arms = self.joints[:, list(WRISTS)] - self.joints[:, list(SHOULDERS)]
        return _local(smooth_seconds(arms, 0.03, self.fps), self.heading)

    @Signal
    def ahead(self) -> Array:
        """(T, 2, 3) each wrist from the point of the trunk at its height: forward, up, left, metres. Up is 0 between
        pelvis and neck."""
        pelvis, neck = self.joints[:, [PELVIS]], self.joints[:, [NECK]]
        wrists, rise = self.joints[:, list(WRISTS)], np.maximum((neck - pelvis)[..., 1], 0.05)
        along = np.clip((wrists[..., 1] - pelvis[..., 1]) / rise, 0, 1)
        return _local(
            smooth_seconds(wrists - pelvis - along[..., None] * (neck - pelvis), 0.03, self.fps), self.heading
        )

    @Signal
    def still(self) -> Array:
        """(T, 2) speed of each wrist about the shoulders, smoothed over a tenth of a second, metres a second."""
        return smooth_seconds(np.linalg.norm(velocity(self.hands, self.fps), axis=-1), 0.1, self.fps)

    @Signal
    def over(self) -> Array:
        """(T, 2) height of each wrist over the middle of the shoulders along the trunk, metres."""
        middle = self.joints[:, list(SHOULDERS)].mean(axis=1, keepdims=True)
        arms = self.joints[:, list(WRISTS)] - middle
        return smooth_seconds(np.einsum("tki,ti->tk", arms, trunk_up(self.joints)), 0.05, self.fps)

    @Signal
    def hand_speed(self) -> Array:
        """(T, 2) speed of each wrist relative to the hips, metres a second."""
        points = smooth_seconds(self.joints[:, list(WRISTS)] - self.joints[:, [PELVIS]], 0.03, self.fps)
        return np.linalg.norm(velocity(points, self.fps), axis=-1)

    @Signal
    def elbows(self) -> Array:
        """(T, 2) bend of each elbow, degrees, 0 = straight."""
        return _bend(self.joints, SHOULDERS, ELBOWS, WRISTS)

    # -- numbers of the part

    @property
    def turn(self) -> float:
        """Degrees of heading from the first to the last frame."""
        angle = self.heading
        return float(angle[-1] - angle[0])

    @property
    def travel(self) -> tuple[float, float]:
        """Metres gone forward and to the left, in the direction that the body faces at each moment."""
        forward, left = self.flow.sum(axis=0) / self.fps
        return float(forward), float(left)

    @property
    def path(self) -> float:
        """Length of the way of the hips over the floor, metres; sway does not count."""
        speed = np.hypot(*self.flow.T)
        return float(speed[speed > 0.15].sum() / self.fps)

    @property
    def extent(self) -> float:
        """Farthest that the hips get from their first place, metres."""
        return float(np.linalg.norm(self.place - self.place[0], axis=-1).max())

    @property
    def flights(self) -> list[AirPhase]:
        """The stretches of at least 0.08 s between two contacts in which both feet are off the floor."""
        feet, found = self.feet, list[AirPhase]()
        near = max(round(0.1 * self.fps), 1)
        for a, b in runs(feet.min(axis=1) > OFF_FLOOR):
            if a == 0 and feet[0].min() > HIGH_UP:  # it stands on something high, and jumps down
                a = _last(np.abs(feet[:b] - feet[0]).max(axis=1) < OFF_FLOOR) + 1
            if a and b < len(feet) and b - a >= 0.08 * self.fps:
                left, right = (_last(feet[:a, k] < OFF_FLOOR) for k in (0, 1))
                found.append(
                    AirPhase(
                        height=float(feet[a:b].min(axis=1).max()),
                        distance=float(np.linalg.norm(self.place[b] - self.place[a - 1])),
                        seconds=(b - a) / self.fps,
                        apart=abs(left - right) / self.fps,
                        turn=float(self.heading[min(b + near, len(feet) - 1)] - self.heading[max(a - near, 0)]),
                    )
                )
        return found

    def most(self, mask: Bool) -> float:
        """Return the share of frames of a mask; up to a second at the beginning and the end in which it is false does
        not count, as a clip may begin and end so."""
        frames = np.flatnonzero(mask)
        if not len(frames):
            return 0.0
        spare = round(self.fps)
        length = len(mask) - min(int(frames[0]), spare) - min(len(mask) - 1 - int(frames[-1]), spare)
        return len(frames) / length

    def longest(self, mask: Bool, begin: int = 0, end: int | None = None) -> float:
        """Return the seconds of the longest stretch of a mask of frames, between two frames of it."""
        return max((b - a for a, b in runs(mask[begin:end])), default=0) / self.fps


def _last(mask: Bool) -> int:
    """Return the last frame of a mask; -1 if there is none."""
    found = np.flatnonzero(mask)
    return int(found[-1]) if len(found) else -1


def _local(vectors: Array, angle: Array) -> Array:
    """(T, 2, 3) vectors as forward, up, left."""
    forward, left = body_frame(vectors, angle[:, None])
    return np.stack([forward, vectors[..., 1], left], axis=-1)


def _bend(joints: Array, first: tuple[int, int], at: tuple[int, int], last: tuple[int, int]) -> Array:
    upper, lower = joints[:, list(at)] - joints[:, list(first)], joints[:, list(last)] - joints[:, list(at)]
    norms = np.linalg.norm(upper, axis=-1) * np.linalg.norm(lower, axis=-1)
    return np.degrees(np.arccos(np.clip((upper * lower).sum(axis=-1) / np.maximum(norms, 1e-9), -1, 1)))
