"""Read the motion of a rig from a glb file that Marey wrote: the body from the hips down as a clip.

Joints over the hips, and what hangs on them beside the body, are left out; the rest pose of the rig becomes the
offsets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.motion.rotations import Array, conjugate, multiply, normalize, rotate
from marey.motion.skeleton import Skeleton, mirror_by_name


@dataclass(frozen=True, eq=False)
class HipsMotion:
    """The body of a rig in motion.

    Attributes:
        skeleton: joints from the hips down; offsets are the rest pose, metres.
        rotations: (T, J, 4) from the rest pose, with axes along the world's.
        root: (T, 3) the hips in the world, metres.
    """

    skeleton: Skeleton
    rotations: Array = field(repr=False)
    root: Array = field(repr=False)


def hips_motion(
    nodes: Sequence[Mapping[str, Any]],
    turns: Mapping[int, NDArray[np.float32]],
    places: Mapping[int, NDArray[np.float32]],
    hips: int,
) -> HipsMotion:
    """Return the motion of the body of a rigged file.

    Args:
        nodes: of the file, parents before children.
        turns, places: (T, 4) `x y z w` and (T, 3) animated values by node.
        hips: the node that carries the body.

    Raises:
        ValueError, KeyError, IndexError, TypeError: the file is broken.
    """
    parents = [-1] * len(nodes)
    for parent, node in enumerate(nodes):
        for child in node.get("children", ()):
            if child <= parent:
                raise ValueError("a child stands before its parent")
            parents[child] = parent
    frames = len(places[hips])
    rest, rest_places, _ = _world(nodes, parents, {}, {}, 1)
    world, joints, _ = _world(nodes, parents, turns, places, frames)
    kept = [hips]
    kept += [joint for joint in range(hips + 1, len(nodes)) if _under(parents, joint, hips)]
    place = {joint: number for number, joint in enumerate(kept)}
    over = tuple(place.get(parents[joint], -1) for joint in kept)
    offsets = rest_places[0, kept]
    offsets[1:] -= rest_places[0, [parents[joint] for joint in kept[1:]]]
    free = multiply(world[:, kept], conjugate(rest[:, kept]))
    local = free.copy()
    local[:, 1:] = multiply(conjugate(free[:, list(over[1:])]), free[:, 1:])
    names = tuple(str(nodes[joint]["name"]) for joint in kept)
    skeleton = Skeleton("other", names, over, offsets.astype(np.float32), mirror_by_name(names))
    return HipsMotion(skeleton, local, joints[:, hips])


def _under(parents: Sequence[int], joint: int, hips: int) -> bool:
    while joint > hips:
        joint = parents[joint]
    return joint == hips


def _world(
    nodes: Sequence[Mapping[str, Any]],
    parents: Sequence[int],
    turns: Mapping[int, NDArray[np.float32]],
    places: Mapping[int, NDArray[np.float32]],
    frames: int,
) -> tuple[Array, Array, Array]:
    """Return orientations (T, J, 4), places (T, J, 3) and scales (J,) of the nodes in the world."""
    world, joints, scales = np.empty((frames, len(nodes), 4)), np.empty((frames, len(nodes), 3)), np.ones(len(nodes))
    for joint, node in enumerate(nodes):
        turn = np.asarray(turns.get(joint, [node["rotation"]]), np.float64)[:, [3, 0, 1, 2]]
        place = np.asarray(places.get(joint, [node["translation"]]), np.float64)
        scales[joint] = float(node.get("scale", [1.0])[0])
        parent = parents[joint]
        if parent >= 0:
            place = joints[:, parent] + scales[parent] * rotate(world[:, parent], place)
            turn = multiply(world[:, parent], turn)
            scales[joint] *= scales[parent]
        world[:, joint], joints[:, joint] = normalize(turn), place
    return world, joints, scales
