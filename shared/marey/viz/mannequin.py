"""The drawn body as a mesh: the round cones of `body.py`, each fixed to one joint."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from marey.motion.clip import MotionClip
from marey.motion.io.mesh import Mesh
from marey.motion.rotations import Array, cross, normalize
from marey.viz.body import LimbShape, dress_clip

SIDES, RINGS = 14, 5
"""Points around a limb, and rings of them over each of its round ends."""


def mannequin(clip: MotionClip) -> Mesh:
    """Return the body of a clip's skeleton.

    A limb goes with the joint that it begins at: bones have constant lengths, so its end stays at the next joint.
    """
    limbs = dress_clip(clip).limbs
    shapes = [_round_cone(limb, np.asarray(clip.offsets, np.float64)) for limb in limbs]
    normals, points = (np.concatenate(parts) for parts in zip(*shapes, strict=True))
    size = 2 * RINGS * SIDES
    one = _triangles()
    return Mesh(
        points=points,
        normals=normals,
        joints=np.repeat([limb.start for limb in limbs], size),
        triangles=np.concatenate([one + size * number for number in range(len(limbs))]),
    )


def _round_cone(limb: LimbShape, offsets: Array) -> tuple[Array, Array]:
    """Return normals and points (2 RINGS SIDES, 3) of a limb from its first joint, in the rest pose: rings around its
    axis, from the far side of its first ball to that of its second one."""
    begin = np.array(limb.start_offset)
    end = np.array(limb.end_offset) + (offsets[limb.end] if limb.end != limb.start else 0)
    way = end - begin
    length = float(np.linalg.norm(way))
    axis = way / length if length > 0 else np.array([0.0, 1.0, 0.0])
    # Where the cone touches both balls, its normal has this share along the axis.
    touch = math.acos(min(max((limb.start_radius - limb.end_radius) / max(length, 1e-9), -1.0), 1.0))
    polar: Array = np.append(np.linspace(math.pi, touch, RINGS), np.linspace(touch, 0, RINGS))[:, None, None]
    turn = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)[:, None]
    side = normalize(cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
    around = np.cos(turn) * side + np.sin(turn) * cross(axis, side)  # (SIDES, 3)
    normals = np.cos(polar) * axis + np.sin(polar) * around
    first = np.arange(2 * RINGS)[:, None, None] < RINGS
    points = np.where(first, begin, end) + np.where(first, limb.start_radius, limb.end_radius) * normals
    return normals.reshape(-1, 3), points.reshape(-1, 3)


def _triangles() -> NDArray[np.intp]:
    """Return the triangles (F, 3) between the rings of one limb."""
    ring, side = np.meshgrid(np.arange(2 * RINGS - 1), np.arange(SIDES), indexing="ij")
    here, beside = ring * SIDES + side, ring * SIDES + (side + 1) % SIDES
    above, across = here + SIDES, beside + SIDES
    return np.stack([here, beside, across, here, across, above], axis=-1).reshape(-1, 3)
