"""A moving body measured for the rules of the referee.

Input is joint positions alone: (T, 22, 3) in the joint order of HumanML3D, metres, Y up, the floor at height 0. All
measures are scaled to a body 1.75 m tall, so that the distances of the vocabulary's definitions hold for any body.
"""

from __future__ import annotations

import itertools
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.skeleton import HUMANML3D

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

STATURE = 1.75
REFERENCE_STATURE = 1.73
"""Of the skeleton `humanml3d`."""
_CHAINS = (
    ("L_hip", "L_knee", "L_ankle"),
    ("R_hip", "R_knee", "R_ankle"),
    ("pelvis", "spine1", "spine2", "spine3", "neck"),
)
_INDEX = {name: index for index, name in enumerate(HUMANML3D.joint_names)}
SIDES = ("L", "R")
SMOOTHING_S = 0.1
"""Window of the running mean before velocities are taken."""
SLOW_S = 0.5
"""Window of measures of the path as a whole."""
ENDS_S = 1.0
"""Longest standing before and after an action that does not count as part of the clip."""
MOST = 0.6
FLOOR_ERROR = 0.06
HIPS = 0.94 * STATURE / REFERENCE_STATURE
"""Standing height of the pelvis."""
SHOULDERS = 1.405 * STATURE / REFERENCE_STATURE
CHEST = 1.245 * STATURE / REFERENCE_STATURE
HEAD = 1.555 * STATURE / REFERENCE_STATURE
"""Standing height of the head joint; the top of the head is 0.17 m over it."""
ANKLE = 0.06 * STATURE / REFERENCE_STATURE


