"""Figures of motions: what formats, rigs, operations and the finish of motions make of a few drawn ones.

Texts and whole numbers are kept as they are, other numbers in condensed form, for a comparison that rounding on another
processor passes and a change of the program does not.
"""

from __future__ import annotations

import io
import json
import re
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from marey.core.package import own_version
from marey.exporters import Coordinates, exporter_of
from marey.motion import edit
from marey.motion.carrying import carrying_contacts
from marey.motion.clip import MotionClip
from marey.motion.export_options import REFERENCE_RIGS
from marey.motion.features import LAYOUTS, HeadingLayout
from marey.motion.feet import rule_for
from marey.motion.finish import finish_motion
from marey.motion.io import fbx_parse
from marey.motion.io.convert import as_motion_clip
from marey.motion.io.fbx_parse import FbxFile, Packed, ReadNode
from marey.motion.kinematics import forward_kinematics
from marey.motion.live import LiveMotion
from marey.motion.pivoting import on_balls
from marey.motion.retarget import on_body
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.read import parse_rig
from marey.motion.rigs.report import describe
from marey.motion.rotations import about, from_rotvec, rotate
from marey.motion.running import on_its_steps, running_frames, with_flights, with_running_steps
from marey.motion.skeleton import HUMANML3D, Skeleton
from tests.support import bodies
from tests.support.changed_rigs import Change
from tests.support.loops import walked
from tests.support.motions import dancer, drift
from tests.support.rigged import rigged
from tests.support.walker import walker

Array = NDArray[np.floating]
PARTS, DIGITS = 8, 6
"""Stretches that an array is summed by, and significant digits of a sum."""
CLOSE = 2e-4
"""Share of the sum of absolute numbers of a stretch by which its sums may differ."""
FEW = 64
"""Numbers that are kept as they are."""
CHANGES = 8
"""Changed copies of a body that motions are put on."""
WRITTEN: Mapping[str, Sequence[Mapping[str, Any]]] = {
    "bvh": [{}, {"bvh_root": "offset"}, {"unit": "m", "up": "z"}, {"names": "ue5"}],
    "fbx": [{}, {"mesh": True}, {"up": "z", "unit": "m"}, {"names": "humanik"}],
    "glb": [{}, {"mesh": True}, {"names": "mixamo"}],
    "vrma": [{}],
    "npz": [{}],
}
EVERYWHERE: Sequence[Mapping[str, Any]] = [
    {"root_bone": True},
    {"in_place": "travel"},
    {"in_place": "heading", "root_bone": True},
    {"tpose_frame": True},
    {"placement": "keep"},
    {"body": "mixamo"},
    *({"rig": rig} for rig in REFERENCE_RIGS),
    {"rig": "mixamo", "in_place": "travel", "tpose_frame": True},
    {"rig": "humanik", "root_bone": True},
]
"""Options that formats have, if they have them."""
OPERATIONS: Mapping[str, Sequence[Mapping[str, Any]]] = {
    "trim": [{"op": "trim", "from": 0.35, "to": 1.6}],
    "split": [{"op": "split", "at": "f17"}],
    "loop": [{"op": "loop"}],
    "loop, open": [{"op": "loop", "end": "open", "blend": 0.2}],
    "loop in place": [{"op": "loop"}, {"op": "in-place"}],
    "mirror": [{"op": "mirror"}],
    "faster": [{"op": "speed", "factor": 1.4}],
    "slower": [{"op": "speed", "factor": 0.6}],
    "in place": [{"op": "in-place"}],
    "in place and ahead": [{"op": "in-place", "remove": "heading"}],
    "reverse": [{"op": "reverse"}],
    "smooth": [{"op": "smooth", "hz": 4}],
    "rate": [{"op": "fps", "rate": 24}],
    "lock": [{"op": "feet", "mode": "lock"}],
    "free": [{"op": "feet", "mode": "free"}],
}


def figures() -> dict[str, Any]:
    """Everything, by what it is of."""
    return {
        "files": dict(_files()),
        "rigs": dict(_rigs()),
        "operations": dict(_operations()),
        "features": dict(_features()),
        "finish": dict(_finished()),
        "live": {"run": condensed(_live())},
        "feet": dict(_feet()),
    }


def moved() -> MotionClip:
    """A walk in a curve, from elsewhere."""
    clip = walker(seconds=1.5, turn=0.7)
    place = {"heading": 0.4, "x": 1.0, "z": 2.0}
    manifest = {"prompt": "a person walks", "licence": "CC-BY-4.0", "placement": place}
    return MotionClip.of(HUMANML3D, clip.rotations, clip.root, clip.contacts, 20.0, manifest=manifest)


