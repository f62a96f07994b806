"""Animation curves of FBX files: the keys of a file, and their values at any time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.motion.io.fbx_nodes import TICKS
from marey.motion.io.fbx_parse import ReadNode
from marey.motion.io.fbx_scene import Scene
from marey.motion.io.fbx_transforms import vector
from marey.motion.rotations import Array

MAX_KEYS = 2**20
CONSTANT, LINEAR, CUBIC = 2, 4, 8  # flags of a key
CONSTANT_NEXT = 0x100
"""With CONSTANT: the value is already that of the next key."""
DEFAULTS = {"Lcl Translation": 0.0, "Lcl Rotation": 0.0, "Lcl Scaling": 1.0}


@dataclass(frozen=True, eq=False)
class Curve:
    """Keys of one number.

    Attributes:
        times: (K,) seconds, increasing.
        values: (K,).
        flags: (K,) how the value goes on from each key.
        slopes: (K, 2) units a second at each key to the right, and at the next key from the left.
    """

    times: NDArray[np.float64] = field(repr=False)
    values: NDArray[np.float64] = field(repr=False)
    flags: NDArray[np.int64] = field(repr=False)
    slopes: NDArray[np.float64] = field(repr=False)

    def at(self, times: Array) -> Array:
        """Return the values at some times; before the first and after the last key they are held.

        Cubic curves follow the slopes of their keys; other weights of tangents than the default are not regarded.
        """
        if len(self.times) == 1:
            return np.full(len(times), self.values[0])
        left = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        wide = self.times[left + 1] - self.times[left]
        u = np.clip((times - self.times[left]) / wide, 0.0, 1.0)
        a, b, flags = self.values[left], self.values[left + 1], self.flags[left]
        out, into = self.slopes[left, 0] * wide, self.slopes[left, 1] * wide
        cubic = (
            (2 * u**3 - 3 * u**2 + 1) * a + (u**3 - 2 * u**2 + u) * out
            + (3 * u**2 - 2 * u**3) * b + (u**3 - u**2) * into
        )  # fmt: skip
        held = np.where(flags & CONSTANT_NEXT, b, np.where(u >= 1.0, b, a))
        values = np.where(flags & CUBIC, cubic, a + u * (b - a))
        return np.where((flags & CONSTANT) != 0, held, values)


@dataclass(frozen=True, eq=False)
class Animation:
    """The curves of one animation stack.

    Attributes:
        curves: by model and attribute (`Lcl Rotation`), one an axis; None where the attribute has no curve of it.
        start, stop: seconds.
        notes: oddities, as sentences.
    """

    curves: dict[tuple[int, str], list[Curve | None]] = field(repr=False)
    start: float
    stop: float
    notes: tuple[str, ...]

    def sample(self, scene: Scene, times: Array) -> dict[int, dict[str, Array]]:
        """Return the values (T, 3) of each animated attribute of each model."""
        found: dict[int, dict[str, Array]] = {}
        for (model, name), curves in self.curves.items():
            still = vector(scene.models[model].properties, name, DEFAULTS[name])
            columns = [np.full(len(times), still[axis]) if c is None else c.at(times) for axis, c in enumerate(curves)]
            found.setdefault(model, {})[name] = np.stack(columns, axis=-1)
        return found


def read_animation(scene: Scene, models: set[int]) -> Animation:
    """Read the curves of some models in the first animation stack that moves any of them.

    Raises:
        InvalidFile: no such stack, or keys that contradict each other.
        TooLarge: too many keys.
    """
    above: dict[int, list[tuple[int, str]]] = {}
    for child, parent, attribute in scene.connections:
        above.setdefault(child, []).append((parent, attribute))
    stacks = [key for key, node in scene.objects.items() if node.name == "AnimationStack"]
    notes: list[str] = []
    for stack in stacks:
        layers = _children(scene, stack, "AnimationLayer")
        nodes = [node for layer in layers[:1] for node in _children(scene, layer, "AnimationCurveNode")]
        curves = _curves(scene, nodes, above, models)
        if curves:
            if len(stacks) > 1:
                notes.append(f"{len(stacks)} animations in the file; the first that moves the skeleton is read")
            if len(layers) > 1:
                notes.append(f"{len(layers)} layers of animation; the first is read")
            keyed = [curve.times for each in curves.values() for curve in each if curve is not None]
            return Animation(curves, min(t[0] for t in keyed), max(t[-1] for t in keyed), tuple(notes))
    raise scene.file.broken("holds no animation of its skeleton")


def _children(scene: Scene, parent: int, kind: str) -> list[int]:
    """Return the identifiers of the objects of a kind below another one, in the order of the connections."""
    known = scene.objects
    return [c for c, p, _ in scene.connections if p == parent and c in known and known[c].name == kind]


def _curves(
    scene: Scene, nodes: list[int], above: dict[int, list[tuple[int, str]]], models: set[int]
) -> dict[tuple[int, str], list[Curve | None]]:
    found: dict[tuple[int, str], list[Curve | None]] = {}
    of = {
        node: (parent, name)
        for node in nodes
        for parent, name in above.get(node, ())
        if parent in models and name in DEFAULTS
    }
    for curve, parent, name in scene.connections:
        node = scene.objects.get(curve)
        if parent in of and node is not None and node.name == "AnimationCurve" and name in ("d|X", "d|Y", "d|Z"):
            found.setdefault(of[parent], [None] * 3)["XYZ".index(name[-1])] = _curve(scene, node)
    return found


def _curve(scene: Scene, node: ReadNode) -> Curve:
    file = scene.file
    times = file.array(node.first("KeyTime"), "l", most=MAX_KEYS) / TICKS
    with np.errstate(invalid="ignore"):  # NaN is looked for below
        values = file.array(node.first("KeyValueFloat"), "fd", most=MAX_KEYS).astype(np.float64)
        data = file.array(node.first("KeyAttrDataFloat"), "f", most=4 * MAX_KEYS).astype(np.float64)
    if not len(times) or len(times) != len(values) or (np.diff(times) <= 0).any() or not np.isfinite(values).all():
        raise file.broken(f"a curve has {len(times)} times and {len(values)} values, or they are not in order")
    counts = file.array(node.first("KeyAttrRefCount"), "i", most=MAX_KEYS).astype(np.int64)
    flags = file.array(node.first("KeyAttrFlags"), "i", most=MAX_KEYS).astype(np.int64)
    if len(flags) != len(counts) or len(data) != 4 * len(counts) or (counts < 0).any() or counts.sum() != len(times):
        flags, data, counts = np.array([LINEAR]), np.zeros(4), np.array([len(times)])
    which = np.repeat(np.arange(len(counts)), counts)
    slopes = data.reshape(-1, 4)[which, :2]
    slopes = np.where(np.isfinite(slopes), slopes, 0.0)
    return Curve(times, values, flags[which], slopes)
