"""Skeletons as data.

A skeleton is a tree of joints with a rest pose: the T-pose, facing +Z, Y up, arms along X (the left hand at +X), feet
forward, in metres. All local rotations zero give exactly that pose.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput

Float32 = NDArray[np.float32]

OTHER_FOOT = [2, 3, 0, 1]
"""Columns of contacts (T, 4) and indices of `Skeleton.feet` with left and right exchanged."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints with its T-pose.

    Attributes:
        name: short name, `humanml3d` for instance.
        joint_names: one a joint, unique.
        parents: index of the parent, -1 for the root; parents come before children.
        offsets: (J, 3) T-pose, metres, from the parent; the root's own is its position over the floor.
        mirror: joint index of the other side (itself on the midline).
        feet: L ankle, L toe, R ankle, R toe; empty if unknown.
        facing: r_hip, l_hip, r_shoulder, l_shoulder; empty if unknown.
    """

    name: str
    joint_names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: Float32 = field(repr=False)
    mirror: tuple[int, ...] = field(repr=False)
    feet: tuple[int, ...] = field(default=(), repr=False)
    facing: tuple[int, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        count = len(self.joint_names)
        if not count or len(self.parents) != count or len(self.mirror) != count:
            raise InvalidInput("names, parents and mirror of a skeleton must have one entry per joint", where=self.name)
        if self.offsets.shape != (count, 3):
            raise InvalidInput(f"offsets have shape {self.offsets.shape}, not ({count}, 3)", where=self.name)
        if self.parents[0] != -1 or any(not 0 <= p < j for j, p in enumerate(self.parents) if j):
            raise InvalidInput("joint 0 is the root and parents come before children", where=self.name)
        if len(set(self.joint_names)) != count:
            raise InvalidInput("two joints have the same name", where=self.name)

    def __len__(self) -> int:
        return len(self.joint_names)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Child indices of each joint."""
        return tuple(tuple(c for c, p in enumerate(self.parents) if p == j) for j in range(len(self)))

    @cached_property
    def levels(self) -> tuple[NDArray[np.intp], ...]:
        """Joint indices by depth, the root's level first: a level can be computed at once."""
        depth = [0] * len(self)
        for j, p in enumerate(self.parents[1:], start=1):
            depth[j] = depth[p] + 1
        return tuple(np.array([j for j in range(len(self)) if depth[j] == d], np.intp) for d in range(max(depth) + 1))

    @cached_property
    def rest(self) -> Float32:
        """(J, 3) joint positions of the T-pose, the root at its own offset."""
        rest = self.offsets.copy()
        for j, p in enumerate(self.parents[1:], start=1):
            rest[j] += rest[p]
        return rest

    def with_offsets(self, offsets: NDArray[np.floating]) -> Skeleton:
        """Return the same tree with other offsets (J, 3), metres."""
        return replace(self, offsets=np.asarray(offsets, np.float32))

    def index(self, name: str) -> int:
        """Return the index of a joint by name."""
        return self.joint_names.index(name)


def distinct_names(names: Iterable[str]) -> tuple[str, ...]:
    """Return names that are all different: the second `a` is `a.2`, or `a.3` if that is the name of another joint."""
    given = list(names)
    taken = set(given)
    found: list[str] = []
    seen: set[str] = set()
    for name in given:
        own, number = name, 1
        while own in seen or (number > 1 and own in taken):
            number += 1
            own = f"{name}.{number}"
        seen.add(own)
        found.append(own)
    return tuple(found)


def _sided(
    name: str,
    rows: str,
    *,
    scale: float = 1.0,
    left: str,
    right: str,
    feet: tuple[str, str, str, str],
    facing: tuple[str, str, str, str],
) -> Skeleton:
    """Parse a skeleton from lines of `joint parent x y z`; right joints repeat the left ones with x mirrored (`=`)."""
    names: list[str] = []
    parents: list[int] = []
    offsets: dict[str, list[float]] = {}
    table = [row.split() for row in rows.strip().splitlines()]
    for joint, parent, *numbers in table:
        names.append(joint)
        parents.append(names.index(parent) if parent != "-" else -1)
        if numbers != ["="]:
            offsets[joint] = [float(n) * scale for n in numbers]
    for joint, _, *numbers in table:
        if numbers == ["="]:
            x, y, z = offsets[left + joint.removeprefix(right)]
            offsets[joint] = [-x, y, z]

    def other(joint: str) -> int:
        if joint.startswith(left):
            return names.index(right + joint.removeprefix(left))
        if joint.startswith(right):
            return names.index(left + joint.removeprefix(right))
        return names.index(joint)

    return Skeleton(
        name=name,
        joint_names=tuple(names),
        parents=tuple(parents),
        offsets=np.array([offsets[n] for n in names], np.float32),
        mirror=tuple(other(n) for n in names),
        feet=tuple(names.index(n) for n in feet),
        facing=tuple(names.index(n) for n in facing),
    )


