"""Rigs and motions of FBX files: transforms against a second way to compute them, and files that are broken."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable

import numpy as np
import pytest

from marey.core.errors import InvalidFile, InvalidInput, TooLarge
from marey.motion.clip import MotionClip
from marey.motion.io import fbx_parse
from marey.motion.io.fbx_document import time_mode
from marey.motion.io.fbx_nodes import MAGIC, Long, node
from marey.motion.io.fbx_read import parse_fbx
from marey.motion.io.fbx_scene import read_scene
from marey.motion.io.fbx_write import format_fbx
from marey.motion.io.rig_fbx import parse_fbx_rig
from marey.motion.io.rigged_fbx import format_rigged_fbx
from marey.motion.rigs.read import read_rig
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import angle_between, from_rotvec, multiply
from marey.motion.skeleton import Skeleton
from tests.support.archives import archive
from tests.support.fbx import extended, scene_file
from tests.support.walker import walker

ORDERS = ("XYZ", "XZY", "YZX", "YXZ", "ZXY", "ZYX")
"""As FBX names them: the first axis turns first."""


def turned(axis: str, degrees: float) -> np.ndarray:
    """A matrix (4, 4) about an axis, from its definition."""
    i, j = {"X": (1, 2), "Y": (2, 0), "Z": (0, 1)}[axis]
    matrix, angle = np.eye(4), np.radians(degrees)
    matrix[i, i] = matrix[j, j] = np.cos(angle)
    matrix[j, i], matrix[i, j] = np.sin(angle), -np.sin(angle)
    return matrix


def euler(angles: np.ndarray, order: str = "XYZ") -> np.ndarray:
    matrix = np.eye(4)
    for axis in order:
        matrix = turned(axis, angles["XYZ".index(axis)]) @ matrix
    return matrix


def shifted(vector: np.ndarray) -> np.ndarray:
    matrix = np.eye(4)
    matrix[:3, 3] = vector
    return matrix


def local_matrix(p: dict[str, np.ndarray], order: str) -> np.ndarray:
    """The product of the SDK's documentation, factor by factor."""
    inverse = np.linalg.inv
    return (
        shifted(p["Lcl Translation"]) @ shifted(p["RotationOffset"]) @ shifted(p["RotationPivot"])
        @ euler(p["PreRotation"]) @ euler(p["Lcl Rotation"], order) @ inverse(euler(p["PostRotation"]))
        @ inverse(shifted(p["RotationPivot"])) @ shifted(p["ScalingOffset"]) @ shifted(p["ScalingPivot"])
        @ np.diag([*p["Lcl Scaling"], 1]) @ inverse(shifted(p["ScalingPivot"]))
    )  # fmt: skip


@pytest.mark.parametrize("order", range(6))
@pytest.mark.parametrize("inherit", [0, 1, 2])
def test_joints_are_where_the_documented_product_puts_them(order: int, inherit: int) -> None:
    random = np.random.default_rng(10 * order + inherit)
    names = ("Lcl Translation", "RotationOffset", "RotationPivot", "ScalingOffset", "ScalingPivot")
    chains = [{name: random.normal(0, 3, 3) for name in names} for _ in range(4)]
    for each in chains:
        each |= {name: random.uniform(-180, 180, 3) for name in ("PreRotation", "PostRotation", "Lcl Rotation")}
        each["Lcl Scaling"] = np.full(3, random.uniform(0.5, 2))
    models = [
        (
            f"j{k}",
            k - 1,
            {name: tuple(v) for name, v in each.items()} | {"RotationOrder": (order,), "InheritType": (inherit,)},
        )
        for k, each in enumerate(chains)
    ]
    rig = parse_fbx_rig(scene_file(models, {"UnitScaleFactor": 2.5}))
    world, scale = np.eye(4), 1.0
    for joint, each in enumerate(chains):
        local = local_matrix(each, ORDERS[order])
        if inherit == 2 and joint:  # the parent's own scale reaches the place of a joint, and not the joint
            place = world @ local[:, 3]
            world = world @ np.diag([*(3 * (1 / scale,)), 1]) @ local
            world[:, 3] = place
        else:
            world = world @ local
        scale = each["Lcl Scaling"][0]
        np.testing.assert_allclose(rig.positions[joint], world[:3, 3] * 0.025, atol=1e-9)
        np.testing.assert_allclose(rig.scales[joint], np.linalg.norm(world[:3, 0]) * 0.025, rtol=1e-9)


