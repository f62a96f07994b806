"""Reference skeletons: the hierarchy, joint axes and rest pose of common rigs, with proportions of our own.

A motion on them can be put straight on characters of that kind: names, axes and rest pose are theirs. `mixamo` follows
the rigs that Mixamo makes (T-pose, Y along the bone), `ue4` the mannequin of Unreal Engine 4 (A-pose, X along the bone
on the left and against it on the right, Z up in centimetres, twist and `ik_*` joints), `humanik` the skeletons of
MotionBuilder (T-pose, all axes along the world's, roll joints). The body is an adult of 1.73 m.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from marey.motion.retarget.reference_tables import HUMANIK, MIXAMO, UE4
from marey.motion.rigs.rig import Rig
from marey.motion.rotations import Array, from_matrix, normalize
from marey.motion.units import Up


@dataclass(frozen=True)
class ReferenceJoint:
    """A joint of a table.

    Attributes:
        name, parent: as in the rig; the parent of the root is `-`.
        place: metres in the rest pose.
        bone: direction that its axes follow.
    """

    name: str
    parent: str
    place: Array
    bone: Array


Axes = Callable[[ReferenceJoint], Array]
"""Gives the axes (3, 3) of a joint in the rest pose, as columns in the world."""


def mixamo_axes(joint: ReferenceJoint) -> Array:
    """Y along the bone; Z down in arms, up in feet, else forward."""
    if abs(joint.bone[0]) > 0.5:
        return _square(1, joint.bone, 2, (0.0, -1.0, 0.0))
    return _square(1, joint.bone, 2, (0.0, 1.0, 0.0) if joint.bone[2] > 0.5 else (0.0, 0.0, 1.0))


def ue4_axes(joint: ReferenceJoint) -> Array:
    """X along the bone on the left and in the trunk; axes of the right side are the mirrored ones turned round.

    Z is right in the trunk, up in arms, forward in hands, left in legs, whose X is against the bone.
    """
    if joint.name == "root" or joint.name.endswith("_root"):
        return _square(2, (0.0, 1.0, 0.0), 0, (1.0, 0.0, 0.0))
    if abs(joint.place[0]) < 1e-6:
        return _square(0, joint.bone, 2, (-1.0, 0.0, 0.0))
    if joint.place[0] < 0:
        mirror = np.array([-1.0, 1.0, 1.0])
        left = ue4_axes(ReferenceJoint(joint.name, joint.parent, joint.place * mirror, joint.bone * mirror))
        return -mirror[:, None] * left
    if joint.name.startswith(("thigh", "calf", "foot", "ball", "ik_foot")):
        return _square(0, -joint.bone, 2, (1.0, 0.0, 0.0))
    palm = not joint.name.startswith(("clavicle", "upperarm", "lowerarm"))
    return _square(0, joint.bone, 2, (0.0, 0.0, 1.0) if palm else (0.0, 1.0, 0.0))


def world_axes(joint: ReferenceJoint) -> Array:
    """All axes along the world's."""
    return np.eye(3)


REFERENCES: dict[str, tuple[str, Axes, Up]] = {
    "mixamo": (MIXAMO, mixamo_axes, "y"),
    "ue4": (UE4, ue4_axes, "z"),
    "humanik": (HUMANIK, world_axes, "y"),
}
"""Table, joint axes and upward axis of each reference skeleton."""
UNIT = 0.01
"""Metres of the unit of their files: centimetres."""


@cache
def reference_rig(name: str) -> Rig:
    """Return a reference skeleton by its name in `REFERENCES`."""
    table, axes, up = REFERENCES[name]
    joints = read_table(table)
    names = tuple(joint.name for joint in joints)
    canonical = json.dumps([name, table, up], separators=(",", ":"))
    return Rig(
        name=name,
        joint_names=names,
        parents=tuple(names.index(joint.parent) if joint.parent != "-" else -1 for joint in joints),
        positions=np.array([joint.place for joint in joints]),
        orientations=from_matrix(np.stack([axes(joint) for joint in joints])),
        scales=np.full(len(names), UNIT),
        bones=(True,) * len(names),
        tips=np.full((len(names), 3), np.nan),
        unit=UNIT,
        up=up,
        sha256=hashlib.sha256(canonical.encode()).hexdigest(),
    )


def read_table(table: str) -> list[ReferenceJoint]:
    """Return the joints of a table, the right side of a limb after the left one."""
    rows = _both_sides([line.split() for line in table.strip().splitlines()])
    places: dict[str, Array] = {}
    bones: dict[str, Array] = {}
    for name, _, first, *rest in rows:
        copied = first.removeprefix("=")
        places[name] = places[copied] if first != copied else np.array([float(each) for each in (first, *rest[:2])])
        if rest[2:]:
            bones[name] = np.array([float(each) for each in rest[2:]])
    for name, parent, first, *_ in rows:  # the bone to the first child; of an end, the parent's
        if first.startswith("="):
            bones[name] = bones[first[1:]]
        below = next((child for child, over, *_ in rows if over == name and "twist" not in child), None)
        if name not in bones:
            bones[name] = bones[parent] if below is None else places[below] - places[name]
    return [ReferenceJoint(name, parent, places[name], normalize(bones[name])) for name, parent, *_ in rows]


def _both_sides(rows: list[list[str]]) -> list[list[str]]:
    found: list[list[str]] = []
    waiting: list[list[str]] = []
    for row in rows:
        if waiting and "<" not in row[1]:
            found, waiting = found + waiting, []
        found.append([re.sub(r"<(\w+)>", r"\1", each) for each in row])
        if "<" in row[0]:
            waiting.append([_right(each, column) for column, each in enumerate(row)])
    return found + waiting


def _right(word: str, column: int) -> str:
    """Return a word of a row for the right side; X of the place and of the bone changes its sign."""
    if column in (2, 5) and not word.startswith("="):
        return str(-float(word))
    return word.replace("<Left>", "Right").replace("<l>", "r")


def _square(first: int, along: ArrayLike, second: int, near: ArrayLike) -> Array:
    """Return axes (3, 3) as columns: axis `first` along a direction, axis `second` as near to another as it can be."""
    axes = np.zeros((3, 3))
    axes[:, first] = normalize(np.asarray(along, np.float64))
    near = np.asarray(near, np.float64)
    axes[:, second] = normalize(near - axes[:, first] * (near @ axes[:, first]))
    third = 3 - first - second
    axes[:, third] = np.cross(axes[:, (third + 1) % 3], axes[:, (third + 2) % 3])
    return axes
