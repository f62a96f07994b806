"""Retarget a foreign rig to the 22 joints of HumanML3D at 20 frames per second, with uniform proportions.

Trunk and arm bones keep their directions and get the target's lengths, as in HumanML3D (Guo et al. 2022, uniform
skeleton). Legs are solved from the toes up, because feet slide if directions are copied to other leg lengths: the toe
has the source's position, scaled by leg length; the ankle follows from the target's foot; the hip has the source's
position, scaled; the knee is found by the cosine rule in the plane of the source's knee.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidFile
from marey.data.rigs import CapturedRig
from marey.motion.filters import smooth
from marey.motion.io.bvh import BvhClip
from marey.motion.kinematics import global_rotations
from marey.motion.rotations import cross, normalize, rotate
from marey.motion.skeleton import HUMANML3D
from marey.motion.units import METRES, Unit
from marey.posing.bones import two_bones
from marey.posing.limbs import ARM_CHAINS, BONE_LENGTHS, FPS, LEG_CHAINS

Array = NDArray[np.floating]
_UP = np.array([0.0, 1.0, 0.0])
_REST: Array = HUMANML3D.offsets.astype(np.float64)
_KNEE_PRIOR = 0.03  # metres of "forward" added to the source's knee direction; matters only for a stretched leg
_SAME_WIDTH = 0.03  # metres; smaller differences in half the hip width are ignored
_SWAY = 0.25  # seconds


@dataclass(frozen=True)
class SourceMotion:
    """Points and directions of a rig in motion, at the rig's proportions.

    Attributes:
        joints: (T, 22, 3) metres in the order of `CapturedRig.points`.
        lateral: (T, 2, 3) unit vectors to the body's left, rigid with the left and the right foot.
        sole_pitch: degrees, see `CapturedRig.sole_pitch`.
        trunk: (T, 7, 3, 3) orientations of the joints of `CapturedRig.turning`, columns left, up, forward; identity
            in a body that stands upright and faces +Z.
    """

    joints: Array
    lateral: Array
    sole_pitch: float
    trunk: Array


def read_source(clip: BvhClip, rig: CapturedRig, *, where: str, unit: Unit = "cm") -> SourceMotion:
    """Read the rig's points from a clip, resampled to 20 fps.

    `marey.motion.io.bvh` has already removed a first frame in T-pose.

    Raises:
        InvalidFile: a joint of the rig is missing, or fewer than four frames are left.
    """
    names = {name: j for j, name in enumerate(clip.skeleton.joint_names)}
    missing = [name for name in rig.joint_names if name not in names]
    if missing:
        raise InvalidFile(f"no joint {missing[0]!r}: this is not the {rig.name} rig", where=where)
    if len(clip.rotations) < 4:
        raise InvalidFile(f"only {len(clip.rotations)} frames", where=where)
    world = global_rotations(clip.skeleton, clip.rotations)
    index = [names[name] for name in rig.joint_names]
    offsets = _offsets(clip, rig, index, where, METRES[unit])
    joints = clip.joints()[:, index] + rotate(world[:, index], offsets)
    feet = [names[leg[2].joint] for leg in (rig.left_leg, rig.right_leg)]
    flat, pitch = _flat_feet(clip, rig, index, offsets)
    lateral = rotate(world[:, feet], flat)
    left, up = np.array(rig.rest_left, np.float64), np.array(rig.rest_up, np.float64)
    turning = world[:, [names[name] for name in rig.turning]]
    axes = np.stack([rotate(turning, v) for v in normalize(np.stack([left, up]))], axis=-1)
    axes = resample_points(axes, clip.fps, FPS)
    return SourceMotion(
        resample_points(joints, clip.fps, FPS),
        normalize(resample_points(lateral, clip.fps, FPS)),
        pitch,
        _frame(axes[..., 1], axes[..., 0]),
    )


def _offsets(clip: BvhClip, rig: CapturedRig, index: list[int], where: str, unit: float) -> Array:
    """Offsets (22, 3) of the rig's points from their joints, metres."""
    out = np.zeros((len(index), 3))
    for k, (point, j) in enumerate(zip(rig.points, index, strict=True)):
        out[k] = np.array(point.offset) * unit
        if point.end:
            if np.isnan(clip.ends[j]).any():
                raise InvalidFile(f"{point.joint!r} has no End Site, which the {rig.name} rig needs", where=where)
            out[k] += clip.ends[j]
    return out


def _flat_feet(clip: BvhClip, rig: CapturedRig, index: list[int], offsets: Array) -> tuple[Array, float]:
    """Direction to the body's left in the frame of each ankle (2, 3), and the pitch of the foot bone in degrees, while
    the foot is flat: from the rig, or from the rest pose."""
    places = clip.skeleton.rest[index] + offsets
    up = np.array(rig.rest_up)
    bones = normalize(places[[9, 13]] - places[[8, 12]])
    left = normalize(cross(up, bones))
    for side, given in enumerate((rig.left_foot, rig.right_foot)):
        if given is not None:
            left[side] = given
    pitch = float(np.degrees(-np.arcsin(np.clip(bones @ up, -1, 1))).mean())
    return left, pitch if rig.sole_pitch is None else rig.sole_pitch


