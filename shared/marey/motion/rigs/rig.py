"""A rig: the joints of a character with its rest pose, as a file states them.

A rig differs from a `Skeleton` in what a character brings along: joint axes that point anywhere, an A-pose, nodes
above the hips, lengths in the unit of its file. Readers return it (`read.py`), `marey.motion.retarget` poses it, and
exporters write the same hierarchy back (`RiggedMotion`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from marey.motion.rotations import Z_TO_Y, Array, conjugate, multiply, rotate
from marey.motion.units import Up

MAX_JOINTS = 2000
MAX_BYTES = 64 * 2**20
"""Limits of a rig file; a rig with face, fingers and helpers has about 300 joints."""


@dataclass(frozen=True, eq=False)
class Rig:
    """The joints of a character with its rest pose, in metres and Y up.

    `positions` and `orientations` are of the world: turned from the file's axes to Y up (a rotation from the left), and
    from its unit to metres. Joint axes are the file's own, whatever they are. How the rest pose faces is left open.

    Attributes:
        name: short name, for messages: the file's name.
        joint_names: one a joint, unique.
        parents: index of the parent, -1 for a root; parents come before children, and joint 0 is a root.
        positions: (J, 3) float64 rest pose, metres, Y up.
        orientations: (J, 4) float64 unit quaternions `w x y z` of the joints in the rest pose, in the world.
        scales: (J,) metres of one unit in a joint's own space: what a child's local translation is multiplied by. It is
            `unit` where no node scales, and 0.01 under an `Armature` of scale 0.01 in a glb.
        tips: (J, 3) the end of a bone without a child, from its joint in its axes, metres; NaN where the file
            states none (End Sites of BVH).
        bones: (J,) bool, False for plain nodes of the hierarchy, such as `Armature`, which no skin is bound to.
        unit: metres of one unit of the file (glb: 1, most FBX files: 0.01).
        up: the axis of the file that points up.
        source: format of the file, `glb` for instance; `marey` for a reference skeleton.
        sha256: of the file's bytes, in hexadecimal; of its canonical JSON for a reference skeleton.
        extras: what a writer of that format needs to write the same hierarchy back, JSON by nature.
        notes: oddities of the file, as sentences.
    """

    name: str
    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    positions: Array = field(repr=False)
    orientations: Array = field(repr=False)
    scales: Array = field(repr=False)
    bones: tuple[bool, ...] = field(repr=False)
    tips: Array = field(repr=False)
    unit: float = 1.0
    up: Up = "y"
    source: str = "marey"
    sha256: str = field(default="", repr=False)
    extras: Mapping[str, Any] = field(default_factory=dict[str, Any], repr=False)
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.joint_names)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Child indices of each joint."""
        below: list[list[int]] = [[] for _ in self.joint_names]
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                below[parent].append(joint)
        return tuple(tuple(joints) for joints in below)

    @cached_property
    def offsets(self) -> Array:
        """(J, 3) metres: the rest position from the parent in the parent's axes; of roots, from the origin, in the
        axes of the world."""
        turn, place = self._above(self.orientations, self.positions)
        return rotate(conjugate(turn), self.positions - place)

    @cached_property
    def local_rotations(self) -> Array:
        """(J, 4) rest rotations from the parent; of roots, in the world."""
        return multiply(conjugate(self._above(self.orientations, self.positions)[0]), self.orientations)

    @cached_property
    def parent_scales(self) -> Array:
        """(J,) metres of one unit of a joint's local translation: the parent's scale, and the file's unit for roots."""
        parents = np.array(self.parents)
        return np.where(parents < 0, self.unit, self.scales[np.maximum(parents, 0)])

    def index(self, name: str) -> int:
        """Return the index of a joint by name."""
        return self.joint_names.index(name)

    def in_file(self, rotations: Array, translations: Array) -> tuple[Array, Array]:
        """Convert local poses to the unit and axes of the file: the numbers that a writer writes.

        Args:
            rotations: (..., J, 4) from the parent; of roots, in the world.
            translations: (..., J, 3) metres, from the parent in its axes; of roots, in the world.

        Returns:
            Rotations (..., J, 4) and translations (..., J, 3); only those of roots change their axes.
        """
        translations = translations / self.parent_scales[:, None]
        if self.up == "z":
            roots = [joint for joint, parent in enumerate(self.parents) if parent < 0]
            rotations, back = rotations.copy(), conjugate(Z_TO_Y)
            rotations[..., roots, :] = multiply(back, rotations[..., roots, :])
            translations[..., roots, :] = rotate(back, translations[..., roots, :])
        return rotations, translations

    def _above(self, turns: Array, places: Array) -> tuple[Array, Array]:
        """Return orientation (J, 4) and position (J, 3) of each joint's parent; the world's own for roots."""
        parents = np.array(self.parents)
        inner = (parents >= 0)[:, None]
        above = np.maximum(parents, 0)
        return np.where(inner, turns[above], np.array([1.0, 0.0, 0.0, 0.0])), np.where(inner, places[above], 0.0)
