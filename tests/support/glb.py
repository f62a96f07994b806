"""A reader of glb files of its own: the standard library and numpy, nothing of Marey. Forward kinematics is by 4 x 4
matrices, as programs do it."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np

WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}


@dataclass
class Glb:
    """A file's JSON and its numbers."""

    document: dict[str, Any]
    data: bytes

    @classmethod
    def read(cls, content: bytes) -> Glb:
        magic, version, length = struct.unpack_from("<4sII", content)
        assert (magic, version, length) == (b"glTF", 2, len(content))
        size, kind = struct.unpack_from("<I4s", content, 12)
        assert kind == b"JSON"
        assert size % 4 == 0
        rest, second = struct.unpack_from("<I4s", content, 20 + size)
        assert second == b"BIN\0"
        assert 28 + size + rest == len(content)
        return cls(json.loads(content[20 : 20 + size]), content[28 + size :])

    @property
    def names(self) -> list[str]:
        return [node["name"] for node in self.document["nodes"]]

    @property
    def extras(self) -> dict[str, Any]:
        return self.document["asset"]["extras"]

    def accessor(self, number: int) -> np.ndarray:
        about = self.document["accessors"][number]
        view = self.document["bufferViews"][about["bufferView"]]
        width = WIDTHS[about["type"]]
        kind = {5126: "<f4", 5123: "<u2"}[about["componentType"]]
        assert view["byteLength"] == np.dtype(kind).itemsize * width * about["count"]
        return np.frombuffer(self.data, kind, about["count"] * width, view["byteOffset"]).reshape(-1, width)

    def times(self) -> np.ndarray:
        (animation,) = self.document["animations"]
        (used,) = {sampler["input"] for sampler in animation["samplers"]}
        return self.accessor(used)[:, 0]

    def tracks(self, path: str) -> dict[int, np.ndarray]:
        (animation,) = self.document["animations"]
        assert {sampler["interpolation"] for sampler in animation["samplers"]} == {"LINEAR"}
        return {
            channel["target"]["node"]: self.accessor(animation["samplers"][channel["sampler"]]["output"])
            for channel in animation["channels"]
            if channel["target"]["path"] == path
        }

    def world(self) -> np.ndarray:
        """World matrices (T, J, 4, 4) of the animated nodes."""
        nodes = [node for node in self.document["nodes"] if "mesh" not in node]
        turns, places = self.tracks("rotation"), self.tracks("translation")
        frames = len(self.times())
        parents = {child: parent for parent, node in enumerate(nodes) for child in node.get("children", ())}
        world = np.zeros((frames, len(nodes), 4, 4))
        for joint, node in enumerate(nodes):
            local = np.zeros((frames, 4, 4))
            local[:, 3, 3] = 1
            local[:, :3, :3] = matrices(turns.get(joint, np.tile(node.get("rotation", [0, 0, 0, 1]), (frames, 1))))
            local[:, :3, 3] = places.get(joint, node["translation"])
            world[:, joint] = local if joint not in parents else world[:, parents[joint]] @ local
        return world

    def joints(self) -> np.ndarray:
        """World positions (T, J, 3)."""
        return self.world()[..., :3, 3]

    def rest(self) -> np.ndarray:
        """World positions (J, 3) of the nodes at rest, none of which is turned."""
        nodes = [node for node in self.document["nodes"] if "mesh" not in node]
        assert not any("rotation" in node or "scale" in node or "matrix" in node for node in nodes)
        parents = {child: parent for parent, node in enumerate(nodes) for child in node.get("children", ())}
        places = np.zeros((len(nodes), 3))
        for joint, node in enumerate(nodes):
            places[joint] = np.array(node["translation"]) + (places[parents[joint]] if joint in parents else 0)
        return places


def matrices(xyzw: np.ndarray) -> np.ndarray:
    """Rotation matrices (T, 3, 3) of quaternions x y z w."""
    x, y, z, w = np.asarray(xyzw, float).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