class Body:
    """Measures of one clip. Arrays have an entry a frame; angles are degrees, speeds metres a second.

    Args:
        joints: (T, 22, 3) positions, metres, Y up.
        fps: frames per second.

    Raises:
        InvalidInput: another shape, too few frames, or a position that is not finite.
    """

    def __init__(self, joints: NDArray[np.floating], fps: float) -> None:
        positions = np.asarray(joints, np.float64)
        if positions.ndim != 3 or positions.shape[1:] != (len(HUMANML3D), 3):
            raise InvalidInput(f"joints have shape {positions.shape}, not (T, {len(HUMANML3D)}, 3)", where="joints")
        if len(positions) < 3 or not np.isfinite(positions).all():
            raise InvalidInput("a motion needs three frames of finite positions", where="joints")
        self.fps = float(fps)
        self._positions = positions * _scale(positions)

    def __len__(self) -> int:
        return len(self._positions)

    def part(self, begin: int, end: int) -> Body:
        """Return the frames from `begin` to before `end` as a body of its own."""
        part = object.__new__(Body)
        part.fps = self.fps
        part._positions = self._positions[begin:end]
        return part

    def on_own_floor(self) -> Body:
        """Return the body with its lowest foot on the floor, as one is judged that stands on something."""
        moved = self.part(0, len(self))
        moved._positions = self._positions - [0.0, float(self.lowest_foot.min()), 0.0]
        return moved

    # -- positions and velocities -------------------------------------------------------------------------------------

    def at(self, joint: str) -> Floats:
        """(T, 3) position of a joint in the world."""
        return self._positions[:, _INDEX[joint]]

    def height(self, joint: str) -> Floats:
        """Height of a joint over the floor."""
        return self.at(joint)[:, 1]

    def velocity(self, joint: str, window: float = SMOOTHING_S) -> Floats:
        """(T, 3) velocity of a joint in the world."""
        return np.gradient(self.smooth(self.at(joint), window), axis=0) * self.fps

    def speed(self, joint: str, window: float = SMOOTHING_S) -> Floats:
        """Speed of a joint in the world."""
        return np.linalg.norm(self.velocity(joint, window), axis=-1)

    def own(self, joint: str, origin: str = "pelvis") -> Floats:
        """(T, 3) position of a joint from another in the body's frame: to its left, upward, forward."""
        return self._in_frame(self.at(joint) - self.at(origin))

    def ahead(self, joint: str) -> Floats:
        """Distance of a joint before the chest the way that it faces, m."""
        return ((self.at(joint) - self.at("spine3")) * self.chest_forward).sum(-1)

    def own_velocity(self, joint: str, origin: str = "pelvis", window: float = SMOOTHING_S) -> Floats:
        """(T, 3) velocity of a joint from another in the body's frame, its turning left out."""
        return self._in_frame(self.velocity(joint, window) - self.velocity(origin, window))

    def smooth(self, values: Floats, seconds: float) -> Floats:
        """Return the running mean over a window of so many seconds; at the ends over what is there of it."""
        size = max(1, round(seconds * self.fps)) | 1
        if size == 1 or len(values) < 2:
            return values
        half = size // 2
        padded = np.concatenate([np.zeros_like(values[:1]), np.cumsum(values, axis=0)])
        frames = np.arange(len(values))
        low, high = np.maximum(frames - half, 0), np.minimum(frames + half + 1, len(values))
        counts = (high - low).reshape(-1, *(1,) * (values.ndim - 1))
        return (padded[high] - padded[low]) / counts

    # -- the body's frame ---------------------------------------------------------------------------------------------

    @cached_property
    def forward(self) -> Floats:
        """(T, 3) horizontal direction that the pelvis faces; kept from before where it faces up or down."""
        return self._facing("hip")

    @cached_property
    def chest_forward(self) -> Floats:
        """(T, 3) horizontal direction that the chest faces, which may be turned against the pelvis."""
        return self._facing("shoulder")

    def _facing(self, joint: str) -> Floats:
        """(T, 3) horizontal direction across which a pair of joints lies; kept from before where they lie upright."""
        across = self.at(f"L_{joint}") - self.at(f"R_{joint}")
        width = np.linalg.norm(across, axis=-1)
        across = across * [1.0, 0.0, 1.0]
        level = np.linalg.norm(across, axis=-1)
        clear = level > 0.4 * width
        facing = np.stack([-across[:, 2], np.zeros(len(across)), across[:, 0]], axis=-1)
        known = np.flatnonzero(clear)
        if not len(known):
            return np.tile([0.0, 0.0, 1.0], (len(across), 1))
        held = known[np.maximum(np.searchsorted(known, np.arange(len(across)), side="right") - 1, 0)]
        chosen = facing[held]
        return chosen / np.linalg.norm(chosen, axis=-1, keepdims=True)

    @cached_property
    def left(self) -> Floats:
        """(T, 3) horizontal direction to the body's left."""
        return np.stack([self.forward[:, 2], np.zeros(len(self)), -self.forward[:, 0]], axis=-1)

    @cached_property
    def yaw(self) -> Floats:
        """Direction that the body faces, degrees, positive to the left, without jumps of 360."""
        return np.rad2deg(np.unwrap(np.arctan2(self.forward[:, 0], self.forward[:, 2])))

    def _in_frame(self, vectors: Floats) -> Floats:
        return np.stack(
            [(vectors * self.left).sum(-1), vectors[:, 1], (vectors * self.forward).sum(-1)],
            axis=-1,
        )

    # -- posture ------------------------------------------------------------------------------------------------------

    @cached_property
    def trunk(self) -> Floats:
        """(T, 3) unit vector from pelvis to neck in the body's frame."""
        vector = self.own("neck")
        return vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-9)

    @cached_property
    def lean(self) -> Floats:
        """Angle between trunk and the vertical."""
        return np.rad2deg(np.arccos(np.clip(self.trunk[:, 1], -1, 1)))

    @cached_property
    def tip(self) -> Floats:
        """Angle by which the trunk tips forward; negative backward, over 90 upside down."""
        return np.rad2deg(np.arctan2(self.trunk[:, 2], self.trunk[:, 1]))

    def bend(self, side: str, limb: str) -> Floats:
        """Bending of a knee or an elbow: 0 is straight.

        Args:
            side: `L` or `R`.
            limb: `knee` or `elbow`.
        """
        ends = ("hip", "ankle") if limb == "knee" else ("shoulder", "wrist")
        middle = self.at(f"{side}_{limb}")
        upper, lower = middle - self.at(f"{side}_{ends[0]}"), self.at(f"{side}_{ends[1]}") - middle
        lengths = np.linalg.norm(upper, axis=-1) * np.linalg.norm(lower, axis=-1)
        return np.rad2deg(np.arccos(np.clip((upper * lower).sum(-1) / np.maximum(lengths, 1e-9), -1, 1)))

    def lift(self, side: str) -> Floats:
        """Height of the lowest part of a foot over where it stands; captured feet stand up to 0.06 m over the floor."""
        lowest = np.minimum(self.height(f"{side}_foot"), self.height(f"{side}_ankle") - ANKLE)
        return lowest - min(max(float(np.percentile(lowest, 5)), 0.0), FLOOR_ERROR)

    @cached_property
    def lowest_foot(self) -> Floats:
        """Height of the lower foot over the floor."""
        return np.minimum(self.lift("L"), self.lift("R"))

    def hand_apart(self) -> Floats:
        """Distance between the wrists."""
        return np.linalg.norm(self.at("L_wrist") - self.at("R_wrist"), axis=-1)

    @cached_property
    def standing(self) -> Mask:
        """True where the body is upright on its feet."""
        return (self.height("pelvis") > 0.8 * HIPS) & (self.lean < 40) & (self.lowest_foot < 0.12)

    @cached_property
    def quiet(self) -> Mask:
        """True where the body stands upright and hardly moves."""
        moving = np.max([self.speed(joint) for joint in ("pelvis", "L_wrist", "R_wrist", "L_foot", "R_foot")], axis=0)
        return self.standing & (moving < 0.35)

    @cached_property
    def core(self) -> slice:
        """The clip without up to a second of quiet standing at each end."""
        limit = round(ENDS_S * self.fps)
        begin = end = 0
        while begin < limit and begin < len(self) and self.quiet[begin]:
            begin += 1
        while end < limit and end < len(self) - begin and self.quiet[-1 - end]:
            end += 1
        if len(self) - begin - end < 0.3 * self.fps:
            return slice(0, len(self))
        return slice(begin, len(self) - end)

    # -- time ---------------------------------------------------------------------------------------------------------

    def seconds(self, mask: Mask) -> float:
        """Seconds in which a condition holds."""
        return float(mask.sum()) / self.fps

    def longest(self, mask: Mask) -> float:
        """Longest time for which a condition holds without a break, seconds."""
        return max((end - begin for begin, end in runs(mask)), default=0) / self.fps

    def share(self, mask: Mask) -> float:
        """Share of the clip in which a condition holds, standing at the ends left out."""
        return float(mask[self.core].mean())

    def most(self, mask: Mask, share: float = MOST) -> bool:
        """Return True if a condition holds for most of the clip."""
        return self.share(mask) >= share

    def frames(self, seconds: float) -> int:
        """Frames of so many seconds, at least one."""
        return max(1, round(seconds * self.fps))

    def within(self, values: Floats, seconds: float) -> Floats:
        """Largest change of a value from any frame to a later one at most so many seconds after it."""
        best = np.zeros(len(values))
        for step in range(1, min(self.frames(seconds), len(values) - 1) + 1):
            change = np.abs(values[step:] - values[:-step])
            best[:-step] = np.maximum(best[:-step], change if change.ndim == 1 else np.linalg.norm(change, axis=-1))
        return best