def dance(seed: int = 3, frames: int = 50) -> MotionClip:
    """A dancer who turns every joint."""
    rotations, root = dancer(seed, frames)
    return MotionClip.of(HUMANML3D, rotations, root, np.zeros((frames, 4), bool), 20.0, manifest={"prompt": "dances"})


def _files() -> Iterator[tuple[str, Any]]:
    for name, own in WRITTEN.items():
        exporter = exporter_of(name)
        having = [each for each in EVERYWHERE if each.keys() <= exporter.options | {"body"}]
        for options in [*own, *having]:
            for of, clip in (("walk", moved()), ("dance", dance())):
                if of == "walk" or options in ({}, {"rig": "ue4"}):
                    data = exporter.write(clip, Coordinates(**options))
                    yield f"{name} of a {of} {_named(options)}", condensed(opened(data, name))
                    if exporter.decode is not None and "rig" not in options:
                        back = as_motion_clip(exporter.decode(data, name, Coordinates(**options)))
                        yield f"{name} of a {of} {_named(options)}, read", condensed(_of_clip(back))


def _named(options: Mapping[str, Any]) -> str:
    return json.dumps(options, sort_keys=True)


def _rigs() -> Iterator[tuple[str, Any]]:
    for rig in REFERENCE_RIGS:
        for name in ("bvh", "fbx", "glb"):
            data = exporter_of(name).write(walker(seconds=0.2), Coordinates(rig=rig))
            read = parse_rig(data, f"{rig}.{name}")
            about_it = describe(RigBody.of(read))
            yield f"{name} of {rig}", condensed({**about_it, "sha256": "", "places": read.positions})
    for seed in range(CHANGES):
        changed = Change.draw(seed).rig()
        body = RigBody.of(changed, sized=False)
        motion = on_body(dance(seed) if seed % 2 else walker(turn=0.5), body)
        turns, places = motion.world()
        found = {"parts": describe(body)["parts"], "others": describe(body)["others"]}
        yield f"changed body {seed}", condensed({**found, "turns": _signed(turns), "places": places})


def _operations() -> Iterator[tuple[str, Any]]:
    for of, clip in (("walk", walked()), ("turn", walker(seconds=3.0, turn=0.7)), ("dance", dance())):
        for name, ops in OPERATIONS.items():
            if name.startswith("loop") and of != "walk":
                continue
            yield f"{name} of a {of}", condensed([_of_clip(each) for each in edit(clip, ops)])
    joined = edit(
        walker(turn=0.4), [{"op": "concat", "with": dance()}, {"op": "concat", "with": walked(), "blend": 0.5}]
    )
    yield "concat", condensed([_of_clip(each) for each in joined])


def _features() -> Iterator[tuple[str, Any]]:
    for name, layout in LAYOUTS.items():
        if not isinstance(layout, HeadingLayout):
            features = layout.encode_pose(*rigged(2, turns=0.5))  # pyright: ignore[reportAttributeAccessIssue]
        else:
            features = layout.encode(_swaying(layout.skeleton))
        mirrored = layout.mirror(features)
        yield name, condensed({"features": features, "mirrored": mirrored, "joints": layout.decode(features)})


def _swaying(skeleton: Skeleton) -> Array:
    """Joints of a body that sways and walks off."""
    frames = 50
    vectors = drift(4, frames, 3 * len(skeleton), 0.2).reshape(frames, -1, 3)
    vectors[:, 0] *= 0.4
    root = np.array([0.0, 0.9, 0.0]) + np.linspace(0.0, 2.0, frames)[:, None] * [0.3, 0.0, 1.0]
    return forward_kinematics(skeleton, from_rotvec(vectors), root)


def _finished() -> Iterator[tuple[str, Any]]:
    bodies_of = {"walk": bodies.walker(), "run": bodies.runner(), "wave": bodies.waver("left"), "bow": bodies.bower()}
    for of, joints in bodies_of.items():
        layout = LAYOUTS["humanml3d-263"]
        assert isinstance(layout, HeadingLayout)
        features = layout.encode(joints)
        for options in ({}, {"fps": 30.0}, {"clean": False}):
            yield f"{of} {_named(options)}", condensed(_of_clip(finish_motion(features, layout, **options)))