# Joint order of HumanML3D (Guo et al. 2022), which is SMPL's. Proportions: an adult of 1.73 m, the root at 0.94 m,
# which is the mean root height of the data set (0.9386).
HUMANML3D = _sided(
    "humanml3d",
    """
    pelvis      -           0       0.940   0
    L_hip       pelvis      0.080  -0.080   0
    R_hip       pelvis      =
    spine1      pelvis      0       0.115   0
    L_knee      L_hip       0      -0.390   0
    R_knee      R_hip       =
    spine2      spine1      0       0.135   0
    L_ankle     L_knee      0      -0.410   0
    R_ankle     R_knee      =
    spine3      spine2      0       0.055   0
    L_foot      L_ankle     0      -0.060   0.130
    R_foot      R_ankle     =
    neck        spine3      0       0.215   0
    L_collar    spine3      0.075   0.130   0
    R_collar    spine3      =
    head        neck        0       0.095   0.025
    L_shoulder  L_collar    0.105   0.030   0
    R_shoulder  R_collar    =
    L_elbow     L_shoulder  0.270   0       0
    R_elbow     R_shoulder  =
    L_wrist     L_elbow     0.250   0       0
    R_wrist     R_elbow     =
    """,
    left="L_",
    right="R_",
    feet=("L_ankle", "L_foot", "R_ankle", "R_foot"),
    facing=("R_hip", "L_hip", "R_shoulder", "L_shoulder"),
)

# Joint order of KIT-ML in HumanML3D's processing; names of the Master Motor Map. Joints 13-15 and 18-20 are ankle,
# mid-foot and toe. Proportions of the same adult.
KIT = _sided(
    "kit",
    """
    root    -      0       0.940   0
    BP      root   0       0.110   0
    BT      BP     0       0.190   0
    BLN     BT     0       0.190   0
    BUN     BLN    0       0.120   0
    RS      BLN    =
    RE      RS     =
    RW      RE     =
    LS      BLN    0.180   0       0
    LE      LS     0.270   0       0
    LW      LE     0.250   0       0
    RH      root   =
    RK      RH     =
    RA      RK     =
    RMrot   RA     =
    RF      RMrot  =
    LH      root   0.080  -0.080   0
    LK      LH     0      -0.390   0
    LA      LK     0      -0.410   0
    LMrot   LA     0      -0.050   0.080
    LF      LMrot  0      -0.010   0.070
    """,
    left="L",
    right="R",
    feet=("LMrot", "LF", "RMrot", "RF"),
    facing=("RH", "LH", "RS", "LS"),
)