def resample_points(points: Array, fps: float, target: float) -> Array:
    """Resample points (T, ..., 3) to another frame rate by Catmull-Rom splines; integer ratios select frames unchanged.

    Linear interpolation of a punch has an error of 7 mm at 30 fps; the spline is third order. Retargeting restores the
    bone lengths.
    """
    count = int(np.floor((len(points) - 1) * target / fps + 1e-6)) + 1
    time = np.arange(count) * (fps / target)
    index = np.minimum(np.round(time, 6).astype(np.intp), len(points) - 1)
    t = (time - index).reshape(-1, *[1] * (points.ndim - 1))
    t[np.abs(t) < 1e-4] = 0.0
    last = len(points) - 1
    p0, p1, p2, p3 = (points[np.clip(index + k, 0, last)] for k in (-1, 0, 1, 2))
    a, b, c = 2 * p0 - 5 * p1 + 4 * p2 - p3, 3 * (p1 - p2) + p3 - p0, p2 - p0
    return p1 + 0.5 * t * (c + t * (a + t * b))


def retarget(source: SourceMotion, rig: CapturedRig, *, unit: Unit = "cm") -> Array:
    """Retarget to joints (T, 22, 3) of HumanML3D in metres, with exactly its bone lengths and the heights of the file,
    facing +Z over the origin in frame 0. `floor.on_floor` finds the floor."""
    s = source.joints
    pelvis, spine = s[:, 0], s[:, 1]
    legs, arms = (s[:, 6:10], s[:, 10:14]), (s[:, 14:18], s[:, 18:22])
    turned = rig.trunk == "rotations"
    scale = leg_scale(legs, source.sole_pitch, whole=turned)
    out = np.empty((len(s), 22, 3))
    hips = source.trunk[:, 0] if turned else _frame(spine - pelvis, legs[0][:, 0] - legs[1][:, 0])
    forward, back, up = _standing_axes(hips, legs, turned=turned)
    ankle_shift = _ankle_shift(legs, source.sole_pitch, scale)
    mid_hip = scale * (legs[0][:, 0] + legs[1][:, 0]) / 2
    mid_hip = mid_hip + ankle_shift[1] * up + ankle_shift[0] * back
    out[:, 0] = mid_hip - _turn(hips, (_REST[1] + _REST[2]) / 2)
    inwards = _narrower(legs, hips, scale)
    for target, leg, lateral in zip(LEG_CHAINS, legs, (0, 1), strict=True):
        hip, knee, ankle, toe = target
        out[:, hip] = out[:, 0] + _turn(hips, _REST[hip])
        out[:, toe] = scale * leg[:, 3] + inwards * (2 * lateral - 1)
        out[:, ankle] = out[:, toe] - _turn(_sole(leg, source.lateral[:, lateral], source.sole_pitch), _REST[toe])
        out[:, knee], reached = two_bones(
            out[:, hip], out[:, ankle], _knee_pole(leg, forward), (BONE_LENGTHS[knee], BONE_LENGTHS[ankle])
        )
        out[:, toe] += reached - out[:, ankle]
        out[:, ankle] = reached
    out[..., 1] -= scale * METRES[unit] * rig.toe_height
    if turned:
        _turn_trunk(out, source.trunk)
    else:
        _point_trunk(out, s)
    for target, arm in zip(ARM_CHAINS, arms, strict=True):
        for k in range(1, 3) if turned else range(3):
            bone = normalize(arm[:, k + 1] - arm[:, k])
            out[:, target[k + 1]] = out[:, target[k]] + BONE_LENGTHS[target[k + 1]] * bone
    return canonical(out)


def leg_scale(legs: tuple[Array, Array], sole_pitch: float, *, whole: bool) -> float:
    """Ratio of the target's leg length to the source's, from hip to ankle; `whole`: from hip to the toe of a flat foot,
    because the feet of some bodies are a third of the leg."""
    lengths = np.mean([_bone(leg, 0, 1) + _bone(leg, 1, 2) for leg in legs])
    if not whole:
        return float((BONE_LENGTHS[4] + BONE_LENGTHS[7]) / lengths)
    drop = np.mean([_bone(leg, 2, 3) for leg in legs]) * np.sin(np.radians(sole_pitch))
    return float((BONE_LENGTHS[4] + BONE_LENGTHS[7] - _REST[10, 1]) / (lengths + drop))


def _standing_axes(hips: Array, legs: tuple[Array, Array], *, turned: bool) -> tuple[Array, Array, Array]:
    """Forward for the knees, forward for the shift of the hips, and up, (T, 3) each: axes of the body if its
    orientation is known, which matters for a lying body; otherwise of the floor."""
    if turned:
        return hips[..., 2], hips[..., 2], hips[..., 1]
    across = legs[0][:, 0] - legs[1][:, 0]
    forward = normalize(cross(across, np.broadcast_to(_UP, across.shape)))
    return forward, forward, np.broadcast_to(_UP, across.shape)


