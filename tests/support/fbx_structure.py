"""Structure of FBX files: nodes with their property types, kinds of objects, and what is connected with what.

    python -m tests.support.fbx_structure tests/unit/exporters/fbx_structure.json FILE...

records the structure of files by other programs, without their contents. What stands there is of test data of ufbx
(MIT licence): files that Maya and MotionBuilder wrote, with skeletons, skins and curves.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from marey.motion.io.fbx_parse import FbxFile, Packed, ReadNode, text

KINDS = frozenset({
    "Model", "NodeAttribute", "Geometry", "Material", "Deformer", "Pose", "AnimationStack", "AnimationLayer",
    "AnimationCurveNode", "AnimationCurve",
})  # fmt: skip
"""Types of objects of a body and its motion; cameras, constraints and settings of a program are left out."""
OTHERS = ("Effector", "Camera", "Switcher")


@dataclass(frozen=True)
class Structure:
    """Structure of one file or several.

    Attributes:
        top: names of the nodes at the top, in order.
        nodes: path and types of properties; a property `P` with its name, type and label.
        objects: type, class and sub-class.
        connections: kind, types and sub-classes of both ends, attribute.
    """

    top: list[str]
    nodes: list[str]
    objects: list[str]
    connections: list[str]


def structure_of(data: bytes) -> Structure:
    """Return the structure of a file."""
    file = FbxFile(data, "structure")
    kinds = {0: "Scene"}
    objects: set[str] = set()
    for each in file.first("Objects").children:
        if each.name not in KINDS or not each.properties:
            continue  # MotionBuilder writes some without an identifier
        number, name, sub = each.properties[:3]
        label = text(name).rpartition("\0\1")[2] or "-"
        if text(sub).endswith(OTHERS):
            continue
        kinds[int(number)] = f"{each.name}/{text(sub)}"  # type: ignore[arg-type]
        objects.add(f"{each.name} {label} {text(sub)}")
    connections: set[str] = set()
    for each in file.first("Connections").children:
        how, child, parent, *attribute = each.properties
        ends = [kinds.get(int(end)) for end in (child, parent)]  # type: ignore[arg-type]
        if ends[0] and ends[1]:
            connections.add(" ".join([text(how), ends[0], ends[1], *map(text, attribute)]))
    return Structure([each.name for each in file.top], sorted(_nodes(file.top)), sorted(objects), sorted(connections))


def _nodes(nodes: Sequence[ReadNode], above: str = "") -> set[str]:
    found: set[str] = set()
    for each in nodes:
        if above == "/Objects" and each.name not in KINDS:
            continue
        kinds = "".join(p.letter if isinstance(p, Packed) else type(p).__name__[0] for p in each.properties)
        name = each.name
        if name == "P":
            name = "P " + "|".join(text(value) for value in each.properties[:3])
        if name in ("ObjectType", "PropertyTemplate"):
            name += f" {text(each.properties[0])}"
            if name.startswith("ObjectType") and name.split()[1] not in {"GlobalSettings", *KINDS}:
                continue
        path = f"{above}/{name}"
        found |= {f"{path} {kinds}"} | _nodes(each.children, path)
    return found


def joined(files: Sequence[Structure]) -> Structure:
    """Return what any of the files has, in the order of the first at the top."""
    parts = [
        sorted({row for each in files for row in getattr(each, key)}) for key in ("nodes", "objects", "connections")
    ]
    return Structure(files[0].top, *parts)


if __name__ == "__main__":
    target, *sources = map(Path, sys.argv[1:])
    recorded = {source.name: asdict(structure_of(source.read_bytes())) for source in sources}
    target.write_text(json.dumps(recorded, indent=0) + "\n", encoding="utf-8")