# SnapMoGen's rig (Guo et al. 2025): names and T-pose of its files, to the last digit, so left and right differ by
# micrometres. Its "centimetres" are a rig scale (the character is about 1.1 m high), kept as published: `standard_body`
# scales it.
SNAPMOGEN = _sided(
    "snapmogen",
    """
    ROOT                     -                         0          56.02      -5.659234
    C_spine0001_bind_JNT     ROOT                      0           1.618999   0
    C_spine0002_bind_JNT     C_spine0001_bind_JNT      0           4.942001   0
    C_spine0003_bind_JNT     C_spine0002_bind_JNT      0           4.860626   0
    C_neck0001_bind_JNT      C_spine0003_bind_JNT      0          17.026009   0
    C_neck0002_bind_JNT      C_neck0001_bind_JNT       0           3.249977   0
    C_head_bind_JNT          C_neck0002_bind_JNT       0           5.278008   0
    L_clavicle_bind_JNT      C_spine0003_bind_JNT      4.59       12.066994   0.834
    L_armUpper0001_bind_JNT  L_clavicle_bind_JNT       7.829616   -0.000488  -3.452442
    L_armLower0001_bind_JNT  L_armUpper0001_bind_JNT  16.585003    0          0.001477
    L_hand0001_bind_JNT      L_armLower0001_bind_JNT  16.988001   -0.000008   0.001513
    R_clavicle_bind_JNT      C_spine0003_bind_JNT     -4.59       12.066994   0.834
    R_armUpper0001_bind_JNT  R_clavicle_bind_JNT      -7.829616   -0.000496  -3.452442
    R_armLower0001_bind_JNT  R_armUpper0001_bind_JNT -16.584999   -0.000008   0.001476
    R_hand0001_bind_JNT      R_armLower0001_bind_JNT -16.987003    0          0.001518
    C_pelvis0001_bind_JNT    ROOT                      0           0          0
    L_legUpper0001_bind_JNT  C_pelvis0001_bind_JNT     6.599999   -6.027      0.539001
    L_legLower0001_bind_JNT  L_legUpper0001_bind_JNT  -0.142964  -19.187426   0.040265
    L_foot0001_bind_JNT      L_legLower0001_bind_JNT  -0.134372  -18.034275  -1.044868
    L_foot0002_bind_JNT      L_foot0001_bind_JNT      -0.000058   -5.392303   9.602907
    R_legUpper0001_bind_JNT  C_pelvis0001_bind_JNT    -6.6        -6.027      0.539
    R_legLower0001_bind_JNT  R_legUpper0001_bind_JNT   0.14296   -19.187145   0.04055
    R_foot0001_bind_JNT      R_legLower0001_bind_JNT   0.13437   -18.034281  -1.044816
    R_foot0002_bind_JNT      R_foot0001_bind_JNT       0.000053   -5.392302   9.602905
    """,
    scale=0.01,
    left="L_",
    right="R_",
    feet=("L_foot0001_bind_JNT", "L_foot0002_bind_JNT", "R_foot0001_bind_JNT", "R_foot0002_bind_JNT"),
    facing=("R_legUpper0001_bind_JNT", "L_legUpper0001_bind_JNT", "R_armUpper0001_bind_JNT", "L_armUpper0001_bind_JNT"),
)

SKELETONS: dict[str, Skeleton] = {s.name: s for s in (HUMANML3D, KIT, SNAPMOGEN)}


_SIDE = re.compile(r"(?<![a-z])(left|right|l|r)(?![a-z])|(left|right)", re.IGNORECASE)
_OTHER = {"left": "right", "right": "left", "l": "r", "r": "l"}


def mirror_by_name(names: tuple[str, ...]) -> tuple[int, ...]:
    """Pair left and right joints by name (`LeftArm`, `hand_l`, `L_Thigh`); unpaired joints mirror to themselves."""
    lowered = [re.sub(r"(?<=[a-z])(?=[A-Z])", "_", n).replace("__", "_").lower() for n in names]
    index = {n: j for j, n in enumerate(lowered)}

    def other(j: int) -> int:
        swapped = _SIDE.sub(lambda m: _OTHER[m.group(0).lower()], lowered[j].replace("_", " "), count=1)
        return index.get(swapped.replace(" ", "_"), j)

    pairs = [other(j) for j in range(len(names))]
    return tuple(p if pairs[p] == j else j for j, p in enumerate(pairs))


def skeleton_of(names: tuple[str, ...], parents: tuple[int, ...], offsets: NDArray[np.floating]) -> Skeleton:
    """Return a skeleton read from a file: one of Marey's with these offsets if names and tree are equal, else a new
    one."""
    for known in SKELETONS.values():
        if known.joint_names == names and known.parents == parents:
            return known.with_offsets(offsets)
    return Skeleton("other", names, parents, np.asarray(offsets, np.float32), mirror_by_name(names))


def known_order(names: tuple[str, ...], parents: tuple[int, ...]) -> tuple[Skeleton, tuple[int, ...]] | None:
    """Return one of Marey's skeletons with the same joints and bones in any order, and the index here of each of its
    joints.

    A BVH file lists joints depth first, which is not the order of HumanML3D's arrays.
    """
    parent_names = {n: names[p] if p >= 0 else "" for n, p in zip(names, parents, strict=True)}
    for known in SKELETONS.values():
        theirs = {
            n: known.joint_names[p] if p >= 0 else "" for n, p in zip(known.joint_names, known.parents, strict=True)
        }
        if theirs == parent_names:
            return known, tuple(names.index(n) for n in known.joint_names)
    return None
