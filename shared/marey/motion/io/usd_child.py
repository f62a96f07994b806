"""A process that reads the skeleton of one USD file: `python -m marey.motion.io.usd_child FILE SECONDS BYTES`.

It prints JSON: the skeleton, or `error` with `kind` and `hint`. Pixar's library parses untrusted bytes in C++, so it
does that here, with limits of time and memory. The layer is searched for paths to other files before it is composed:
composing opens them.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import resource
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any, cast

from marey.core.memory import limit_memory

MODULES = ("Sdf", "Usd", "UsdGeom", "UsdSkel", "Vt", "Work")
MAX_SPECS = 200_000
"""Prims, properties and variants of a file."""
MAX_JOINTS = 2000
"""As `marey.motion.rigs.rig.MAX_JOINTS`, which stands beside numpy."""
MAX_TEXT = 2**20
"""Characters of all names of joints."""
SAME = 1e-3
"""Relative difference up to which the bind pose and the rest pose are one; exporters write float or double."""
ARCS = {
    "subLayers": "a sublayer",
    "references": "a reference",
    "payload": "a payload",
    "clips": "value clips",
}
"""Fields that lead to other layers. Those within the layer are refused with them: a few lines make a million prims."""
UNSEEN = ("subLayerOffsets",)
"""Fields without a path, of a type that the library does not show to Python. Neither are the values of attributes of
another type than a path looked at, such as the points of a mesh: they would be unpacked."""
FLAT = "Export the skeleton alone: one flat file without materials, textures and references."


class UnreadableUsd(Exception):
    """A file that is not read, with the reason.

    Args:
        kind: `file` or `large`.
    """

    def __init__(self, message: str, hint: str | None = None, kind: str = "file") -> None:
        super().__init__(message)
        self.answer = {"error": message, "hint": hint, "kind": kind}


def main(path: str, seconds: int, memory: int) -> None:
    """Print what is read from a file.

    Args:
        seconds: of processor time.
        memory: bytes, beside the library itself.
    """
    answers = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what the library prints is no answer
    modules = {name: importlib.import_module(f"pxr.{name}") for name in MODULES}
    modules["Work"].SetConcurrencyLimit(1)
    limit(seconds, memory)
    with answers:
        json.dump(answer(modules, path), answers)


def limit(seconds: int, memory: int) -> None:
    """Bound this process: seconds of processor time in all, and bytes beside what it takes now."""
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    limit_memory(memory, more=True)


def answer(modules: dict[str, Any], path: str) -> dict[str, Any]:
    """Return the skeleton of a file, or why it is refused."""
    try:
        return read(modules, path)
    except UnreadableUsd as unreadable:
        return unreadable.answer
    except MemoryError:
        return UnreadableUsd("takes too much memory", FLAT, "large").answer
    except RuntimeError as error:  # Tf.ErrorException, with the place in the library's source
        text = ""
        with suppress(UnicodeDecodeError):  # it quotes the file
            text = str(error)
        if "bad_alloc" in text:
            return UnreadableUsd("takes too much memory", FLAT, "large").answer
        line = re.search(rf"{re.escape(path)}:(\d+):", text)
        return UnreadableUsd(f"is broken at line {line[1]}" if line else "is no USD file, or is broken").answer
    except UnicodeDecodeError:
        return UnreadableUsd("holds text that is not UTF-8").answer


def read(modules: dict[str, Any], path: str) -> dict[str, Any]:
    """Return the skeleton of a file: `names`, `parents`, `matrices` (16 numbers each, rows are the axes), `unit`, `up`
    and `notes`.

    Raises:
        UnreadableUsd: see `answer`.
    """
    layer = modules["Sdf"].Layer.OpenAsAnonymous(path)
    if layer is None:
        raise UnreadableUsd("is no USD file, or is broken")
    _refuse_other_files(modules["Sdf"], layer)
    stage = modules["Usd"].Stage.Open(layer)
    if stage is None:
        raise UnreadableUsd("is no USD file, or is broken")
    notes: list[str] = []
    skeleton, paths = _largest_skeleton(modules, stage, notes)
    parents = _parents(paths)
    names = [joint.rpartition("/")[2] for joint in paths]
    given = _values(skeleton.GetJointNamesAttr(), modules["Vt"].TokenArray)
    if len(given) == len(paths):
        names = [str(name) for name in given]
    if sum(map(len, names)) > MAX_TEXT:
        raise UnreadableUsd(
            "its joints have names that are too long", "Export the skeleton with shorter names.", "large"
        )
    matrices = _rest_pose(modules, skeleton, parents, notes)
    return {
        "names": names,
        "parents": parents,
        "matrices": [_numbers(matrix) for matrix in matrices],
        "unit": modules["UsdGeom"].GetStageMetersPerUnit(stage),
        "up": str(modules["UsdGeom"].GetStageUpAxis(stage)).lower(),
        "notes": notes,
    }


def _refuse_other_files(sdf: Any, layer: Any) -> None:
    """Refuse a layer that names another file anywhere, also in a variant that is not chosen."""
    count = 0

    def visit(path: Any) -> None:
        nonlocal count
        count += 1
        if count > MAX_SPECS:
            raise UnreadableUsd(f"over {MAX_SPECS:,} prims and properties", FLAT, "large")
        if fault := _other_file(sdf, layer.GetObjectAtPath(path)):
            raise UnreadableUsd(f"{fault} at {path}", FLAT)

    layer.Traverse(sdf.Path.absoluteRootPath, visit)


def _other_file(sdf: Any, spec: Any) -> str | None:
    """Return how a part of a layer names another file, if it does."""
    if spec is None:  # a target of a relationship
        return None
    assets = str(getattr(spec, "typeName", "")) in ("asset", "asset[]")
    for name in spec.ListInfoKeys():
        if name in ARCS:
            return f"holds {ARCS[name]}"
        if name in UNSEEN or (not assets and name in ("default", "timeSamples")):
            continue
        try:
            value = spec.GetInfo(name)
        except TypeError:  # one that Python cannot see
            return f"holds a {name} that cannot be checked"
        if _has_asset(sdf, value):
            return "names another file"
    return None


def _has_asset(sdf: Any, value: Any) -> bool:
    """Return True if a value holds a path to a file, at any depth."""
    if isinstance(value, sdf.AssetPath):
        return bool(value.path)
    below: Iterable[Any] = ()
    if isinstance(value, dict):
        below = cast("dict[Any, Any]", value).values()
    elif isinstance(value, (list, tuple, sdf.AssetPathArray)):
        below = cast("Sequence[Any]", value)
    return any(_has_asset(sdf, each) for each in below)


def _largest_skeleton(modules: dict[str, Any], stage: Any, notes: list[str]) -> tuple[Any, list[str]]:
    """Return the skeleton with the most joints, and the paths of its joints."""
    found: list[tuple[Any, list[str]]] = []
    for prim in stage.Traverse():
        if prim.IsA(modules["UsdSkel"].Skeleton):
            skeleton = modules["UsdSkel"].Skeleton(prim)
            found.append(
                (skeleton, [str(path) for path in _values(skeleton.GetJointsAttr(), modules["Vt"].TokenArray)])
            )
    found = [(skeleton, paths) for skeleton, paths in found if paths]
    if not found:
        raise UnreadableUsd("holds no skeleton", "Export the character with its bones, as UsdSkel.")
    skeleton, paths = max(found, key=lambda each: len(each[1]))
    if len(found) > 1:
        notes.append(f"{len(found)} skeletons in the file; the largest, {skeleton.GetPath()}, is read")
    if len(paths) > MAX_JOINTS:
        raise UnreadableUsd(f"{len(paths)} joints, over the limit of {MAX_JOINTS}", kind="large")
    return skeleton, paths


def _parents(paths: Sequence[str]) -> list[int]:
    """Return the parent of each joint: the nearest path above it that is a joint, -1 for a root."""
    place = {path: joint for joint, path in enumerate(paths)}
    if len(place) < len(paths):
        raise UnreadableUsd("two joints have one path")
    parents: list[int] = []
    for joint, path in enumerate(paths):
        upper = path.rpartition("/")[0]
        while upper and upper not in place:
            upper = upper.rpartition("/")[0]
        parents.append(place.get(upper, -1))
        if parents[-1] >= joint:
            raise UnreadableUsd(f"the joint {path[:200]!r} stands before its parent")
    return parents


def _rest_pose(modules: dict[str, Any], skeleton: Any, parents: Sequence[int], notes: list[str]) -> list[Any]:
    """Return the matrices of the joints in the stage.

    The bind pose is of the world by the specification, and of the skeleton in files of some exporters. Where the rest
    pose, which is always of the skeleton, is the same pose, it decides: the stage says where the skeleton stands.
    """
    kind = modules["Vt"].Matrix4dArray
    bind = _matrices(_values(skeleton.GetBindTransformsAttr(), kind), len(parents))
    rest = _matrices(_values(skeleton.GetRestTransformsAttr(), kind), len(parents))
    if bind is not None and (rest is None or not _is_pose_of(rest, bind, parents)):
        if rest is not None:
            notes.append("its rest transforms are another pose than its bind transforms, which are taken")
        return bind
    if rest is None:
        raise UnreadableUsd("states no rest pose of its skeleton", "Export the character with its bind pose.")
    world: list[Any] = []
    now = modules["Usd"].TimeCode.EarliestTime()
    place = modules["UsdGeom"].Imageable(skeleton.GetPrim()).ComputeLocalToWorldTransform(now)
    for joint, parent in enumerate(parents):
        world.append(rest[joint] * (world[parent] if parent >= 0 else place))
    return world


def _values(attribute: Any, kind: type) -> list[Any]:
    """Return the values of an attribute; none where it is not there, or is of another type than the schema says."""
    values = attribute.Get()
    return list(values) if isinstance(values, kind) else []


def _matrices(matrices: list[Any], joints: int) -> list[Any] | None:
    """Return matrices; None where there is not one for each joint, or they are without size."""
    fits = len(matrices) == joints and all(matrix.GetDeterminant() != 0 for matrix in matrices)
    return matrices if fits else None


def _is_pose_of(rest: list[Any], bind: list[Any], parents: Sequence[int]) -> bool:
    """Return True if local matrices are the pose of world matrices, but for where the roots stand."""
    for joint, parent in enumerate(parents):
        if parent >= 0:
            local, given = _numbers(bind[joint] * bind[parent].GetInverse()), _numbers(rest[joint])
            size = 1 + max(map(abs, local))
            if not all(abs(a - b) <= SAME * size for a, b in zip(local, given, strict=True)):
                return False
    return True


def _numbers(matrix: Any) -> list[float]:
    return [value for row in matrix for value in row]


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
