"""Rigs as JSON, a form of Marey's own that other programs can write easily (`docs/reference/formats.md`).

    {"format": "marey-rig", "version": 1, "unit": 0.01, "up": "y", "joints": [
      {"name": "Hips", "parent": null, "position": [0, 97, 0], "rotation": [1, 0, 0, 0]}, …]}

Positions and rotations (`w x y z`) are of the rest pose, in the world of the file; a parent is a name.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any, cast

import numpy as np

from marey.core.documents import parse_json
from marey.core.errors import InvalidFile, TooLarge
from marey.motion.rigs.make_rig import RigNode, check_count, make_rig
from marey.motion.rigs.rig import Rig
from marey.motion.rotations import Z_TO_Y, Array, conjugate, multiply, rotate, to_matrix

FORMAT, VERSION = "marey-rig", 1
SHAPE = "See `Rig files` in docs/reference/formats.md."


def parse_json_rig(data: bytes, where: str = "json") -> Rig:
    """Read a rig in JSON.

    Raises:
        InvalidFile: broken, or something else than a rig.
        TooLarge: over 2,000 joints.
    """
    document = parse_json(data, where)
    try:
        return _rig(cast("Mapping[str, Any]", document), where, hashlib.sha256(data).hexdigest())
    except (InvalidFile, TooLarge):
        raise
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, OverflowError) as error:
        raise InvalidFile(f"is not a rig: {error!r}", where=where, hint=SHAPE) from None


def _rig(document: Mapping[str, Any], where: str, sha256: str) -> Rig:
    if document["format"] != FORMAT or document["version"] != VERSION:
        raise InvalidFile(f"is not a rig of version {VERSION}", where=where, hint=SHAPE)
    unit, up = float(document["unit"]), document["up"]
    if up not in ("y", "z") or not 1e-6 <= unit <= 1e6:
        raise InvalidFile("its unit must be metres as a number, and its axis y or z", where=where, hint=SHAPE)
    joints: list[Mapping[str, Any]] = document["joints"]
    check_count(len(joints), where)
    index = {str(joint["name"]): number for number, joint in enumerate(joints)}
    if len(index) < len(joints):
        raise InvalidFile("two joints have one name", where=where)
    nodes: list[RigNode] = []
    for joint in joints:
        parent = joint.get("parent")
        if parent is not None and parent not in index:
            raise InvalidFile(f"{joint['name']!r} hangs on {parent!r}, which is not there", where=where)
        matrix = np.eye(4)
        turn = np.array(joint.get("rotation", (1, 0, 0, 0)), np.float64).reshape(4)
        if not abs(float(np.linalg.norm(turn)) - 1) <= 1e-3:
            raise InvalidFile(f"the rotation of {joint['name']!r} is no unit quaternion", where=where, hint=SHAPE)
        matrix[:3, :3] = to_matrix(turn / np.linalg.norm(turn))
        matrix[:3, 3] = np.array(joint["position"], np.float64).reshape(3)
        nodes.append(RigNode(str(joint["name"]), -1 if parent is None else index[parent], matrix))
    return make_rig(nodes, name=PurePath(where).name, where=where, unit=unit, up=up, source="json", sha256=sha256)


def format_json_rig(rig: Rig) -> bytes:
    """Return a rig as JSON, in the unit and axes of its file; scales of nodes are left out."""
    turns, places = rig.orientations, rig.positions / rig.unit
    if rig.up == "z":
        turns, places = multiply(conjugate(Z_TO_Y), turns), rotate(conjugate(Z_TO_Y), places)
    joints: list[dict[str, Any]] = [
        {
            "name": name,
            "parent": None if parent < 0 else rig.joint_names[parent],
            "position": _plain(places[joint], 9),
            "rotation": _plain(turns[joint], 12),
        }
        for joint, (name, parent) in enumerate(zip(rig.joint_names, rig.parents, strict=True))
    ]
    document: dict[str, Any] = {"format": FORMAT, "version": VERSION, "unit": rig.unit, "up": rig.up, "joints": joints}
    return (json.dumps(document, ensure_ascii=False, allow_nan=False, indent=1) + "\n").encode()


def _plain(numbers: Array, digits: int) -> list[float]:
    return [round(float(number), digits) + 0.0 for number in numbers]
