"""Written FBX files: what Marey's reader finds in them. `tests/clients` opens them in other programs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.exporters import Coordinates, exporter_of
from marey.exporters.convert import convert
from marey.motion.clip import load_npz
from marey.motion.export_options import ExportOptions
from marey.motion.io.convert import clip_from_bvh
from marey.motion.io.fbx_curves import read_animation
from marey.motion.io.fbx_document import FbxDocument
from marey.motion.io.fbx_nodes import TICKS
from marey.motion.io.fbx_parse import FbxFile, text
from marey.motion.io.fbx_read import parse_fbx, read_fbx
from marey.motion.io.fbx_scene import read_scene
from marey.motion.io.fbx_skeleton import bones_of, skeleton_order
from marey.motion.io.fbx_transforms import world_transforms
from marey.motion.io.fbx_write import format_fbx, write_fbx
from marey.motion.skeleton import KIT, SNAPMOGEN
from tests.support.exported import tumbling
from tests.support.fbx import rewritten
from tests.support.walker import walker

RATES = {20.0: 14, 24.0: 11, 25.0: 10, 30.0: 6, 60.0: 3, 24000 / 1001: 13, 60000 / 1001: 17, 120.0: 1}
CLIPS = {
    **{f"a walk at {fps:.3f} fps": walker(fps=fps, turn=0.7) for fps in RATES},
    "one frame": walker(seconds=0),
    "tumbling KIT joints": tumbling(KIT, 12.5),
    "tumbling SnapMoGen joints": tumbling(SNAPMOGEN, 30),
}


@pytest.mark.parametrize("name", CLIPS)
def test_joints_are_at_key_times_where_the_clip_has_them(name: str) -> None:
    clip = CLIPS[name]
    seen = parse_fbx(format_fbx(clip))
    assert seen.fps == pytest.approx(clip.fps, rel=1e-9)
    assert seen.positions is None, "bones have constant lengths"
    order = [seen.skeleton.index(joint) for joint in clip.skeleton.joint_names]
    assert seen.joints()[:, order].shape == clip.joints.shape
    assert np.linalg.norm(seen.joints()[:, order] - clip.joints, axis=-1).max() < 1e-4


@pytest.mark.parametrize(("fps", "mode"), RATES.items())
def test_the_rate_has_its_number_and_keys_are_at_whole_frames(fps: float, mode: int) -> None:
    clip = walker(fps=fps)
    scene = read_scene(format_fbx(clip), "a")
    assert scene.settings["TimeMode"] == (mode,)
    assert scene.settings["CustomFrameRate"] == ((fps,) if mode == 14 else (-1,))
    animation = read_animation(scene, set(scene.models))
    for curve in next(iter(animation.curves.values())):
        assert curve is not None
        np.testing.assert_allclose(curve.times, np.arange(clip.frames) / fps, atol=1 / TICKS)
        assert (curve.flags & 4).all(), "linear"


def stack(data: bytes) -> dict[str, float]:
    node = next(each for each in FbxFile(data, "a").first("Objects").children if each.name == "AnimationStack")
    rows = node.first("Properties70")
    assert rows is not None
    return {text(row.properties[0]): float(row.properties[4]) for row in rows.children}  # type: ignore[arg-type]


def test_the_animation_lasts_from_the_first_frame_to_the_last() -> None:
    clip = walker(seconds=2, fps=24)
    end = round(2 * TICKS)
    assert stack(format_fbx(clip)) == {"LocalStart": 0, "LocalStop": end, "ReferenceStart": 0, "ReferenceStop": end}


@pytest.mark.parametrize("skeleton", [None, KIT, SNAPMOGEN], ids=["HumanML3D", "KIT", "SnapMoGen"])
def test_the_bind_pose_is_the_t_pose_with_the_toes_on_the_floor(skeleton) -> None:
    clip = walker() if skeleton is None else tumbling(skeleton, 30)
    scene = read_scene(format_fbx(clip), "a")
    assert scene.unit == 0.01
    places = {scene.models[key].name: matrix[:3, 3] * 0.01 for key, matrix in scene.bound.items()}
    rest = np.array([places[name] for name in clip.skeleton.joint_names])
    assert rest[:, 1].min() == pytest.approx(0, abs=1e-6)
    np.testing.assert_allclose(rest - rest[0], clip.skeleton.rest - clip.skeleton.rest[0], atol=1e-6)
    order = skeleton_order(scene, bones_of(scene))
    still = world_transforms(scene, order, {})
    for key in order:
        np.testing.assert_allclose(still.places[key], scene.bound[key][:3, 3], atol=1e-6)
        assert scene.models[key].properties["Lcl Rotation"] == (0, 0, 0)
        assert scene.models[key].properties["RotationOrder"] == (0,)


@pytest.mark.parametrize("unit", ["m", "cm", "in"])
@pytest.mark.parametrize("up", ["y", "z"])
def test_the_file_states_its_unit_and_axis(unit, up) -> None:
    clip = walker(turn=0.7)
    data = exporter_of("fbx").write(clip, Coordinates(unit, up))
    seen = clip_from_bvh(parse_fbx(data), "a")
    np.testing.assert_allclose(seen.joints, clip.joints, atol=1e-4)
    assert read_scene(data, "a").settings["UpAxis"] == ({"y": 1, "z": 2}[up],)


def test_objects_of_equal_keys_have_identifiers_of_their_own() -> None:
    """As those of keys whose hashes are equal; they are the same in each file."""
    files = [FbxDocument(), FbxDocument()]
    numbers = [[file.identifier("Model", "pelvis") for _ in range(3)] for file in files]
    assert numbers[0] == numbers[1]
    assert len({*numbers[0], 0}) == 4
    assert max(numbers[0]) < 2**52


def test_a_root_bone_moves_no_joint_and_the_pelvis_is_not_the_end_of_it() -> None:
    clip = walker(turn=0.7)
    data = format_fbx(clip, ExportOptions(root_bone=True))
    seen = parse_fbx(data)
    order = [seen.skeleton.index(joint) for joint in clip.skeleton.joint_names]
    assert seen.skeleton.joint_names[0] == "root"
    np.testing.assert_allclose(seen.joints()[:, order], clip.joints, atol=1e-4)
    scene = read_scene(data, "a")
    pelvis = next(model for model in scene.models.values() if model.name == "pelvis")
    x, y, z = pelvis.properties["Lcl Translation"]
    assert (x, z) == (0, pytest.approx(0.01)), "on the Y axis of its parent Blender would connect it, and hold it still"
    assert y == pytest.approx(100 * clip.skeleton.rest[0, 1] - 100 * clip.skeleton.rest[:, 1].min(), abs=1e-3)


def test_options_act_on_the_file() -> None:
    clip = walker(turn=0.7)
    rested = parse_fbx(format_fbx(clip, ExportOptions(tpose_frame=True)))
    assert len(rested.root) == clip.frames + 1
    assert rested.joints()[0, :, 1].min() == pytest.approx(0, abs=1e-4)
    still = parse_fbx(format_fbx(clip, ExportOptions(in_place="travel")))
    assert np.ptp(still.root[:, [0, 2]], axis=0).max() < 1e-6
    moved = replace(clip, manifest={"placement": {"x": 1.0, "z": 2.0, "heading": 0.0}})
    kept = parse_fbx(format_fbx(moved, ExportOptions(placement="keep")))
    np.testing.assert_allclose(kept.root, clip.root + np.array([1, 0, 2]), atol=1e-4)
    posed = exporter_of("fbx").write(tumbling(SNAPMOGEN, 30), Coordinates(rest_pose="a"))
    offsets = parse_fbx(posed).skeleton
    assert offsets.offsets[offsets.index("L_hand0001_bind_JNT")][1] < -0.05, "arms hang in an A-pose"


def test_a_body_is_bound_to_the_joints_once() -> None:
    clip = walker()
    data = exporter_of("fbx").write(clip, Coordinates(mesh=True, root_bone=True))
    file, scene = FbxFile(data, "a"), read_scene(data, "a")
    geometry = data.count(b"PolygonVertexIndex")
    assert geometry == 1
    weights: dict[int, float] = {}
    for node in file.first("Objects").children:
        if node.name == "Deformer" and text(node.properties[2]) == "Cluster":
            held, share = (file.array(node.first(name), "id", most=10**5) for name in ("Indexes", "Weights"))
            for point, weight in zip(held.tolist(), share.tolist(), strict=True):
                weights[point] = weights.get(point, 0) + weight
    assert set(weights.values()) == {1.0}
    assert sorted(weights) == list(range(len(weights)))
    assert scene.linked <= set(scene.bound)
    plain = format_fbx(clip)
    assert len(data) > len(plain) + 10_000


def test_equal_clips_give_equal_bytes_without_a_clock_or_a_prompt() -> None:
    clip = replace(walker(), manifest={"prompt": "zanzibar"})
    data = format_fbx(clip)
    assert data == format_fbx(replace(walker(), manifest={"prompt": "elsewhere"}))
    assert b"zanzibar" not in data
    numbers = [int(each.properties[0]) for each in FbxFile(data, "a").first("Objects").children]  # type: ignore[arg-type]
    assert len(set(numbers)) == len(numbers)
    assert max(numbers) < 2**53, "JavaScript would confuse them"


def test_a_clip_with_numbers_that_are_not_finite_is_refused() -> None:
    clip = walker()
    root = clip.root.copy()
    root[3, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"^pelvis: .*NaN or infinite"):
        format_fbx(replace(clip, root=root))


def test_it_is_converted_to_and_from_other_formats(tmp_path) -> None:
    clip = walker(turn=0.4)
    clip.save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.fbx")
    assert (tmp_path / "b.fbx").read_bytes() == exporter_of("fbx").encode(clip, Coordinates())
    convert(tmp_path / "b.fbx", tmp_path / "c.npz", fps=30)
    back = load_npz(tmp_path / "c.npz")
    assert (back.fps, back.skeleton.name) == (30, "humanml3d")
    convert(tmp_path / "b.fbx", tmp_path / "d.npz")
    np.testing.assert_allclose(load_npz(tmp_path / "d.npz").joints, clip.joints, atol=1e-4)
    convert(tmp_path / "b.fbx", tmp_path / "e.fbx", export=ExportOptions(mesh=True, root_bone=True))
    np.testing.assert_allclose(clip_from_bvh(read_fbx(tmp_path / "e.fbx"), "e").joints, clip.joints, atol=1e-4)
    write_fbx(tmp_path / "f.fbx", clip)
    assert (tmp_path / "f.fbx").read_bytes() == (tmp_path / "b.fbx").read_bytes()


def test_curves_name_the_version_that_readers_know() -> None:
    curves = [
        node for node in FbxFile(format_fbx(walker()), "a").first("Objects").children if node.name == "AnimationCurve"
    ]
    assert {node.first("KeyVer").properties[0] for node in curves} == {4008}


@pytest.mark.parametrize("version", [7100, 7500, 7700])
@pytest.mark.parametrize("packed", [False, True])
def test_other_versions_and_packed_arrays_are_read(version: int, packed: bool) -> None:
    clip = walker(seconds=1)
    plain = format_fbx(clip)
    seen = parse_fbx(rewritten(plain, version, packed=packed))
    np.testing.assert_array_equal(seen.joints(), parse_fbx(plain).joints())


def test_one_animation_is_nothing_to_note() -> None:
    assert parse_fbx(format_fbx(walker(seconds=1))).notes == ()
