"""Transforms of FBX nodes, as Autodesk's SDK documents them ("Computing transformation matrices").

A node's matrix is T Roff Rp Rpre R Rpost' Rp' Soff Sp S Sp', where ' is the inverse; its parent's comes before it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.motion.io.fbx_scene import Model, Properties, Scene
from marey.motion.rotations import Array, conjugate, from_euler, multiply, to_matrix

ORDERS = ("ZYX", "YZX", "XZY", "ZXY", "YXZ", "XYZ", "ZYX")
"""Axes from the outermost on, by `RotationOrder`; the last is eSphericXYZ."""
WITHOUT_SCALE = 2
"""`InheritType` Rrs: the parent's own scale does not reach the node. Types 0 and 1 differ for stretched nodes alone,
which no rig may have."""
Animated = Mapping[str, Array]
"""Values (T, 3) of `Lcl Translation`, `Lcl Rotation` and `Lcl Scaling`."""


@dataclass(frozen=True, eq=False)
class World:
    """Matrices from nodes to the world: (..., 3, 3) linear parts and (..., 3) positions, by identifier."""

    linear: dict[int, Array] = field(repr=False)
    places: dict[int, Array] = field(repr=False)


def vector(properties: Properties, name: str, default: float = 0.0) -> NDArray[np.float64]:
    """Return three numbers of a property."""
    return np.array((*properties.get(name, ()), default, default, default)[:3], np.float64)


def local_transform(model: Model, animated: Animated) -> tuple[Array, Array, Array]:
    """Return rotation (..., 3, 3), scale (..., 3) and position (..., 3) of a node from its parent."""
    known = model.properties

    def value(name: str, default: float = 0.0) -> Array:
        return animated[name] if name in animated else vector(known, name, default)

    order = int(known.get("RotationOrder", (0,))[0])
    turn = from_euler(_outermost_first(value("Lcl Rotation"), order), ORDERS[order if 0 <= order < len(ORDERS) else 0])
    pre, post = (from_euler(vector(known, name)[::-1], ORDERS[0]) for name in ("PreRotation", "PostRotation"))
    rotation = to_matrix(multiply(multiply(pre, turn), conjugate(post)))
    scale = value("Lcl Scaling", 1.0)
    pivot, scale_pivot = vector(known, "RotationPivot"), vector(known, "ScalingPivot")
    inner = -pivot + vector(known, "ScalingOffset") + scale_pivot - scale * scale_pivot
    place = value("Lcl Translation") + vector(known, "RotationOffset") + pivot + _apply(rotation, inner)
    return rotation, scale, place


def _outermost_first(angles: Array, order: int) -> Array:
    """Return angles about X, Y and Z in the order in which the axes are named in `ORDERS`."""
    names = ORDERS[order if 0 <= order < len(ORDERS) else 0]
    return angles[..., ["XYZ".index(axis) for axis in names]]


def _apply(matrix: Array, vectors: Array) -> Array:
    return np.einsum("...ij,...j->...i", matrix, vectors)


def world_transforms(
    scene: Scene, order: Sequence[int], animated: Mapping[int, Animated], *, bind: bool = False
) -> World:
    """Return the matrices of nodes in the world, in the file's unit and axes.

    Args:
        order: identifiers, parents first; a parent that is not among them counts as the world.
        animated: values over time of some nodes.
        bind: take the matrices of the bind pose where the file states them.
    """
    world, scales = World({}, {}), dict[int, Array]()
    for key in order:
        model = scene.models[key]
        rotation, scales[key], place = local_transform(model, animated.get(key, {}))
        linear, parent = rotation * scales[key][..., None, :], scene.parents.get(key)
        if bind and key in scene.bound:
            linear, place = scene.bound[key][:3, :3], scene.bound[key][:3, 3]
        elif parent in world.linear:
            above = world.linear[parent]
            place = world.places[parent] + _apply(above, place)
            if int(model.properties.get("InheritType", (1,))[0]) == WITHOUT_SCALE:
                above = above / np.maximum(np.abs(scales[parent]), 1e-12)[..., None, :]
            linear = above @ linear
        world.linear[key], world.places[key] = linear, place
    return world
