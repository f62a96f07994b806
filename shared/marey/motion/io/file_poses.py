"""Joints and their motion in the unit and axes of a file that states both: what FBX and USD files hold."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from marey.motion.arrange import Arranged
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import IDENTITY, Z_TO_Y, Array, conjugate, multiply, rotate, to_matrix
from marey.motion.units import METRES, Unit, Up

CENTIMETRE = 0.01


@dataclass(frozen=True, eq=False)
class FilePoses:
    """Joints and their motion in the unit and axes of a file.

    Attributes:
        names: of the joints.
        parents: index of the parent, -1 for a root; parents come before children.
        places: (J, 3) rest position from the parent.
        turns: (J, 4) rest rotation from the parent.
        rotations: (T, J, 4) rotations from the parent.
        moving: positions (T, 3) from the parent, of the joints that have position curves.
        fps: frames a second.
        unit: metres of one unit of the file.
        up: the axis of the file that points up.
        limbs: (J,) False for plain nodes of a hierarchy, such as `Armature`; None = all are joints.
        scales: (J,) scale of each node; None = 1.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    places: Array = field(repr=False)
    turns: Array = field(repr=False)
    rotations: Array = field(repr=False)
    moving: dict[int, Array] = field(repr=False)
    fps: float
    unit: float = 0.01
    up: Up = "y"
    limbs: tuple[bool, ...] | None = field(default=None, repr=False)
    scales: Array | None = field(default=None, repr=False)

    def bind_matrices(self) -> Array:
        """Return the matrices (J, 4, 4) from each joint to the world in the rest pose; columns are the axes."""
        scales = np.ones(len(self.names)) if self.scales is None else self.scales
        local = np.tile(np.eye(4), (len(self.names), 1, 1))
        local[:, :3, :3] = to_matrix(self.turns) * scales[:, None, None]
        local[:, :3, 3] = self.places
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                local[joint] = local[parent] @ local[joint]
        return local


def poses_of(posed: Arranged, unit: Unit, up: Up) -> FilePoses:
    """Return poses in the unit and axes of a file; with another axis, every joint's own axes turn with the world."""
    tree, scale = posed.skeleton, 1 / METRES[unit]
    places, moving = tree.offsets.astype(np.float64) * scale, posed.positions * scale
    rotations = posed.rotations
    if up == "z":
        back = conjugate(Z_TO_Y)
        places, moving = rotate(back, places), rotate(back, moving)
        rotations = multiply(multiply(back, rotations), Z_TO_Y)
    return FilePoses(
        names=tree.joint_names,
        parents=tree.parents,
        places=places,
        turns=np.tile(IDENTITY, (len(tree), 1)),
        rotations=rotations,
        moving={joint: moving[:, joint] for joint in range(moving.shape[1])},
        fps=posed.fps,
        unit=METRES[unit],
        up=up,
    )


def rigged_poses(motion: RiggedMotion, source: str) -> FilePoses:
    """Return a motion on a rig as a file of the format `source` holds it.

    A rig of such a file keeps its unit, its upward axis and the scales of its nodes. Rigs of other formats are written
    in centimetres, Y up, without scales: their joints keep names, axes and places.
    """
    rig, joints = motion.rig, np.flatnonzero(motion.moving).tolist()
    if rig.source == source:
        turns, places = rig.in_file(rig.local_rotations, rig.offsets)
        rotations, translations = rig.in_file(motion.rotations, motion.translations)
        unit, up, scales = rig.unit, rig.up, rig.scales / rig.parent_scales
    else:
        turns, rotations = rig.local_rotations, motion.rotations
        places, translations = rig.offsets / CENTIMETRE, motion.translations / CENTIMETRE
        unit, up, scales = CENTIMETRE, "y", None
    moving = {joint: translations[:, joint] for joint in joints}
    return FilePoses(
        rig.joint_names, rig.parents, places, turns, rotations, moving, motion.fps, unit, up, rig.bones, scales
    )
