"""The nodes of a skeleton in an FBX file, with their properties, rest pose and curves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidFile, TooLarge
from marey.motion.io.fbx_document import CUSTOM, TIME_MODES
from marey.motion.io.fbx_nodes import SEPARATOR
from marey.motion.io.fbx_parse import FbxFile, ReadNode, identifier, number, text

MAX_MODELS = 20_000
BONES = frozenset({"LimbNode", "Limb", "Root"})
"""Kinds of models that are joints. Effectors of a control rig are not."""
BODIES = frozenset({"Mesh", "Camera", "Light", "CameraSwitcher", "IKEffector", "FKEffector"})
Properties = Mapping[str, tuple[float, ...]]


@dataclass(frozen=True, eq=False)
class Model:
    """A node of the scene.

    Attributes:
        number: its identifier.
        name: as in the file.
        kind: `LimbNode`, `Null`, `Mesh` and others.
        properties: numbers by name.
    """

    number: int
    name: str
    kind: str
    properties: Properties = field(repr=False)


@dataclass(frozen=True, eq=False)
class Scene:
    """Nodes of a file.

    Attributes:
        file: the file.
        settings: numbers of its settings by name, such as `UpAxis`.
        models: by identifier.
        parents: identifier of the parent model; no entry for a root.
        bound: matrix (4, 4) of a model in the bind pose, columns are the axes; by identifier.
        linked: identifiers of the models that a skin is bound to.
        objects: other nodes by identifier.
        connections: child, parent and attribute (empty = none), in the order of the file.
    """

    file: FbxFile
    settings: Properties
    models: dict[int, Model]
    parents: dict[int, int]
    bound: dict[int, NDArray[np.float64]]
    linked: set[int]
    objects: dict[int, ReadNode]
    connections: list[tuple[int, int, str]]

    @property
    def unit(self) -> float:
        """Metres of one unit of the file.

        Raises:
            InvalidFile: not a positive number.
        """
        factor = self.settings.get("UnitScaleFactor", (1.0,))[0]
        if not 1e-9 < factor < 1e9:
            raise self.file.broken(f"UnitScaleFactor is {factor:g}")
        return factor * 0.01

    @property
    def fps(self) -> float:
        """Frames a second of the file; 30 where it names none."""
        mode = int(self.settings.get("TimeMode", (0,))[0])
        if mode == CUSTOM:
            rate = self.settings.get("CustomFrameRate", (0.0,))[0]
            if not 0 < rate <= 1000:
                raise self.file.broken(f"CustomFrameRate is {rate:g}")
            return rate
        rates = {number: rate for rate, number in TIME_MODES.items()}
        return rates.get(mode, 30000 / 1001 if mode == 8 else 30.0)

    def axes(self) -> NDArray[np.float64]:
        """Return the rotation (3, 3) from the file's axes to Y up, +Z in front.

        Raises:
            InvalidFile: they are not a right-handed system.
        """
        turn = np.zeros((3, 3))
        for row, name in enumerate(("Coord", "Up", "Front")):
            axis = int(self.settings.get(f"{name}Axis", ((0, 1, 2)[row],))[0])
            if not 0 <= axis <= 2:
                raise self.file.broken(f"{name}Axis is {axis}")
            turn[row, axis] = math.copysign(1.0, self.settings.get(f"{name}AxisSign", (1.0,))[0])
        if abs(np.linalg.det(turn) - 1) > 1e-6:
            hint = "Export it with a right-handed axis system, Y or Z up."
            raise InvalidFile("its axes are left-handed or not three different ones", where=self.file.where, hint=hint)
        return turn


def read_scene(data: bytes, where: str) -> Scene:
    """Read the nodes of a file.

    Raises:
        InvalidFile, TooLarge: see `FbxFile`.
    """
    file = FbxFile(data, where)
    settings = _properties(file, file.first("GlobalSettings"), {})
    default = _template(file)
    models: dict[int, Model] = {}
    objects: dict[int, ReadNode] = {}
    kinds: dict[int, str] = {}
    for node in file.first("Objects").children:
        if len(node.properties) < 3:
            continue
        key, name = identifier(node.properties[0]), text(node.properties[1]).split(SEPARATOR)[0]
        if node.name == "Model":
            kind = text(node.properties[2])
            models[key] = Model(key, name, kind, _properties(file, node, default))
        elif node.name == "NodeAttribute":
            kinds[key] = text(node.properties[2])
        else:
            objects[key] = node
    if len(models) > MAX_MODELS:
        raise TooLarge(f"{len(models)} nodes, over the limit of {MAX_MODELS}", where=where)
    connections = _connections(file)
    parents = {
        child: parent for child, parent, name in connections if child in models and parent in models and not name
    }
    for child, parent, _ in connections:  # some writers name the kind in the attribute alone
        if kinds.get(child) in BONES and parent in models and models[parent].kind == "":
            models[parent] = Model(parent, models[parent].name, kinds[child], models[parent].properties)
    scene = Scene(file, settings, models, parents, {}, set(), objects, connections)
    _bind(scene)
    return scene


def _connections(file: FbxFile) -> list[tuple[int, int, str]]:
    found: list[tuple[int, int, str]] = []
    for node in file.first("Connections").children:
        if len(node.properties) >= 3:
            attribute = text(node.properties[3]) if len(node.properties) > 3 else ""
            found.append((identifier(node.properties[1]), identifier(node.properties[2]), attribute))
    return found


def _template(file: FbxFile) -> Properties:
    """Return the defaults of models that the file states."""
    for kind in file.first("Definitions").all("ObjectType"):
        if kind.properties and text(kind.properties[0]) == "Model":
            template = kind.first("PropertyTemplate")
            return _properties(file, template, {}) if template is not None else {}
    return {}


def _properties(file: FbxFile, node: ReadNode, default: Properties) -> Properties:
    """Return the numbers of a node's properties by name, over defaults; texts count as 0."""
    rows = node.first("Properties70")
    found = dict(default)
    for row in rows.children if rows is not None else ():
        if len(row.properties) > 4 and isinstance(row.properties[0], bytes):
            values = tuple(number(value) for value in row.properties[4:8])
            if not all(map(math.isfinite, values)):
                raise file.broken(f"{text(row.properties[0])!r} holds NaN or infinite numbers")
            found[text(row.properties[0])] = values
    return found


def _bind(scene: Scene) -> None:
    """Find the bind pose: the `BindPose`s of the file, and where its skins were bound."""
    for node in scene.objects.values():
        if node.name == "Pose" and text(node.properties[2]) == "BindPose":
            for entry in node.all("PoseNode"):
                of = entry.first("Node")
                if of is not None and of.properties:
                    _keep(scene, identifier(of.properties[0]), entry.first("Matrix"))
    clusters = {
        key: node
        for key, node in scene.objects.items()
        if node.name == "Deformer" and text(node.properties[2]) == "Cluster"
    }
    for child, parent, _ in scene.connections:
        if parent in clusters and child in scene.models:
            scene.linked.add(child)
            _keep(scene, child, clusters[parent].first("TransformLink"))


def _keep(scene: Scene, model: int, matrix: ReadNode | None) -> None:
    """Keep a model's matrix in the bind pose; the first that a file states."""
    if model in scene.models and model not in scene.bound and matrix is not None:
        values: NDArray[Any] = scene.file.array(matrix, "d", most=16)
        if values.size == 16 and np.isfinite(values).all():
            scene.bound[model] = values.reshape(4, 4).T.astype(np.float64)
