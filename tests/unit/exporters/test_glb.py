"""glb files, read by a reader that shares no code with the writer."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from marey.core.errors import InvalidFile, InvalidInput
from marey.exporters import Coordinates, exporter_of
from marey.exporters.convert import convert
from marey.motion.clip import MotionClip, load_npz
from marey.motion.io.bvh import write_bvh
from marey.motion.io.glb_read import parse_glb, read_glb
from marey.motion.io.glb_write import format_glb, write_glb
from marey.motion.skeleton import HUMANML3D, KIT, SNAPMOGEN, Skeleton
from tests.support.exported import tumbling
from tests.support.glb import Glb
from tests.support.walker import walker

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963  # of WebGL
RATES = (20.0, 24.0, 25.0, 30.0, 60.0, 24000 / 1001)
CLIPS = {
    **{f"a walk at {fps:.3f} fps": walker(fps=fps, turn=0.7) for fps in RATES},
    "one frame": walker(seconds=0),
    "tumbling KIT joints": tumbling(KIT, 12.5),
    "tumbling SnapMoGen joints": tumbling(SNAPMOGEN, 30),
}


@pytest.mark.parametrize("name", CLIPS)
def test_joints_are_at_key_times_where_the_clip_has_them(name: str) -> None:
    clip = CLIPS[name]
    seen = Glb.read(format_glb(clip))
    assert seen.names == list(clip.skeleton.joint_names)
    np.testing.assert_allclose(seen.times(), np.arange(clip.frames) / clip.fps, atol=1e-6)
    assert seen.joints().shape == clip.joints.shape
    assert np.linalg.norm(seen.joints() - clip.joints, axis=-1).max() < 1e-3
    turns = np.stack(list(seen.tracks("rotation").values()), axis=1)
    np.testing.assert_allclose(np.linalg.norm(turns, axis=-1), 1, atol=1e-5)
    assert (np.einsum("tji,tji->tj", turns[1:], turns[:-1]) >= 0).all(), "a sign jumps: LINEAR goes the long way"
    assert seen.extras["fps"] == clip.fps


@pytest.mark.parametrize("skeleton", [None, KIT, SNAPMOGEN], ids=["HumanML3D", "KIT", "SnapMoGen"])
def test_the_bind_pose_is_the_t_pose_with_the_toes_on_the_floor(skeleton) -> None:
    clip = walker() if skeleton is None else tumbling(skeleton, 30)
    seen = Glb.read(format_glb(clip))
    rest = seen.rest()
    assert rest[:, 1].min() == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(rest - rest[0], clip.skeleton.rest - clip.skeleton.rest[0], atol=1e-6)
    (skin,) = seen.document["skins"]
    assert skin["joints"] == list(range(len(clip.skeleton)))
    bound = np.tile(np.eye(4), (len(rest), 1, 1))
    bound[:, :3, 3] = rest
    inverse = seen.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)  # column-major
    np.testing.assert_allclose(inverse @ bound, np.tile(np.eye(4), (len(rest), 1, 1)), atol=1e-6)


def test_numbers_are_aligned_and_bounds_are_those_of_the_times() -> None:
    clip = walker(fps=24000 / 1001)
    document = Glb.read(format_glb(clip)).document
    assert all(view["byteOffset"] % 4 == 0 for view in document["bufferViews"])
    time = document["accessors"][document["animations"][0]["samplers"][0]["input"]]
    assert time["min"] == [0.0]
    assert time["max"] == [float(np.float32((clip.frames - 1) / clip.fps))]


def test_equal_clips_give_equal_bytes_whatever_the_order_of_their_manifests() -> None:
    one, other = ({"prompt": "a", "seed": 1}, {"seed": 1, "prompt": "a"})
    assert format_glb(replace(walker(), manifest=one)) == format_glb(replace(walker(), manifest=other))


def test_contacts_and_manifest_are_in_the_extras() -> None:
    contacts = np.zeros((41, 4), bool)
    contacts[2:5, 0] = contacts[40:, 0] = contacts[:, 3] = True
    manifest = {"prompt": "geht, ä", "loss": float("nan"), "steps": (1, {"far": float("inf")})}
    extras = Glb.read(format_glb(replace(walker(), contacts=contacts, manifest=manifest))).extras
    assert extras["contacts"] == {"L_ankle": [[2, 5], [40, 41]], "L_toe": [], "R_ankle": [], "R_toe": [[0, 41]]}
    assert extras["manifest"] == {"prompt": "geht, ä", "loss": None, "steps": [1, {"far": None}]}


@pytest.mark.parametrize("name", CLIPS)
def test_a_clip_comes_back_but_for_its_features(name: str) -> None:
    clip = CLIPS[name]
    data = format_glb(clip)
    back = parse_glb(data)
    np.testing.assert_array_equal(back.root, clip.root)
    np.testing.assert_allclose(back.joints, clip.joints, atol=1e-4)
    np.testing.assert_array_equal(back.contacts, clip.contacts)
    assert (back.fps, back.manifest, back.skeleton.name) == (clip.fps, clip.manifest, clip.skeleton.name)
    assert format_glb(back) == data, "erasure would change more than the manifest"


def test_a_clip_with_numbers_that_are_not_finite_is_refused() -> None:
    clip = walker()
    root = clip.root.copy()
    root[3, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"^humanml3d: .*NaN or infinite"):
        format_glb(replace(clip, root=root))


def test_it_is_converted_to_and_from_other_formats(tmp_path) -> None:
    clip = walker(turn=0.4)
    clip.save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.glb")
    assert (tmp_path / "b.glb").read_bytes() == exporter_of("glb").encode(clip, Coordinates())
    convert(tmp_path / "b.glb", tmp_path / "c.npz", fps=30)
    assert load_npz(tmp_path / "c.npz").fps == 30
    write_bvh(tmp_path / "d.bvh", clip)
    convert(tmp_path / "d.bvh", tmp_path / "e.glb")
    np.testing.assert_allclose(read_glb(tmp_path / "e.glb").joints, clip.joints, atol=1e-3)
    write_glb(tmp_path / "f.glb", clip)
    assert (tmp_path / "f.glb").read_bytes() == (tmp_path / "b.glb").read_bytes()


def broken() -> dict[str, bytes]:
    good = format_glb(walker(seconds=0.2))
    return {
        "nothing": b"",
        "an npz": walker().to_npz(),
        "cut off": good[:-4],
        "cut in its JSON": good[:300],
        "a first chunk of another kind": good.replace(b"JSON", b"JSOM", 1),
        "a second chunk of another kind": good.replace(b"BIN\0", b"BIM\0", 1),
        "another version": good[:4] + b"\1" + good[5:],
        "another program": good.replace(b'"generator":"Marey"', b'"generator":"Other"'),
        "no animation": good.replace(b'"animations"', b'"Animations"'),
        "no extras": good.replace(b'"extras"', b'"Extras"'),
        "whole numbers": good.replace(b'"componentType":5126', b'"componentType":5125'),
        "an accessor that is not there": good.replace(b'"output":7', b'"output":99', 1).replace(b"99", b"99", 1),
        "frames that are not there": good.replace(b'"L_ankle":[[0,', b'"L_ankle":[[9,'),
        "a joint that is its own parent": good.replace(b'"children":[1,2,3]', b'"children":[0,2,3]'),
        "numbers beyond the end": good.replace(b'"count":5', b'"count":6'),
        "no rate": good.replace(b'"fps":20.0', b'"fps":-2.0'),
        "NaN": good[:-4] + np.float32(np.nan).tobytes(),
        "a place beyond float32": good.replace(b'"translation":[0.0,', b'"translation":[9e9,', 1),
    }


def rewritten(change: Callable[[dict[str, Any], bytearray], Any]) -> bytes:
    """A file whose JSON and numbers were changed."""
    good = format_glb(walker(seconds=0.2))
    end = 20 + int.from_bytes(good[12:16], "little")
    document, numbers = json.loads(good[20:end]), bytearray(good[end + 8 :])
    text = json.dumps(change(document, numbers) or document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(numbers), b"BIN\0") + numbers
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def double_turns(document: dict[str, Any], numbers: bytearray) -> None:
    """Let the first rotation have the length 2."""
    track = document["animations"][0]["samplers"][0]["output"]
    at = document["bufferViews"][document["accessors"][track]["bufferView"]]["byteOffset"]
    numbers[at : at + 16] = np.array([0, 0, 0, 2], "<f4").tobytes()


def widen(document: dict[str, Any], numbers: bytearray) -> None:
    """Let bones be as long as float32 can say."""
    for node in document["nodes"][1:]:
        node["translation"] = [3e38, 0.0, 0.0]


def send_away(document: dict[str, Any], numbers: bytearray) -> None:
    """Let the motion have been taken from farther away than float32 can say."""
    extras = document["asset"]["extras"]
    extras["options"]["placement"] = "keep"
    extras["manifest"]["placement"] = {"x": 1e300, "z": 0.0, "heading": 0.0}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda *_: ["no object"], "its JSON is not an object"),
        (double_turns, "has no frames, or rotations that are none"),
        (widen, "holds NaN, or numbers over 1,000,000"),
        (send_away, "holds numbers that are too large"),
    ],
)
def test_numbers_that_no_motion_has_are_refused(change: Any, message: str) -> None:
    assert parse_glb(rewritten(lambda *_: None)).frames == 5
    with pytest.raises(InvalidFile, match=rf"^a\.glb: .*({message})"):
        parse_glb(rewritten(change), "a.glb")


@pytest.mark.parametrize("name", broken())
def test_a_broken_or_foreign_file_is_refused(name: str) -> None:
    with pytest.raises(InvalidFile) as raised:
        parse_glb(broken()[name], "a.glb")
    assert str(raised.value).startswith("a.glb: ")


def test_the_type_is_the_registered_one() -> None:
    assert exporter_of("glb").media_type == "model/gltf-binary"
    assert isinstance(parse_glb(format_glb(walker())), MotionClip)


@pytest.mark.parametrize("root_bone", [False, True])
@pytest.mark.parametrize("skeleton", [HUMANML3D, SNAPMOGEN], ids=["HumanML3D", "SnapMoGen"])
def test_a_body_is_bound_at_rest_and_stands_on_the_floor(skeleton: Skeleton, root_bone: bool) -> None:
    clip = walker() if skeleton is HUMANML3D else tumbling(skeleton, 30)
    seen = Glb.read(exporter_of("glb").write(clip, Coordinates(mesh=True, root_bone=root_bone)))
    (mesh,) = seen.document["meshes"]
    (primitive,) = mesh["primitives"]
    points, normals, weights = (
        seen.accessor(primitive["attributes"][name]) for name in ("POSITION", "NORMAL", "WEIGHTS_0")
    )
    carriers = seen.accessor(primitive["attributes"]["JOINTS_0"])[:, 0]
    triangles = seen.accessor(primitive["indices"]).reshape(-1, 3)
    assert weights.tolist() == [[1, 0, 0, 0]] * len(points)
    accessors, views = seen.document["accessors"], seen.document["bufferViews"]
    uses = [views[accessors[number]["bufferView"]].pop("target") for number in primitive["attributes"].values()]
    assert set(uses) == {ARRAY_BUFFER}
    assert views[accessors[primitive["indices"]]["bufferView"]].pop("target") == ELEMENT_ARRAY_BUFFER
    assert not any("target" in view for view in views), "what is of no mesh is for no buffer of it"
    span = float(np.ptp(clip.skeleton.rest[:, 1]))
    assert -0.03 * span < points[:, 1].min() < 0.02 * span, "its soles are on the floor"
    assert 1.05 * span < np.ptp(points[:, 1]) < 1.25 * span
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, atol=1e-5)
    corners = points[triangles]
    outside = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    solid = np.linalg.norm(outside, axis=-1) > 1e-9
    assert (np.einsum("fk,fk->f", outside, normals[triangles].mean(axis=1))[solid] > 0).all(), "faces look inwards"
    assert set(carriers) <= set(range(int(root_bone), len(seen.names) - 1))
    distance = np.linalg.norm(points - seen.rest()[carriers], axis=-1)
    assert distance.max() < 0.4 * span, "a limb goes with a joint far away"


def test_a_glb_with_a_body_is_read_as_one_without() -> None:
    clip = walker()
    back = parse_glb(exporter_of("glb").write(clip, Coordinates(mesh=True)))
    assert format_glb(back) == format_glb(clip)