def _live() -> list[Any]:
    layout = LAYOUTS["humanml3d-263"]
    assert isinstance(layout, HeadingLayout)
    motion = LiveMotion(layout)
    state, seen = motion.start(), list[Any]()
    for frame in layout.encode(bodies.runner())[:40]:
        frames, state = motion.step(frame[None], state)
        seen.append([frames.root, frames.joints, frames.contacts, _signed(frames.rotations)])
    return [np.concatenate([each[part] for each in seen]) for part in range(4)]


def _feet() -> Iterator[tuple[str, Any]]:
    fps = 20.0
    for name, joints in {"run": bodies.runner(), "walk": bodies.walker(), "spin": _spinning()}.items():
        rule = rule_for(joints, fps)
        contacts = carrying_contacts(joints, HUMANML3D, fps, rule=rule)
        going = running_frames(joints, HUMANML3D, fps)
        steps = with_running_steps(joints, contacts, going, HUMANML3D, fps)
        fallen = with_flights(joints, steps, going, HUMANML3D, fps)
        found = {"contacts": contacts, "going": going, "steps": steps, "flights": fallen}
        found |= {
            "on its steps": on_its_steps(joints, going, HUMANML3D, fps),
            "on balls": on_balls(joints, HUMANML3D, fps),
        }
        yield name, condensed(found)


def _spinning() -> Array:
    """A body that turns about its right ankle between two stands."""
    joints = np.array(bodies.walker(2.0)[:1].repeat(40, axis=0), np.float64)
    angle = np.radians(110.0) * np.clip((np.arange(40) - 16) / 9, 0.0, 1.0)
    middle = joints[:, 8] * [1.0, 0.0, 1.0]
    turned = np.asarray(rotate(about("Y", angle)[:, None], joints - middle[:, None]) + middle[:, None])
    turned[17:25, [7, 10], 1] += 0.1
    return turned


def _of_clip(clip: MotionClip) -> dict[str, Any]:
    kept = {name: value for name, value in clip.manifest.items() if name in ("edits", "loop", "placement", "cycle")}
    return {
        "joints": clip.joints, "root": clip.root, "rotations": _signed(clip.rotations), "contacts": clip.contacts,
        "fps": clip.fps, "manifest": json.loads(re.sub(r"[0-9a-f]{64}", "sha256", json.dumps(kept))),
    }  # fmt: skip


def _signed(quaternions: Array) -> Array:
    """The same rotations, with a positive first number that is not zero."""
    turned = np.asarray(quaternions, np.float64)
    largest = np.take_along_axis(turned, np.abs(turned).argmax(-1)[..., None], -1)
    return turned * np.where(largest < 0, -1.0, 1.0)


def opened(data: bytes, name: str) -> Any:
    """A file as JSON and arrays."""
    return OPENERS[name](data)


def _bvh(data: bytes) -> Any:
    head, _, motion = data.decode().partition("MOTION")
    rows = [line.split() for line in motion.splitlines() if line.strip()]
    numbers = [float(word) for row in rows[2:] for word in row]
    words = [re.fullmatch(r"-?\d+\.\d+", word) is None for word in head.split()]
    said = [word for word, is_text in zip(head.split(), words, strict=True) if is_text]
    offsets = [float(word) for word, is_text in zip(head.split(), words, strict=True) if not is_text]
    told = zlib.crc32(" ".join(said).encode())
    return {"words": [len(said), told], "rows": rows[:2], "offsets": np.array(offsets), "motion": np.array(numbers)}


def _fbx(data: bytes) -> Any:
    with patch.object(fbx_parse, "SKIPPED", frozenset[str]()):  # meshes and materials too
        file = FbxFile(data, "figures")
    found = dict[str, _Parted]()

    def read(node: ReadNode, into: _Parted) -> None:
        into.texts.append(node.name)
        for value in node.properties:
            into.add(file.array(node, value.letter, most=10**6) if isinstance(value, Packed) else value)
        for each in node.children:
            read(each, into)

    for top in file.top:
        for node in top.children if top.name in ("Objects", "Definitions") else [top]:
            read(node, found.setdefault(f"{top.name} {node.name}", _Parted()))
    return {name: part.figures() for name, part in found.items()}