def runs(mask: Mask) -> list[tuple[int, int]]:
    """Return (begin, end) of each stretch of True; `end` is the frame after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(begin), int(end)) for begin, end in zip(edges[::2], edges[1::2], strict=True)]


def swings(values: Floats, size: float) -> list[tuple[int, int]]:
    """Return (from, to) frames of each movement of a value by at least `size`, in turns up and down."""
    turning: list[int] = [0]
    extreme, direction = 0, 0
    for frame, value in enumerate(values):
        if direction == 0:
            low, high = int(np.argmin(values[: frame + 1])), int(np.argmax(values[: frame + 1]))
            if values[high] - values[low] >= size:
                direction = 1 if high > low else -1
                turning, extreme = [min(low, high)], max(low, high)
        elif direction * (value - values[extreme]) > 0:
            extreme = frame
        elif direction * (values[extreme] - value) >= size:
            turning.append(extreme)
            extreme, direction = frame, -direction
    if direction:
        turning.append(extreme)
    return list(itertools.pairwise(turning))


def _scale(positions: Floats) -> float:
    length = reference = 0.0
    rest = HUMANML3D.rest
    for chain in _CHAINS:
        for upper, lower in itertools.pairwise(chain):
            a, b = _INDEX[upper], _INDEX[lower]
            length += float(np.median(np.linalg.norm(positions[:, b] - positions[:, a], axis=-1)))
            reference += float(np.linalg.norm(rest[b] - rest[a]))
    if length < 1e-6:
        raise InvalidInput("all joints are at one point", where="joints")
    return reference * STATURE / REFERENCE_STATURE / length
