"""Distance of a motion to the nearest motion that its model was trained on: does the model invent, or repeat?

Poses are compared without place and heading, at 10 frames a second, aligned in time by dynamic time warping (Sakoe and
Chiba 1978, symmetric steps) within half a second.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.data.manifest import Clip
from marey.data.prepared import PreparedData
from marey.motion.kinematics import facing
from marey.motion.skeleton import Skeleton

RATE = 10.0
"""Frames a second of compared poses."""
BAND = 5
"""Frames by which matched poses may differ in time."""
LEAST = 10
"""Frames of the shortest training clip that is compared."""
CLOSEST = 6
"""Training clips that are aligned; the others' closest poses are further away."""
SPARSE = 3
"""Of so many poses of a motion one is compared with all training poses, to find the closest clips."""
COPY_MM = 25.0
"""A motion nearer than this to a training clip counts as a copy."""

Array = NDArray[np.float64]


def poses(joints: NDArray[np.floating], fps: float, skeleton: Skeleton) -> Array:
    """Return poses (T, J, 3) in metres at `RATE`: the pelvis above the origin, facing +Z.

    Args:
        joints: (F, J, 3) metres, Y up.
        fps: their rate.
        skeleton: theirs.
    """
    step = fps / RATE
    rows = np.minimum(np.rint(np.arange(max(1, round(len(joints) / step))) * step).astype(int), len(joints) - 1)
    chosen = joints[rows].astype(np.float64)
    chosen[..., [0, 2]] -= chosen[:, :1, [0, 2]]
    forward = facing(chosen, skeleton)
    sin, cos = forward[:, None, 0], forward[:, None, 2]
    x, z = chosen[..., 0], chosen[..., 2]
    return np.stack([cos * x - sin * z, chosen[..., 1], sin * x + cos * z], axis=-1)


def aligned_distance(one: Array, other: Array) -> float:
    """Return the mean distance of joints in millimetres between two motions, the shorter one at its best place in the
    longer one.

    Args:
        one, other: poses (T, J, 3).
    """
    short, long = sorted((one, other), key=len)
    distances = np.linalg.norm(short[:, None] - long[None], axis=-1).mean(axis=-1)  # (T, L)
    return 1000 * float(_warped(distances).min())


def _warped(distances: Array) -> Array:
    """Return the mean cost of the best path from each start (L - T + 1,), in the unit of the distances (T, L).

    A step along both motions counts twice, one along either of them once, so that every path has the same weight in
    all, 2 T.
    """
    size, length = distances.shape
    starts = np.arange(length - size + 1)
    shifts = np.arange(-BAND, BAND + 1)
    places = starts[:, None] + shifts  # (S, B) columns of row 0
    costs = np.full(places.shape, np.inf)
    costs[:, BAND] = 0.0
    for row in range(size):
        columns = places + row
        outside = (columns < 0) | (columns >= length)
        here = np.where(outside, np.inf, distances[row][np.clip(columns, 0, length - 1)])
        before = costs
        stays = np.concatenate([before[:, 1:], np.full((len(starts), 1), np.inf)], axis=1)
        costs = np.minimum(before + 2 * here, stays + here)
        for shift in range(1, len(shifts)):
            costs[:, shift] = np.minimum(costs[:, shift], costs[:, shift - 1] + here[:, shift])
    return costs[:, BAND] / (2 * size)


@dataclass(frozen=True)
class Nearest:
    """The nearest training clip of a motion."""

    clip: str
    millimetres: float


class TrainingPoses:
    """Poses of training clips."""

    def __init__(self, clips: Iterable[tuple[str, Array]]) -> None:
        """Keep clips by id, with the `poses` of each; those shorter than `LEAST` frames are left out.

        Raises:
            ValueError: no clip is left.
        """
        kept = [(name, found) for name, found in clips if len(found) >= LEAST]
        self._names = [name for name, _ in kept]
        self._poses = [found for _, found in kept]
        flat = [found.reshape(len(found), -1).astype(np.float32) for found in self._poses]
        self._flat = np.concatenate(flat)
        self._squares = np.square(self._flat).sum(axis=1)
        lengths = np.array([len(found) for found in flat])
        self._starts = np.cumsum(lengths) - lengths

    @classmethod
    def of(cls, data: PreparedData) -> TrainingPoses:
        """Read the training split: captured, made and mirrored clips of one action."""
        skeleton, fps = data.layout.skeleton, data.manifest.fps
        return cls(
            (clip.id, poses(data.joints(clip), fps, skeleton)) for clip in data.split("train") if _is_of_one(clip)
        )

    def nearest(self, motion: Array) -> Nearest:
        """Return the nearest training clip of poses (T, J, 3).

        Aligning all clips takes too long: only the `CLOSEST` ones are aligned, those whose poses are nearest to the
        motion's whatever their time.
        """
        flat = motion[::SPARSE].reshape(-1, self._flat.shape[1]).astype(np.float32)
        squared = self._squares - 2 * flat @ self._flat.T + np.square(flat).sum(axis=1)[:, None]  # (T / 3, all)
        closest = np.minimum.reduceat(np.maximum(squared, 0), self._starts, axis=1)  # (T, clips)
        bound = np.sqrt(closest).mean(axis=0)
        order = np.argsort(bound)[:CLOSEST]
        found = [(aligned_distance(motion, self._poses[clip]), clip) for clip in order]
        distance, clip = min(found)
        return Nearest(self._names[clip], distance)


def _is_of_one(clip: Clip) -> bool:
    return len(clip.acts) == 1 and clip.speed == 1.0 and not clip.spliced