class _Parted:
    """Texts and whole numbers of a part of a file, which are kept by their checksum, and its other numbers."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self.numbers: list[float] = []

    def add(self, value: Any) -> None:
        if isinstance(value, float):
            self.numbers.append(value)
        elif isinstance(value, np.ndarray) and value.dtype.kind == "f":
            self.numbers += value.ravel().tolist()
        elif isinstance(value, np.ndarray):
            self.texts.append(str(value.tolist()))
        elif isinstance(value, Mapping):
            for key in sorted(value):
                self.texts.append(str(key))
                self.add(value[key])
        elif isinstance(value, list):
            self.texts.append(str(len(value)))
            for each in value:
                self.add(each)
        else:
            self.texts.append(repr(value))

    def figures(self) -> Any:
        """The count of texts, their checksum, and the numbers."""
        told = zlib.crc32("\n".join(self.texts).replace(own_version(), "VERSION").encode())
        return [len(self.texts), told, np.array(self.numbers)] if self.numbers else [len(self.texts), told]


def _glb(data: bytes) -> Any:
    length = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + length])
    binary = data[28 + length :]
    kinds = {5120: "i1", 5121: "u1", 5122: "i2", 5123: "u2", 5125: "u4", 5126: "f4"}
    found = {name: _Parted() for name in sorted(document)}
    for name, part in found.items():
        part.add(document[name])
    arrays = list[Array]()
    for each in document["accessors"]:
        view = document["bufferViews"][each["bufferView"]]
        at = view.get("byteOffset", 0) + each.get("byteOffset", 0)
        width = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}[each["type"]]
        numbers = np.frombuffer(binary, kinds[each["componentType"]], each["count"] * width, at)
        turns = each["type"] == "VEC4" and each["componentType"] == 5126
        arrays.append((_signed(numbers.reshape(-1, 4)) if turns else numbers).ravel().astype(np.float64))
    told = {name: part.figures() for name, part in found.items()}
    return {**told, "arrays": [len(arrays), np.concatenate(arrays)]}


def _npz(data: bytes) -> Any:
    with np.load(io.BytesIO(data)) as arrays:
        return {name: arrays[name] for name in arrays.files if arrays[name].dtype.kind in "fiub"}


OPENERS: Mapping[str, Callable[[bytes], Any]] = {"bvh": _bvh, "fbx": _fbx, "glb": _glb, "vrma": _glb, "npz": _npz}


def condensed(value: Any) -> Any:
    """A value as JSON: arrays and long lists of numbers by their shape and their sums."""
    if isinstance(value, np.ndarray):
        return _sums(value)
    if isinstance(value, Mapping):
        return {str(key): condensed(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        if len(value) > FEW and all(isinstance(each, int | float) for each in value):
            return _sums(np.asarray(value))
        return [condensed(each) for each in value]
    if isinstance(value, np.generic):
        value = value.item()
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def _sums(array: Any) -> dict[str, Any]:
    """The shape of an array, and of stretches of it the sum, that with weights, and that of absolute numbers."""
    flat = np.asarray(array, np.float64).ravel()
    weights, parts = np.cos(np.arange(len(flat)) * 0.7) * 1.3, max(min(PARTS, len(flat) // PARTS), 1)
    found = [
        [float(f"{part:.{DIGITS}g}") for part in (each.sum(), (each * weight).sum(), np.abs(each).sum())]
        for each, weight in zip(np.array_split(flat, parts), np.array_split(weights, parts), strict=True)
    ]
    return {"shape": list(np.shape(array)), "sums": found}


def differences(recorded: Any, found: Any, where: str = "") -> Iterator[str]:
    """Yield where two condensed values differ by more than rounding."""
    if isinstance(recorded, dict) and isinstance(found, dict):
        if "sums" in recorded and "sums" in found and recorded["shape"] == found["shape"]:
            for number, (a, b) in enumerate(zip(recorded["sums"], found["sums"], strict=True)):
                if max(abs(x - y) for x, y in zip(a, b, strict=True)) > CLOSE * max(a[2], b[2]) + 1e-5:
                    yield f"{where}: stretch {number} of {recorded['shape']}: {a} was recorded, {b} is there"
                    return
            return
        for key in sorted({*recorded, *found}):
            if key not in recorded or key not in found:
                yield f"{where}/{key}: only {'recorded' if key in recorded else 'there now'}"
            else:
                yield from differences(recorded[key], found[key], f"{where}/{key}")
    elif isinstance(recorded, list) and isinstance(found, list) and len(recorded) == len(found):
        for number, (a, b) in enumerate(zip(recorded, found, strict=True)):
            yield from differences(a, b, f"{where}/{number}")
    elif isinstance(recorded, int | float) and isinstance(found, int | float) and not isinstance(recorded, bool):
        if abs(recorded - found) > CLOSE * max(abs(recorded), abs(found)) * isinstance(recorded, float) + 1e-5:
            yield f"{where}: {recorded} was recorded, {found} is there"
    elif recorded != found:
        yield f"{where}: {str(recorded)[:80]} was recorded, {str(found)[:80]} is there"