def _narrower(legs: tuple[Array, Array], hips: Array, scale: float) -> Array:
    """Shift (T, 3) of the right foot to the left for hips narrower than the source's; the left foot moves by its
    negative. Without it, bodies with short legs stand with their legs apart. The shift is smoothed, so that standing
    feet do not slide with every sway, and zero if the hip widths are nearly equal."""
    wider = scale * float(np.linalg.norm(legs[0][:, 0] - legs[1][:, 0], axis=-1).mean()) / 2 - _REST[1, 0]
    if abs(wider) < _SAME_WIDTH:
        return np.zeros((len(hips), 3))
    return wider * normalize(smooth(hips[..., 0], _SWAY * FPS))


def _turn_trunk(out: Array, trunk: Array) -> None:
    """Place trunk and shoulders by the rotations of the source's joints."""
    parts = {3: 0, 6: 1, 9: 2, 12: 3, 13: 3, 14: 3, 15: 4, 16: 5, 17: 6}  # joint: rotation of its bone
    for joint, turn in parts.items():
        out[:, joint] = out[:, HUMANML3D.parents[joint]] + _turn(trunk[:, turn], _REST[joint])


def _point_trunk(out: Array, s: Array) -> None:
    """Place trunk and clavicles by the positions of the source's joints."""
    pelvis, spine, middle, chest, neck, head = (s[:, j] for j in range(6))
    shoulders = s[:, 14] - s[:, 18]
    hips = _frame(spine - pelvis, s[:, 6] - s[:, 10])
    ribs = _frame(neck - chest, shoulders)
    out[:, 3] = out[:, 0] + _turn(hips, _REST[3])
    low = normalize(normalize(spine - pelvis) + normalize(chest - middle))
    out[:, 6] = out[:, 3] + BONE_LENGTHS[6] * low
    out[:, 9] = out[:, 6] + BONE_LENGTHS[9] * normalize(normalize(chest - middle) + normalize(neck - chest))
    out[:, 12] = out[:, 9] + _turn(ribs, _REST[12])
    out[:, 15] = out[:, 12] + _turn(_frame(head - neck, shoulders), _REST[15])
    for collar in (13, 14):
        out[:, collar] = out[:, 9] + _turn(ribs, _REST[collar])


def _bone(limb: Array, a: int, b: int) -> float:
    return float(np.linalg.norm(limb[:, b] - limb[:, a], axis=-1).mean())


def _frame(up: Array, left: Array) -> Array:
    """Rotation matrices (T, 3, 3) with columns left, up, forward; `up` is kept, `left` is made perpendicular to it."""
    y = normalize(up)
    z = normalize(cross(left, y))
    return np.stack([cross(y, z), y, z], axis=-1)


def _turn(frames: Array, vector: Array) -> Array:
    return frames @ vector


def _sole(leg: Array, lateral: Array, sole_pitch: float) -> Array:
    """Rotation matrices (T, 3, 3) of a foot: only its heading while the sole is flat on the floor."""
    bone = normalize(leg[:, 3] - leg[:, 2])
    x = normalize(lateral - bone * np.einsum("ti,ti->t", lateral, bone)[:, None])
    up = cross(bone, x)  # perpendicular to the bone, in the foot's plane
    pitch = np.radians(sole_pitch)
    z = np.cos(pitch) * bone + np.sin(pitch) * up
    return np.stack([x, cross(z, x), z], axis=-1)


def _ankle_shift(legs: tuple[Array, Array], sole_pitch: float, scale: float) -> tuple[float, float]:
    """Difference in ankle position relative to a flat toe between target and source, forward and up, metres; the hips
    are shifted by it."""
    bone = scale * np.mean([_bone(leg, 2, 3) for leg in legs])
    pitch = np.radians(sole_pitch)
    return float(bone * np.cos(pitch) - _REST[10, 2]), float(-_REST[10, 1] - bone * np.sin(pitch))


def _knee_pole(leg: Array, forward: Array) -> Array:
    """Direction (T, 3) from the line between hip and ankle to the source's knee, with a little forward added."""
    axis = normalize(leg[:, 2] - leg[:, 0])
    bend = leg[:, 1] - leg[:, 0]
    return bend - axis * np.einsum("ti,ti->t", bend, axis)[:, None] + _KNEE_PRIOR * forward


def canonical(joints: Array) -> Array:
    """Rotate and move a motion (T, 22, 3) to face +Z over the origin in frame 0; heights are kept."""
    across = joints[0, 1] - joints[0, 2] + joints[0, 16] - joints[0, 17]
    forward = np.cross(across, _UP)
    heading = np.arctan2(forward[0], forward[2])
    c, s = np.cos(heading), np.sin(heading)
    turn = np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    return (joints - joints[0, 0] * np.array([1.0, 0.0, 1.0])) @ turn.T