AXES = {
    "Y up": ({}, "y", (0.0, 0.0, 1.0)),
    "Z up": ({"UpAxis": 2, "FrontAxis": 1, "FrontAxisSign": -1}, "z", (0.0, 1.0, 0.0)),
    "X up": ({"UpAxis": 0, "FrontAxis": 2, "CoordAxis": 1, "CoordAxisSign": -1}, "y", (0.0, 0.0, 1.0)),
}


@pytest.mark.parametrize("name", AXES)
def test_axes_are_turned_to_y_up(name: str) -> None:
    settings, up, raised = AXES[name]
    rig = parse_fbx_rig(scene_file([("a", -1, {"Lcl Translation": (0.0, 0.0, 100.0)})], settings))
    assert rig.up == up
    np.testing.assert_allclose(rig.positions[0], raised, atol=1e-9)


def test_left_handed_axes_are_refused() -> None:
    with pytest.raises(InvalidFile, match=r"^hero: .*left-handed"):
        parse_fbx_rig(scene_file([("a", -1, {})], {"FrontAxisSign": -1}), "hero")


@pytest.mark.parametrize(
    ("models", "message"),
    [
        ([("a", 1, {}), ("b", 0, {})], "circle"),
        ([("a", 0, {})], "circle"),
        ([], "no skeleton"),
        ([("a", -1, {"Lcl Scaling": (1.0, 2.0, 1.0)})], "stretched"),
        ([("a", -1, {"Lcl Scaling": (0.0, 0.0, 0.0)})], "no size"),
        ([("a", -1, {"Lcl Scaling": (-1.0, 1.0, 1.0)})], "mirrored"),
        ([("a", -1, {"Lcl Translation": (float("nan"), 0.0, 0.0)})], "NaN"),
        ([(f"j{k}", k - 1, {}) for k in range(2001)], "over the limit"),
    ],
)  # fmt: skip
def test_a_skeleton_that_is_none_is_refused(models, message: str) -> None:
    with pytest.raises(InvalidInput, match=f"^hero: .*({message})"):
        parse_fbx_rig(scene_file(models), "hero")


@pytest.mark.data
@pytest.mark.parametrize(
    "name", ["maya_human_ik_7400_binary.fbx", "91_48.fbx", "rig-human.glb", "m2m-wrong-bone-names.glb"]
)
def test_a_motion_on_a_rig_is_written_and_read_again(name: str) -> None:
    rig = read_rig(archive(f"rigs/{name}"))
    random = np.random.default_rng(0)
    turns = from_rotvec(random.normal(0, 0.5, (4, len(rig), 3)))
    places = np.broadcast_to(rig.offsets, (4, len(rig), 3)).copy()
    moving = np.arange(len(rig)) == 1
    places[:, 1] += random.normal(0, 0.2, (4, 3))
    rotations = multiply(np.broadcast_to(rig.local_rotations, turns.shape), turns)
    motion = RiggedMotion(rig, rotations, places, moving, np.zeros((4, 4), bool), 24.0)
    data = format_rigged_fbx(motion)
    back = parse_fbx_rig(data)
    assert back.joint_names == rig.joint_names
    np.testing.assert_allclose(back.positions, rig.positions, atol=2e-4)
    np.testing.assert_allclose(np.abs((back.orientations * rig.orientations).sum(axis=-1)), 1, atol=1e-9)
    if rig.source == "fbx":
        assert (back.unit, back.up) == (rig.unit, rig.up)
        np.testing.assert_allclose(back.scales, rig.scales)
    seen = parse_fbx(data)
    order = [rig.index(joint) for joint in seen.skeleton.joint_names]
    size = np.ptp(rig.positions, axis=0).max()
    assert np.abs(seen.joints() - motion.world()[1][:, order]).max() < 1e-5 * size


