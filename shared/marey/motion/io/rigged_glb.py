"""Write a motion on a rig as glb: the rig's own nodes, rest pose and joint axes, in metres, Y up."""

from __future__ import annotations

from typing import Any

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.export_options import PLAIN, ExportOptions
from marey.motion.io.glb_write import (
    FEET,
    GENERATOR,
    Numbers,
    animation_with,
    chosen_options,
    floats,
    pack,
    plain,
    spans,
)
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import Array, to_matrix, unroll

SAME = 1e-6
"""Change of a rotation up to which a joint keeps its rest pose and gets no track."""


def format_rigged_glb(motion: RiggedMotion, *, options: ExportOptions = PLAIN) -> bytes:
    """Return the bytes of the glb file; equal motions give equal bytes.

    Nodes have the scales of the rig's file, so that the numbers of the tracks are those of the character's own nodes.

    Args:
        options: of the export; they are in the motion, and named in the file.

    Raises:
        InvalidInput: numbers that are not finite.
    """
    if not (np.isfinite(motion.rotations).all() and np.isfinite(motion.translations).all()):
        raise InvalidInput("the motion holds NaN or infinite numbers", where=motion.rig.name)
    rig, numbers = motion.rig, Numbers()
    joints = [joint for joint in range(len(rig)) if rig.bones[joint]]
    matrices = numbers.add("MAT4", _inverse_bind(rig)[joints].swapaxes(1, 2))
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": GENERATOR, "extras": _extras(motion, options)},
        "scene": 0,
        "scenes": [{"nodes": [joint for joint, parent in enumerate(rig.parents) if parent < 0]}],
        "nodes": _nodes(rig),
        "skins": [{"inverseBindMatrices": matrices, "joints": joints}],
        "animations": [_animation(motion, numbers)],
        "accessors": numbers.accessors,
        "bufferViews": numbers.views,
        "buffers": [{"byteLength": len(numbers.data)}],
    }
    return pack(document, numbers)


def _units(rig: Rig) -> Array:
    """Return the metres (J,) of one unit of each node's translation in the file."""
    return rig.parent_scales / rig.unit


def _nodes(rig: Rig) -> list[dict[str, Any]]:
    units = _units(rig)
    scales = rig.scales / rig.unit / units
    nodes: list[dict[str, Any]] = []
    for joint, name in enumerate(rig.joint_names):
        node: dict[str, Any] = {
            "name": name,
            "translation": floats(rig.offsets[joint] / units[joint]),
            "rotation": floats(rig.local_rotations[joint][[1, 2, 3, 0]].clip(-1, 1)),  # rounding passes 1 by a bit
        }
        if abs(scales[joint] - 1) > SAME:
            node["scale"] = [float(scales[joint])] * 3
        if rig.children[joint]:
            node["children"] = list(rig.children[joint])
        nodes.append(node)
    return nodes


def _inverse_bind(rig: Rig) -> Array:
    """Return the matrices (J, 4, 4) from the world to each joint in the rest pose (3.7.3.1)."""
    matrices = np.tile(np.eye(4), (len(rig), 1, 1))
    matrices[:, :3, :3] = to_matrix(rig.orientations) * (rig.scales / rig.unit)[:, None, None]
    matrices[:, :3, 3] = rig.positions
    inverse = np.linalg.inv(matrices)
    inverse[:, 3] = [0.0, 0.0, 0.0, 1.0]
    return inverse


def _animation(motion: RiggedMotion, numbers: Numbers) -> dict[str, Any]:
    """Return the animation: rotations of the joints that turn, positions of those that move (3.11)."""
    rig, units = motion.rig, _units(motion.rig)
    times = np.arange(motion.frames) / motion.fps
    ends = times.astype(np.float32)[[0, -1], None].tolist()
    time = numbers.add("SCALAR", times, min=ends[0], max=ends[1])
    turns = unroll(motion.rotations)
    apart = np.abs(np.abs(np.einsum("tji,ji->tj", turns, rig.local_rotations)) - 1).max(axis=0)
    tracks = [
        (joint, "rotation", "VEC4", turns[:, joint][:, [1, 2, 3, 0]])
        for joint in range(len(rig))
        if apart[joint] > SAME**2
    ]
    tracks += [
        (joint, "translation", "VEC3", motion.translations[:, joint] / units[joint])
        for joint in np.flatnonzero(motion.moving).tolist()
    ]
    return animation_with(tracks, time, numbers)


def _extras(motion: RiggedMotion, options: ExportOptions) -> dict[str, Any]:
    stands = dict(zip(FEET, motion.contacts.T, strict=True))
    return {
        "fps": float(motion.fps),
        "contacts": {foot: spans(column, 0) for foot, column in stands.items()},
        "options": chosen_options(options),
        **motion.removed,
        "rigged": {"hips": motion.hips},
        "manifest": plain(motion.manifest),
    }
