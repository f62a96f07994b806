"""Read the rig of a binary FBX file, versions 7.1 to 7.7.

The rest pose is the bind pose; the pose of the nodes where the file states none, and for nodes that are not in it.
"""

from __future__ import annotations

import hashlib
from pathlib import PurePath

import numpy as np

from marey.motion.io.fbx_scene import Scene, read_scene
from marey.motion.io.fbx_skeleton import bones_of, skeleton_order
from marey.motion.io.fbx_transforms import world_transforms
from marey.motion.rigs.make_rig import RigNode, make_rig
from marey.motion.rigs.rig import Rig
from marey.motion.rotations import Z_TO_Y, to_matrix
from marey.motion.units import Up


def parse_fbx_rig(data: bytes, where: str = "fbx") -> Rig:
    """Read the rig of an FBX file.

    Raises:
        InvalidFile: ASCII, another version, broken, without a skeleton, or left-handed.
        TooLarge: over 2,000 joints, or more nodes than any rig has.
    """
    scene = read_scene(data, where)
    bones = bones_of(scene)
    order = skeleton_order(scene, bones)
    world = world_transforms(scene, order, {}, bind=True)
    turn, up, notes = _axes(scene)
    place = {key: index for index, key in enumerate(order)}
    nodes: list[RigNode] = []
    for key in order:
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn @ world.linear[key], turn @ world.places[key]
        parent = place.get(scene.parents.get(key, 0), -1)
        nodes.append(RigNode(scene.models[key].name or f"node{place[key]}", parent, matrix, key in bones))
    return make_rig(
        nodes,
        name=PurePath(where).name,
        where=where,
        unit=scene.unit,
        up=up,
        source="fbx",
        sha256=hashlib.sha256(data).hexdigest(),
        notes=notes,
    )


def _axes(scene: Scene) -> tuple[np.ndarray, Up, tuple[str, ...]]:
    """Return the rotation (3, 3) to a system that a rig can name, the axis that then points up, and a note."""
    turn = scene.axes()
    if np.allclose(turn, np.eye(3)):
        return np.eye(3), "y", ()
    if np.allclose(turn, to_matrix(Z_TO_Y)):
        return np.eye(3), "z", ()
    return turn, "y", ("the file has unusual axes; its rig is turned to Y up",)