def changed(old: bytes, new: bytes) -> Callable[[bytes], bytes]:
    def change(data: bytes) -> bytes:
        assert old in data
        return data.replace(old, new, 1)

    return change


def array_claims(count: int) -> Callable[[bytes], bytes]:
    def change(data: bytes) -> bytes:
        at = data.index(b"KeyTime") + len(b"KeyTime") + 1
        return data[:at] + struct.pack("<I", count) + data[at + 4 :]

    return change


BROKEN = {
    "nothing": lambda data: b"",
    "an npz": lambda data: walker().to_npz(),
    "text": lambda data: b"; FBX 7.4.0 project file\nFBXHeaderExtension:  {\n}\n",
    "the magic alone": lambda data: data[:23],
    "FBX 6.1": changed(struct.pack("<I", 7400), struct.pack("<I", 6100)),
    "FBX 9": changed(struct.pack("<I", 7400), struct.pack("<I", 9000)),
    "cut in a node": lambda data: data[: len(data) // 2],
    "an array of 4 billion numbers": array_claims(2**32 - 1),
    "an array of fewer numbers": array_claims(3),
    "no animation": lambda data: data.replace(b"AnimationStack", b"AnimationStick"),
    "no objects": lambda data: data.replace(b"Objects", b"Abjects"),
    "a rate of none": changed(b"CustomFrameRate", b"CustomFrameRude"),
    "an unknown property": changed(b"\x05CountI", b"\x05CountQ"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_or_foreign_file_is_refused(name: str) -> None:
    with pytest.raises((InvalidFile, TooLarge)) as raised:
        parse_fbx(BROKEN[name](format_fbx(walker(seconds=0.2))), "a.fbx")
    assert str(raised.value).startswith("a.fbx: ")


def test_an_ascii_file_is_refused_with_advice() -> None:
    with pytest.raises(InvalidFile, match="Export it as binary FBX"):
        parse_fbx_rig(BROKEN["text"](b""), "a.fbx")


@pytest.mark.parametrize(
    "start",
    [b"; FBX 7.4.0 project file\n" + b"; comment\n" * 300, b" \n\t;FBX", b"FBXHeaderExtension:  {\n", b";"],
    ids=["comments alone", "blanks", "no comment", "one character"],
)
def test_an_ascii_file_is_told_by_its_beginning(start: bytes) -> None:
    with pytest.raises(InvalidFile) as refused:
        parse_fbx(start, "a.fbx")
    assert refused.value.message == "is an ASCII FBX file; only binary ones are read"
    assert (refused.value.where, refused.value.hint) == ("a.fbx", fbx_parse.ASCII)


def test_the_motion_of_a_single_joint_is_read() -> None:
    """Of a prop, or a camera."""
    prop = Skeleton("prop", ("prop",), (-1,), np.zeros((1, 3), np.float32), (0,))
    turns = from_rotvec(np.linspace(0, 1, 5)[:, None, None] * [0.3, -0.4, 0.2])
    clip = MotionClip.of(prop, turns, np.linspace(0, 1, 5)[:, None] * [1.0, 2.0, 0.0], np.zeros((5, 4), bool), 20.0)
    read = parse_fbx(format_fbx(clip))
    assert read.skeleton.joint_names == ("prop",)
    assert read.positions is None
    np.testing.assert_allclose(read.root, clip.root, atol=1e-6)
    assert angle_between(read.rotations, turns).max() < 1e-5


def test_what_of_a_file_is_read_is_noted() -> None:
    """Of several skeletons, animations and layers one is, and a user should learn which."""
    data = format_fbx(walker(seconds=0.2))
    limb = node("Model", Long(77), "prop\0\1Model", "LimbNode")
    flags = node("NodeAttribute", Long(78), "\0\1NodeAttribute", "LimbNode", below=[node("TypeFlags", "Skeleton")])
    prop = [node("C", "OO", Long(77), Long(0)), node("C", "OO", Long(78), Long(77))]
    stack = next(Long(key) for key, each in read_scene(data, "a").objects.items() if each.name == "AnimationStack")
    layer = node("C", "OO", Long(80), stack)
    for objects, links, notes in (
        ([], [], ()),
        ([limb, flags], prop, ("2 skeletons in the file; that of 'pelvis' is read",)),
        (
            [node("AnimationStack", Long(79), "Take\0\1AnimStack", "")],
            [],
            ("2 animations in the file; the first that moves the skeleton is read",),
        ),
        (
            [node("AnimationLayer", Long(80), "L\0\1AnimLayer", "")],
            [layer],
            ("2 layers of animation; the first is read",),
        ),
    ):
        read = parse_fbx(extended(data, objects, links))
        assert read.notes == notes
        assert len(read.skeleton) == 22


def nested(depth: int) -> bytes:
    """Nodes in each other."""
    data = bytearray(MAGIC + struct.pack("<I", 7400))
    size = 14 * depth + 13 * (depth + 1)
    for level in range(depth):
        data += struct.pack("<IIIB", 27 + size - 13 * (level + 1), 0, 0, 1) + b"A"
    return bytes(data + bytes(13 * (depth + 1)))


def test_nodes_in_nodes_do_not_exhaust_the_stack() -> None:
    read_scene(nested(20), "a")
    with pytest.raises(InvalidFile, match="nested more than"):
        read_scene(nested(5000), "a")


def test_nodes_and_properties_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fbx_parse, "MAX_ITEMS", 1000)
    with pytest.raises(TooLarge, match=r"^a: .*than any rig has"):
        read_scene(format_fbx(walker(seconds=0.2)), "a")


def test_a_packed_array_takes_no_more_room_than_it_claims() -> None:
    bomb = zlib.compress(bytes(2**26))
    file = fbx_parse.FbxFile(nested(1), "a")
    packed = fbx_parse.Packed("l", 100, True, memoryview(bomb))
    with pytest.raises(InvalidFile, match="801 bytes, not 800"):
        file.array(fbx_parse.ReadNode("KeyTime", [packed], []), "l", most=100)
    large = fbx_parse.Packed("l", 2**31, True, memoryview(bomb))
    with pytest.raises(TooLarge):
        file.array(fbx_parse.ReadNode("KeyTime", [large], []), "l", most=2**32)


@pytest.mark.parametrize(
    ("settings", "fps"),
    [({}, 30.0), ({"TimeMode": 8}, 30000 / 1001), ({"TimeMode": 11}, 24.0), ({"TimeMode": 7}, 30.0),
     ({"TimeMode": 14, "CustomFrameRate": 12.5}, 12.5)],
)  # fmt: skip
def test_the_rate_is_that_of_the_time_mode(settings: dict[str, float], fps: float) -> None:
    assert read_scene(scene_file([("a", -1, {})], settings), "a.fbx").fps == pytest.approx(fps)


MODES = {1: 120, 2: 100, 3: 60, 4: 50, 5: 48, 6: 30, 7: 30, 8: 30000 / 1001, 9: 30000 / 1001, 10: 25, 11: 24, 12: 1000,
         13: 24000 / 1001, 15: 96, 16: 72, 17: 60000 / 1001, 18: 120000 / 1001}  # fmt: skip
"""Rates of `FbxTime::EMode` in the documentation of Autodesk's SDK; 7 and 8 are those with dropped frames."""


@pytest.mark.parametrize("mode", MODES)
def test_numbers_of_rates_are_those_of_the_sdk(mode: int) -> None:
    assert read_scene(scene_file([("a", -1, {})], {"TimeMode": mode}), "a.fbx").fps == pytest.approx(MODES[mode])
    if mode not in (7, 8):
        assert time_mode(MODES[mode]) == (mode, -1.0)


@pytest.mark.parametrize(
    ("content", "message"), [(b"L" + bytes(8), "ends beyond its node"), (b"?", "unknown type '\\?'")]
)
def test_a_property_ends_in_its_node_and_has_a_known_type(content: bytes, message: str) -> None:
    start = len(MAGIC) + 4 + 13 + 1
    node = struct.pack("<IIIB", start + 3, 1, 3, 1) + b"a" + content
    data = MAGIC + struct.pack("<I", 7400) + node + bytes(64)
    with pytest.raises(InvalidFile, match=rf"^hero: a property at byte {start} .*{message}"):
        fbx_parse.FbxFile(data, "hero")
