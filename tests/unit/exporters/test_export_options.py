"""Root, rest pose and place of exported motions."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.exporters import Coordinates, Exporter, check_options, exporter_of
from marey.exporters.convert import convert
from marey.motion.arrange import arrange, headings, yaws
from marey.motion.clip import MotionClip, load_npz
from marey.motion.export_options import ExportOptions
from marey.motion.io.bvh import parse_bvh, read_bvh, write_bvh
from marey.motion.io.convert import clip_from_bvh
from marey.motion.io.glb_read import parse_glb
from marey.motion.io.glb_write import format_glb
from marey.motion.rotations import about, multiply, rotate
from marey.motion.skeleton import KIT, SNAPMOGEN
from tests.support.exported import tumbling
from tests.support.glb import Glb
from tests.support.walker import walker

WALK = walker(turn=0.7)
CLIPS = {"a walk": WALK, "a walk that turns back": walker(seconds=4, turn=-1.6), "tumbling": tumbling(SNAPMOGEN, 30)}


def bvh(clip: MotionClip, **options: Any):
    data = exporter_of("bvh").write(clip, Coordinates(**options))
    return parse_bvh(data, "a.bvh", rest_frame="keep")


def glb(clip: MotionClip, **options: Any) -> Glb:
    return Glb.read(exporter_of("glb").write(clip, Coordinates(**options)))


def bvh_joints(clip: MotionClip, **options: Any) -> tuple[list[str], np.ndarray]:
    read = bvh(clip, **options)
    return list(read.skeleton.joint_names), read.joints()


def glb_joints(clip: MotionClip, **options: Any) -> tuple[list[str], np.ndarray]:
    read = glb(clip, **options)
    return read.names, read.joints()


FORMATS = pytest.mark.parametrize("joints_of", [bvh_joints, glb_joints])


def ordered(clip: MotionClip, names: list[str], joints: np.ndarray) -> np.ndarray:
    return joints[:, [names.index(name) for name in clip.skeleton.joint_names]]


@FORMATS
@pytest.mark.parametrize("name", CLIPS)
def test_a_root_bone_leaves_the_joints_where_they_are_and_stays_on_the_floor(name: str, joints_of) -> None:
    clip = CLIPS[name]
    names, joints = joints_of(clip, root_bone=True)
    assert names[:2] == ["root", clip.skeleton.joint_names[0]]
    assert np.linalg.norm(ordered(clip, names, joints) - clip.joints, axis=-1).max() < 1e-3
    np.testing.assert_allclose(joints[:, 0], clip.joints[:, 0] * [1, 0, 1], atol=1e-4)


def test_a_root_bone_turns_about_the_vertical_alone_and_the_pelvis_over_it_only_up_and_down() -> None:
    seen = glb(WALK, root_bone=True)
    turns, places = seen.tracks("rotation"), seen.tracks("translation")
    assert set(places) == {0, 1}
    assert np.abs(turns[0][:, [0, 2]]).max() < 1e-6
    np.testing.assert_allclose(2 * np.arctan2(turns[0][:, 1], turns[0][:, 3]), 0.7 * seen.times(), atol=1e-5)
    assert np.abs(places[1][:, [0, 2]]).max() < 1e-6
    assert seen.rest()[0].tolist() == [0, 0, 0]
    assert seen.rest()[:, 1].min() == pytest.approx(0, abs=1e-6)


def test_in_bvh_both_joints_have_offset_zero_and_six_channels() -> None:
    text = exporter_of("bvh").write(WALK, Coordinates(root_bone=True)).decode()
    lines = [line.strip() for line in text.splitlines()]
    offsets = [line for line in lines if line.startswith("OFFSET")]
    channels = [line for line in lines if line.startswith("CHANNELS")]
    assert offsets[:2] == ["OFFSET 0.000000 0.000000 0.000000"] * 2
    assert [line.split()[1] for line in channels[:3]] == ["6", "6", "3"]
    read = clip_from_bvh(parse_bvh(text.encode(), "a.bvh"), "a.bvh")
    assert read.skeleton.name == "humanml3d", "the root bone is merged again"
    np.testing.assert_allclose(read.joints, WALK.joints, atol=1e-3)


def test_a_root_bone_is_refused_where_a_joint_has_its_name() -> None:
    with pytest.raises(InvalidInput, match=r"^\w+: .*named 'root' already"):
        exporter_of("glb").write(tumbling(KIT, 30), Coordinates(root_bone=True))


@FORMATS
def test_in_place_removes_the_travel_and_nothing_else(joints_of) -> None:
    names, joints = joints_of(WALK, in_place="travel")
    travel = (WALK.root - WALK.root[0]) * [1, 0, 1]
    assert np.linalg.norm(travel, axis=-1).max() > 1
    np.testing.assert_allclose(ordered(WALK, names, joints), WALK.joints - travel[:, None], atol=1e-3)


@FORMATS
def test_in_place_with_heading_faces_one_way(joints_of) -> None:
    names, joints = joints_of(WALK, in_place="heading")
    back = about("Y", -0.7 * np.arange(WALK.frames) / WALK.fps)[:, None]
    wanted = rotate(back, (WALK.joints - WALK.root[:, None] * [1, 0, 1]).astype(float)) + WALK.root[:1, None] * [
        1,
        0,
        1,
    ]
    np.testing.assert_allclose(ordered(WALK, names, joints), wanted, atol=1e-3)


def test_what_was_removed_is_told_in_all_and_per_second() -> None:
    extras = glb(WALK, in_place="travel").extras
    x, z = (float(WALK.root[-1, axis] - WALK.root[0, axis]) for axis in (0, 2))
    assert extras["travel"] == pytest.approx({"x": x, "z": z, "heading": 1.4}, abs=1e-5)
    assert extras["travel_per_second"] == pytest.approx({"x": x / 2, "z": z / 2, "heading": 0.7}, abs=1e-5)
    assert extras["options"] == {"in_place": "travel"}
    assert "travel" not in glb(WALK).extras


@FORMATS
@pytest.mark.parametrize("root_bone", [False, True])
def test_the_t_pose_comes_before_the_motion(root_bone: bool, joints_of) -> None:
    names, joints = joints_of(WALK, tpose_frame=True, root_bone=root_bone)
    assert len(joints) == WALK.frames + 1
    joints = ordered(WALK, names, joints)
    rest = WALK.skeleton.rest - WALK.skeleton.rest[:, 1].min() * np.array([0, 1, 0])
    np.testing.assert_allclose(joints[0], rest, atol=1e-4)
    assert joints[0, :, 1].min() == pytest.approx(0, abs=1e-5)
    np.testing.assert_allclose(joints[1:], WALK.joints, atol=1e-3)


def test_contacts_move_with_the_motion_behind_a_t_pose() -> None:
    contacts = np.zeros((WALK.frames, 4), bool)
    contacts[3:7, 1] = True
    assert glb(replace(WALK, contacts=contacts), tpose_frame=True).extras["contacts"]["L_toe"] == [[4, 8]]


@FORMATS
def test_pieces_with_their_placement_fit_together(joints_of) -> None:
    """Split a walk; the second piece begins at the origin and faces +Z, as clips do, and its manifest says where it
    was."""
    cut, yaw = 20, 0.7 * 20 / WALK.fps
    turn, shift = about("Y", -yaw), WALK.root[cut] * np.array([1, 0, 1])
    rotations = WALK.rotations[cut:].astype(float)
    rotations[:, 0] = multiply(turn, rotations[:, 0])
    root = rotate(turn, (WALK.root[cut:] - shift).astype(float))
    manifest = {"placement": {"x": float(shift[0]), "z": float(shift[2]), "heading": yaw}}
    piece = MotionClip.of(WALK.skeleton, rotations, root, WALK.contacts[cut:], WALK.fps, manifest=manifest)
    names, joints = joints_of(piece)
    assert np.linalg.norm(joints[0, 0] * [1, 0, 1]) < 1e-4
    for root_bone in (False, True):
        names, joints = joints_of(piece, placement="keep", root_bone=root_bone)
        np.testing.assert_allclose(ordered(WALK, names, joints), WALK.joints[cut:], atol=1e-3)


@pytest.mark.parametrize("placement", [{"x": "a"}, {"heading": None}, [1, 2], {"x": float("inf")}])
def test_a_placement_that_is_none_is_refused(placement: object) -> None:
    clip = replace(WALK, manifest={"placement": placement})
    with pytest.raises(InvalidInput, match="manifest: placement"):
        exporter_of("bvh").write(clip, Coordinates(placement="keep"))


def test_the_bvh_root_has_the_height_of_the_pelvis_on_request() -> None:
    text = exporter_of("bvh").write(WALK, Coordinates(bvh_root="offset", unit="m")).decode()
    assert text.split("OFFSET ")[1].splitlines()[0] == "0.000000 0.940000 0.000000"
    read = parse_bvh(text.encode(), "a.bvh", unit="m", translation="replace")
    np.testing.assert_allclose(read.root, WALK.root, atol=1e-5)
    plain = exporter_of("bvh").write(WALK, Coordinates(unit="m")).decode()
    assert text.split("MOTION")[1] == plain.split("MOTION")[1]


@pytest.mark.parametrize(
    "options",
    [{}, {"root_bone": True}, {"tpose_frame": True}, {"placement": "keep"}, {"tpose_frame": True, "root_bone": True}],
)
def test_a_glb_is_read_without_what_the_options_added(options: dict[str, Any]) -> None:
    clip = replace(WALK, manifest={"placement": {"x": 2.0, "z": -1.0, "heading": 0.5}})
    back = parse_glb(format_glb(clip, ExportOptions(**options)))
    np.testing.assert_allclose(back.joints, clip.joints, atol=1e-5)
    np.testing.assert_array_equal(back.contacts, clip.contacts)
    assert back.skeleton.joint_names == clip.skeleton.joint_names


def test_a_heading_is_held_while_the_body_is_upside_down() -> None:
    """Half a cartwheel, turning by a quarter meanwhile."""
    roll = np.linspace(0, np.pi, 41)
    yaw = np.clip(roll - 1, 0, 0.5)
    found = yaws(headings(multiply(about("Y", yaw), about("Z", roll))))
    assert np.abs(np.diff(found)).max() < 0.1, "it jumps"
    np.testing.assert_allclose(found[:30], yaw[:30], atol=1e-9)


def test_plain_poses_are_those_of_the_clip() -> None:
    posed = arrange(WALK)
    np.testing.assert_array_equal(posed.rotations, WALK.rotations)
    np.testing.assert_array_equal(posed.positions[:, 0], WALK.root)


@pytest.mark.parametrize(
    "options", [{"root_bone": True, "bvh_root": "offset"}, {"in_place": "travel", "placement": "keep"}]
)
def test_options_that_contradict_each_other_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(InvalidInput, match="Leave out") as refused:
        Coordinates(**options)
    assert refused.value.where == refused.value.argument in options


@pytest.mark.parametrize(
    ("formats", "options", "message"),
    [
        (
            ["npz"],
            {"root_bone": True},
            "npz files have no such option\n  Formats that have root_bone: bvh, fbx, glb, usd.",
        ),
        (["glb", "npz"], {"bvh_root": "offset"}, "glb, npz files have no such option"),
    ],
)
def test_an_option_of_none_of_the_formats_is_refused(formats: list[str], options: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        check_options(map(exporter_of, formats), ExportOptions(**options))
    check_options([exporter_of("bvh"), exporter_of("npz")], ExportOptions(**options))


def test_a_format_gets_only_the_options_that_it_has() -> None:
    seen: list[Coordinates] = []
    writer = Exporter(
        "toy",
        "text/x-toy",
        "ty",
        False,
        lambda clip, given: seen.append(given) or b"",
        options=frozenset({"root_bone"}),
    )
    writer.write(WALK, Coordinates("in", "z", root_bone=True, tpose_frame=True))
    assert seen == [Coordinates("in", "z", root_bone=True)]
    with pytest.raises(ValueError, match="unknown options: colour"):
        Exporter("toy", "text/x-toy", "ty", False, writer.encode, options=frozenset({"colour"}))


def test_files_are_converted_with_options(tmp_path) -> None:
    WALK.save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.bvh", export=ExportOptions(root_bone=True))
    write_bvh(tmp_path / "c.bvh", WALK, root_bone=True)
    assert (tmp_path / "b.bvh").read_bytes() == (tmp_path / "c.bvh").read_bytes()
    convert(tmp_path / "b.bvh", tmp_path / "d.bvh", export=ExportOptions(in_place="travel"))
    assert np.ptp(read_bvh(tmp_path / "d.bvh").root[:, [0, 2]], axis=0).max() < 1e-6
    convert(tmp_path / "b.bvh", tmp_path / "e.npz")
    np.testing.assert_allclose(load_npz(tmp_path / "e.npz").joints, WALK.joints, atol=1e-3)
    with pytest.raises(InvalidInput, match="npz files have no such option"):
        convert(tmp_path / "b.bvh", tmp_path / "f.npz", export=ExportOptions(tpose_frame=True))
