"""Measurements on a motion or a part of it before it is judged, from joints (T, 22, 3) and frames per second alone."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from marey.checks.kinematics import (
    ANKLES,
    PELVIS,
    SHOULDERS,
    TOES,
    WRISTS,
    Array,
    GaitMeasures,
    body_frame,
    gait,
    heading,
    lean,
    runs,
    trunk_up,
    turning_points,
    velocity,
)
from marey.motion.filters import smooth_seconds


@dataclass(frozen=True)
class Arm:
    """Movement of one hand within a stretch.

    Attributes:
        peak: highest wrist over the shoulder line, metres, along the trunk.
        rise: highest over lowest, metres.
        lifted: seconds near the shoulder line or over it.
        swings: half swings of the lifted hand of at least 3 cm.
        flutter: half swings of at least 1 cm, well within the lift.
    """

    peak: float
    rise: float
    lifted: float
    swings: int
    flutter: int

    @property
    def up(self) -> bool:
        """Return True if the hand is lifted on purpose; arms of runners reach -0.1, but do not rise far."""
        return self.peak > -0.14 and (self.rise > 0.25 or self.lifted > 1.0)

    @property
    def down(self) -> bool:
        """Return True if the hand is clearly not lifted."""
        return self.peak < -0.16 or (self.peak < -0.05 and self.rise < 0.25)

    @property
    def waves(self) -> bool:
        """Return True for five or more swings (raised hands have up to three), or small ones within a long lift.

        A wave from the wrist moves the wrist joint by a centimetre or two.
        """
        small = (self.lifted >= 1.5 and self.flutter >= 4) or (self.lifted >= 4.5 and self.flutter >= 3)
        return self.swings >= 5 or small


class Stretch:
    """A motion or a part of it, with cached measurements."""

    def __init__(self, joints: Array, fps: float) -> None:
        self.joints = np.asarray(joints, np.float64)
        self.fps = fps

    @property
    def seconds(self) -> float:
        """Length."""
        return len(self.joints) / self.fps

    @cached_property
    def heading(self) -> Array:
        """(T,) degrees."""
        return heading(self.joints, self.fps)

    @cached_property
    def gait(self) -> GaitMeasures:
        """Travel, turn, steps."""
        return gait(self.joints, self.fps)

    @cached_property
    def along(self) -> Array:
        """(T,) speed in the direction the body faces, metres a second, smoothed over a step."""
        pelvis = smooth_seconds(self.joints[:, PELVIS], 0.25, self.fps)
        return body_frame(velocity(pelvis, self.fps), self.heading)[0]

    @cached_property
    def arms(self) -> tuple[Arm, Arm]:
        """Left and right."""
        return both_arms(self.joints, self.heading, self.fps)

    @cached_property
    def running(self) -> bool:
        """Return True if the travel is a run."""
        return is_run(self.joints, self.fps, self.gait)

    @cached_property
    def bend(self) -> float:
        """Deepest forward lean over the upright one, degrees, that is held by standing legs."""
        angle = lean(self.joints, self.fps)
        standing = np.abs(smooth_seconds(self.along, 0.1, self.fps)) < 0.35
        return float(angle[standing].max() - np.percentile(angle, 20)) if standing.any() else 0.0

    def over(self, side: int) -> Array:
        """(T,) height of a wrist over the shoulder line along the trunk, metres."""
        return wrist_height(self.joints, self.fps, side)

    def part(self, first: int, last: int) -> Stretch:
        """Frames `first` to `last` (exclusive)."""
        return Stretch(self.joints[first:last], self.fps)


def wrist_height(joints: Array, fps: float, side: int) -> Array:
    """(T,) height of a wrist over the middle of the shoulders along the trunk, metres."""
    middle = (joints[:, SHOULDERS[0]] + joints[:, SHOULDERS[1]]) / 2
    return smooth_seconds(np.einsum("ti,ti->t", joints[:, WRISTS[side]] - middle, trunk_up(joints)), 0.05, fps)


def arm(joints: Array, angle: Array, fps: float, side: int) -> Arm:
    """Measure a hand.

    Args:
        joints: (T, 22, 3) metres.
        angle: (T,) heading of the body, degrees.
        fps: frames a second.
        side: 0 is the left one, 1 the right one.
    """
    wrist = joints[:, WRISTS[side]]
    over = wrist_height(joints, fps, side)
    lifted = over > -0.16
    high = lifted & (over > over.max() - max(0.4 * float(np.ptp(over)), 0.25))
    hold = np.zeros_like(high)
    if high.any():
        hold[np.argmax(high) : len(high) - np.argmax(high[::-1])] = True
    local = np.stack([*body_frame(wrist - joints[:, SHOULDERS[side]], angle), wrist[:, 1]], axis=-1)
    swings = flutter = 0
    for a, b in runs(hold):
        moved = local - smooth_seconds(local, 0.5, fps)
        swings = max(swings, _swings(moved[a:b], 0.3, 0.03, fps))
        flutter = max(flutter, _swings(moved[a:b], 0.4, 0.01, fps))
    return Arm(float(over.max()), float(np.ptp(over)), float(lifted.sum() / fps), swings, flutter)


def both_arms(joints: Array, angle: Array, fps: float) -> tuple[Arm, Arm]:
    """Measure the left and the right hand."""
    return arm(joints, angle, fps, 0), arm(joints, angle, fps, 1)


def _swings(moved: Array, margin: float, least: float, fps: float) -> int:
    """Half swings of at least `least` metres along the main axis, `margin` seconds of the lift itself left out."""
    edge = round(margin * fps)
    moved = moved[edge : len(moved) - edge]
    if len(moved) < 6:
        return 0
    axes = np.linalg.svd(moved - moved.mean(axis=0), full_matrices=False)[2]
    return turning_points(moved @ axes[0], least)


def is_run(joints: Array, fps: float, body: GaitMeasures | None = None) -> bool:
    """Return True for running: during a share of the time no foot is on the floor (almost none in a walk).

    A foot stands while its ankle or toe is slower than about a third of the body. Between 1 and 8 % (a shuffle of an
    old runner, a lively walk) the knees decide: walkers stretch one leg nearly at all times, runners none.

    Args:
        joints: (T, 22, 3) metres.
        fps: frames a second.
        body: their travel, where it is known.
    """
    body = body or gait(joints, fps)
    if body.speed < 0.9:
        return False
    points = joints[:, [*ANKLES, *TOES]]
    speed = np.linalg.norm(velocity(points, fps), axis=-1)
    slow = np.minimum(speed[:, :2], speed[:, 2:]) < 0.35 * body.speed + 0.1
    flight = float((~slow).all(axis=1).mean())
    straighter = np.minimum(_flexion(joints, 1, 4, 7), _flexion(joints, 2, 5, 8))
    return flight > 0.08 or (flight > 0.012 and float(np.median(straighter)) > 38.5)


def _flexion(joints: Array, a: int, b: int, c: int) -> Array:
    u, v = joints[:, a] - joints[:, b], joints[:, c] - joints[:, b]
    cosine = np.einsum("ti,ti->t", u, v) / np.maximum(np.linalg.norm(u, axis=1) * np.linalg.norm(v, axis=1), 1e-9)
    return 180 - np.degrees(np.arccos(np.clip(cosine, -1, 1)))
