"""Make a rig from the nodes that a reader found, with every check on them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidFile, TooLarge
from marey.motion.rigs.rig import MAX_JOINTS, Rig
from marey.motion.rotations import Z_TO_Y, from_matrix, multiply, rotate
from marey.motion.units import FARTHEST, Up

MAX_NAME = 256
"""Characters of the name of a joint."""
EVEN = 0.01
"""Relative difference of a node's three scales, and cosine between its axes, up to which it is neither stretched nor
sheared; exporters round."""


@dataclass(frozen=True, eq=False)
class RigNode:
    """A node of a file.

    Attributes:
        name: as in the file; several may be equal.
        parent: index of the parent in the file's list of nodes, -1 for a root.
        matrix: (4, 4) from the node's space to the file's, in the rest pose; columns are the axes, in the file's unit.
        bone: a skin is bound to it, or the format says that it is a bone.
        tip: the end of a bone without a child, in the node's space and the file's unit, if the file states it.
    """

    name: str
    parent: int
    matrix: NDArray[np.float64]
    bone: bool = True
    tip: tuple[float, float, float] | None = None


def make_rig(
    nodes: Sequence[RigNode],
    *,
    name: str,
    where: str,
    unit: float,
    up: Up,
    source: str,
    sha256: str,
    extras: Mapping[str, Any] | None = None,
    notes: Sequence[str] = (),
) -> Rig:
    """Return the rig of a file's nodes, which may come in any order.

    Args:
        nodes: all bones, and the plain nodes above and between them.
        name, unit, up, source, sha256, extras: see `Rig`. `extras` may hold `order`, which is set here: the index in
            `nodes` of each joint.
        where: names the file in errors.
        notes: oddities that the reader found.

    Raises:
        InvalidFile: no bones, a circle of parents, numbers that are not finite, or a node that is stretched, sheared,
            mirrored or without size.
        TooLarge: over `MAX_JOINTS`, a longer name than `MAX_NAME`, or a joint farther away than `FARTHEST`.
    """
    if not any(node.bone for node in nodes):
        raise InvalidFile("holds no skeleton", where=where, hint="Export the character with its bones.")
    check_count(len(nodes), where)
    _check_names(nodes, where)
    order = _parents_first(nodes, where)
    place = {node: joint for joint, node in enumerate(order)}
    matrices = np.array([nodes[node].matrix for node in order], np.float64)
    names, repeated = _unique([nodes[node].name for node in order])
    sizes, axes = _split(matrices, names, where)
    orientations, positions = from_matrix(axes), matrices[:, :3, 3] * unit
    _check_near(positions, names, where)
    if up == "z":
        orientations, positions = multiply(Z_TO_Y, orientations), rotate(Z_TO_Y, positions)
    tips = np.array([nodes[node].tip or (np.nan,) * 3 for node in order], np.float64)
    return Rig(
        name=name,
        joint_names=names,
        parents=tuple(place.get(nodes[node].parent, -1) for node in order),
        positions=positions,
        orientations=orientations,
        scales=sizes * unit,
        tips=tips * (sizes * unit)[:, None],
        bones=tuple(nodes[node].bone for node in order),
        unit=unit,
        up=up,
        source=source,
        sha256=sha256,
        extras={**(extras or {}), "order": order},
        notes=(*notes, *repeated),
    )


def check_count(joints: int, where: str) -> None:
    """Check the number of joints; readers do it before they compute anything of each.

    Raises:
        TooLarge: over `MAX_JOINTS`.
    """
    if joints > MAX_JOINTS:
        raise TooLarge(f"{joints} joints, over the limit of {MAX_JOINTS}", where=where)


def _check_names(nodes: Sequence[RigNode], where: str) -> None:
    longest = max((node.name for node in nodes), key=len)
    if len(longest) > MAX_NAME:
        message = f"the name {longest[:20]!r}… has {len(longest):,} characters, over the limit of {MAX_NAME}"
        raise TooLarge(message, where=where)


def _check_near(positions: NDArray[np.float64], names: Sequence[str], where: str) -> None:
    """Check that joints (J, 3) are within `FARTHEST`; an overflow, which is no number, is not."""
    far = np.abs(positions).max(axis=1)
    if not (far <= FARTHEST).all():
        joint = int(np.argmax(~(far <= FARTHEST)))
        message = f"the node {names[joint]!r} is {far[joint]:.3g} m from the origin, over the limit of {FARTHEST:g}"
        raise TooLarge(message, where=where)


def _parents_first(nodes: Sequence[RigNode], where: str) -> list[int]:
    """Return the nodes' indices in depth-first order, siblings as in the file."""
    below: dict[int, list[int]] = {}
    for index, node in enumerate(nodes):
        if not -1 <= node.parent < len(nodes):
            raise InvalidFile(f"the parent of {node.name!r} is not there", where=where)
        below.setdefault(node.parent, []).append(index)
    order: list[int] = []
    waiting = below.get(-1, [])[::-1]
    while waiting:
        order.append(waiting.pop())
        waiting.extend(below.get(order[-1], [])[::-1])
    if len(order) < len(nodes):
        lost = nodes[next(index for index in range(len(nodes)) if index not in set(order))]
        raise InvalidFile(f"{lost.name!r} is above itself: the skeleton is a circle", where=where)
    return order


def _split(matrices: NDArray[np.float64], names: Sequence[str], where: str) -> tuple[Any, Any]:
    """Return the uniform scales (J,) and the axes (J, 3, 3) of matrices (J, 4, 4)."""
    if not np.isfinite(matrices).all():
        raise InvalidFile("holds NaN or infinite numbers", where=where)
    linear = matrices[:, :3, :3]
    lengths = np.linalg.norm(linear, axis=1)
    sizes = lengths.mean(axis=1)
    axes = linear / np.maximum(lengths, 1e-12)[:, None, :]
    slant = np.abs(axes.swapaxes(1, 2) @ axes - np.eye(3)).max(axis=(1, 2))
    faults = (
        (sizes < 1e-9, "has no size", "Give it a scale other than 0."),
        (np.ptp(lengths, axis=1) > EVEN * sizes, "is stretched: its scale differs by axis", APPLY),
        (slant > EVEN, "is sheared", APPLY),
        (np.linalg.det(axes) < 0, "is mirrored: its scale is negative", APPLY),
    )
    for wrong, message, hint in faults:
        if wrong.any():
            raise InvalidFile(f"the node {names[int(np.argmax(wrong))]!r} {message}", where=where, hint=hint)
    u, _, v = np.linalg.svd(axes)  # the nearest rotation
    return sizes, u @ v


APPLY = "Apply the scale in the program that wrote the file, and export it again."


def _unique(names: Sequence[str]) -> tuple[tuple[str, ...], list[str]]:
    """Return names that are all different, and a note for each name that stood there before."""
    seen: dict[str, int] = {}
    unique: list[str] = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique.append(name if seen[name] == 1 else f"{name}.{seen[name]}")
    if len(set(unique)) < len(unique):  # `a.2` may be the name of another joint
        unique = [f"{name}.{joint}" if unique.count(name) > 1 else name for joint, name in enumerate(unique)]
    return tuple(unique), [f"there are several joints {name!r}" for name, count in seen.items() if count > 1]
