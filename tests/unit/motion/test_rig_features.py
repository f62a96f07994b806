"""SnapMoGen's 296 features against published numbers, and through the way of a generated motion."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.evaluator.measuring import encoded
from marey.exporters import Coordinates, exporters
from marey.exporters.convert import convert
from marey.motion.body import NamedBody, standard_body
from marey.motion.clip import MotionClip, load_npz, parse_npz
from marey.motion.export_options import ExportOptions
from marey.motion.features import HUMANML3D_263, FeatureLayout, PosedLayout, layout
from marey.motion.feet import skate
from marey.motion.finish import finish_motion
from marey.motion.io.bvh import read_bvh
from marey.motion.kinematics import bone_lengths, forward_kinematics, global_rotations, local_rotations
from marey.motion.rig_features import SNAPMOGEN_296
from marey.motion.rotations import about, angle_between, between, from_euler, multiply, rotate, to_euler
from marey.motion.skeleton import SNAPMOGEN
from marey.quality.clips import quality_of
from marey.quality.limits import expected_by_prompts
from marey.quality.record import PromptMatch
from marey.runtime.exporting import export_clip
from marey.selector.records import match_of
from marey.viz.player import html_player
from marey.viz.render import contact_sheet
from tests.support.rigged import mirrored, rigged

GOLDEN: dict[str, Any] = json.loads(Path(__file__).with_name("features296.json").read_text("utf-8"))
SLICES = SNAPMOGEN_296.slices
UNIT = 0.01


def published_motion():
    """The motion behind the published numbers: 40 frames of sines, with the calibration pose in frame 0."""
    t, j = np.arange(40)[:, None], np.arange(24)[None]
    x, y, z = 15 * np.sin(0.15 * t + 0.7 * j), 10 * np.sin(0.11 * t + 0.3 * j), 12 * np.sin(0.13 * t + 0.5 * j)
    angles = np.stack([x, y, z], axis=-1)
    t = t[:, 0]
    angles[:, 0] = np.stack([3 * np.sin(0.1 * t), 2 * t + 10, 2 * np.sin(0.2 * t)], axis=-1)
    root = np.stack([1.5 * t, 56 + 2 * np.sin(0.3 * t), 0.8 * t], axis=-1)
    return from_euler(angles, "XYZ"), UNIT * root


def published_features():
    rotations, root = published_motion()
    return SNAPMOGEN_296.encode_pose(rotations[1:], root[1:])


@pytest.mark.parametrize("key", [key for key in GOLDEN if key.startswith("enc[")])
def test_encoding_gives_the_published_numbers(key):
    row, columns = key[4:-1].split(",")
    first, last = map(int, columns.split(":"))
    np.testing.assert_allclose(published_features()[int(row), first:last], GOLDEN[key], atol=2e-5)


def test_encoding_has_the_published_moments():
    features = published_features()
    assert features.shape == (38, 296)
    assert features.dtype == np.float32
    assert features.mean(dtype=np.float64) == pytest.approx(GOLDEN["enc_mean"], abs=1e-5)
    assert features.std(dtype=np.float64) == pytest.approx(GOLDEN["enc_std"], abs=1e-5)


def test_decoding_gives_the_published_pose():
    features = published_features()
    rotations, root = SNAPMOGEN_296.decode_pose(features)
    joints = SNAPMOGEN_296.decode(features) / UNIT
    for values, key in (
        (root[-1] / UNIT, "dec_root_last"),
        (root[20] / UNIT, "dec_root_20"),
        (joints[20, 10], "dec_Lhand_20"),
        (joints[-1, 23], "dec_Rtoe_last"),
        (rotations[20, 0], "dec_lq0_20"),
        (rotations[20, 9], "dec_lq9_20"),
        (to_euler(rotations[20, 9], "XYZ"), "dec_euler9_20"),
    ):
        np.testing.assert_allclose(values, GOLDEN[key], atol=5e-5, err_msg=key)
    np.testing.assert_allclose(to_euler(published_motion()[0][21, 9], "XYZ"), GOLDEN["src_euler9_21"], atol=1e-4)


def test_the_path_of_a_turning_body_keeps_its_length_and_bends_a_little():
    _, root = SNAPMOGEN_296.decode_pose(published_features())
    flat = root[:, [0, 2]] / UNIT
    true, decoded = GOLDEN["root path length true/dec"]
    assert np.linalg.norm(np.diff(flat, axis=0), axis=1).sum() == pytest.approx(decoded, abs=1e-4)
    assert true == pytest.approx(decoded, abs=1e-4)
    assert np.linalg.norm(flat[-1] - flat[0]) == pytest.approx(GOLDEN["net disp true/dec"][1], abs=1e-4)


def test_positions_agree_with_the_rotations():
    features = published_features()
    off = np.abs(SNAPMOGEN_296.decode(features) - SNAPMOGEN_296.decode_positions(features)).max()
    assert off <= GOLDEN["max|rot-FK - ric|"] * UNIT


def test_the_layout_is_one_of_those_with_rotations():
    each = layout("snapmogen-296")
    assert isinstance(each, FeatureLayout)
    assert isinstance(each, PosedLayout)
    assert not isinstance(HUMANML3D_263, PosedLayout)
    assert each.fps == 30
    assert [SNAPMOGEN.joint_names[j] for j in SNAPMOGEN_296.left] == ["L_clavicle_bind_JNT", "L_legUpper0001_bind_JNT"]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 50), st.integers(2, 90), st.floats(-2, 2))
def test_decoding_gives_back_the_pose(seed, frames, turns):
    rotations, root = rigged(seed, frames, turns)
    features = SNAPMOGEN_296.encode_pose(rotations, root)
    assert features.shape == (frames - 1, 296)
    again, place = SNAPMOGEN_296.decode_pose(features)
    assert np.degrees(angle_between(again[:, 1:], rotations[:-1, 1:])).max() < 1e-2
    turn = multiply(again[:1, 0], rotations[:1, 0] * [1, -1, -1, -1])  # only the heading of frame 0 is lost
    assert np.abs(turn[0, [1, 3]]).max() < 1e-4
    assert np.degrees(angle_between(again[:, 0], multiply(turn, rotations[:-1, 0]))).max() < 1e-2
    steps = np.linalg.norm(np.diff(root[:-1], axis=0)[:, [0, 2]], axis=1)
    np.testing.assert_allclose(np.linalg.norm(np.diff(place, axis=0)[:, [0, 2]], axis=1), steps, atol=1e-5)
    np.testing.assert_allclose(np.diff(place[:, 1]), np.diff(root[:-1, 1]), atol=1e-5)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 50), st.integers(1, 3), st.floats(-5, 5), st.floats(-5, 5), st.floats(-5, 5), st.floats(-1, 1))
@example(21, 1, 0.0, 0.0, 0.0, 0.7609528350742312)  # faces straight back in a frame
def test_features_do_not_depend_on_where_the_body_is_and_which_quarter_it_faces(seed, quarters, x, y, z, turns):
    rotations, root = rigged(seed, 40, turns)
    here = SNAPMOGEN_296.encode_pose(rotations, root)
    turn = about("Y", quarters * np.pi / 2)
    turned = rotations.copy()
    turned[:, 0] = multiply(turn, rotations[:, 0])
    moved = SNAPMOGEN_296.encode_pose(turned, rotate(turn, root) + np.array([x, y, z]))
    np.testing.assert_allclose(moved[:, :292], here[:, :292], atol=2e-3)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 50), st.floats(-3, 3))
def test_a_motion_turned_by_any_angle_is_decoded_to_the_same(seed, angle):
    """The published smoothing of the facing weighs frames by an L1 norm, which any angle changes a little: the features
    of one motion differ in how they split the yaw, not in the motion."""
    rotations, root = rigged(seed, 40, 0.3)
    turn = about("Y", angle)
    turned = rotations.copy()
    turned[:, 0] = multiply(turn, rotations[:, 0])
    a, b = (SNAPMOGEN_296.encode_pose(q, p) for q, p in ((rotations, root), (turned, rotate(turn, root))))
    assert np.abs(a[:, 0] - b[:, 0]).max() < 0.05
    first, second = SNAPMOGEN_296.decode(a).astype(float), SNAPMOGEN_296.decode(b).astype(float)
    line = first[0, 7] - first[0, 11], second[0, 7] - second[0, 11]
    off = between(*(v * [1, 0, 1] for v in reversed(line)))
    np.testing.assert_allclose(rotate(off, second)[0], first[0], atol=1e-4)
    np.testing.assert_allclose(rotate(off, second), first, atol=0.02)


def test_a_left_turn_is_negative_and_no_yaw_wraps():
    rotations, root = rigged(3, 120, turns=2.0)  # to the left, twice past the back
    yaw = SNAPMOGEN_296.encode_pose(rotations, root)[:, 0]
    assert yaw.mean() == pytest.approx(-4 * np.pi / 120, rel=0.1)
    assert np.abs(yaw).max() < 0.5


def test_feet_stand_where_they_are_slow_and_low():
    rotations = np.tile([1.0, 0, 0, 0], (20, 24, 1))
    root = np.tile(SNAPMOGEN.offsets[0], (20, 1)).astype(np.float64)
    standing = SNAPMOGEN_296.encode_pose(rotations, root)
    assert SNAPMOGEN_296.contacts(standing).all()
    sliding = root + np.arange(20)[:, None] * np.array([0.0, 0.0, 0.0034])  # 0.34 squared is over 0.11
    assert not SNAPMOGEN_296.contacts(SNAPMOGEN_296.encode_pose(rotations, sliding)).any()
    leg = np.tile(rotations[:1], (20, 1, 1))
    leg[10:, SNAPMOGEN.index("L_legUpper0001_bind_JNT")] = about("X", -1.2)  # held up from frame 10 on
    later = SNAPMOGEN_296.contacts(SNAPMOGEN_296.encode_pose(leg, root))
    assert later[:8].all()
    assert not later[11:, :2].any()
    turned = rotations.copy()
    turned[:, SNAPMOGEN.index("L_legUpper0001_bind_JNT")] = about("X", -1.2)  # the left leg is held up
    contacts = SNAPMOGEN_296.contacts(SNAPMOGEN_296.encode_pose(turned, root))
    assert not contacts[:, :2].any()
    assert contacts[:, 2:].all()


def test_the_mirrored_motion_turns_the_other_way():
    a = SNAPMOGEN_296.encode_pose(*rigged(1, 50, 0.5))
    b = SNAPMOGEN_296.encode_pose(*mirrored(*rigged(1, 50, 0.5)))
    np.testing.assert_allclose(b[:, :2], -a[:, :2], atol=5e-3)
    np.testing.assert_allclose(b[:, 2:4], a[:, 2:4], atol=5e-3)
    np.testing.assert_array_equal(b[:, 292:], a[:, [294, 295, 292, 293]])


def test_mirrored_features_are_those_of_the_mirrored_motion():
    pose = rigged(1, 50, 0.5)
    features = SNAPMOGEN_296.encode_pose(*pose)
    np.testing.assert_allclose(SNAPMOGEN_296.mirror(features), SNAPMOGEN_296.encode_pose(*mirrored(*pose)), atol=2e-2)
    np.testing.assert_array_equal(SNAPMOGEN_296.mirror(SNAPMOGEN_296.mirror(features)), features)


def test_joints_are_encoded_by_a_solved_pose():
    rotations, root = rigged(2, 40)
    rotations[:, [0, 15]] = [1, 0, 0, 0]  # no positions tell the root from the pelvis, which lies in the same place
    joints = forward_kinematics(SNAPMOGEN, rotations, root)
    from_joints = SNAPMOGEN_296.encode(joints)
    exact = SNAPMOGEN_296.encode_pose(rotations, root)
    assert np.abs(from_joints[:, SLICES["positions"]] - exact[:, SLICES["positions"]]).max() < 0.1
    np.testing.assert_allclose(
        SNAPMOGEN_296.decode(from_joints)[:, 1:, 1], SNAPMOGEN_296.decode(exact)[:, 1:, 1], atol=1e-3
    )


def test_batches_are_decoded_like_single_clips():
    batch = np.stack([SNAPMOGEN_296.encode_pose(*rigged(seed, 30)) for seed in range(3)])
    for decode in (SNAPMOGEN_296.decode, SNAPMOGEN_296.decode_positions):
        np.testing.assert_allclose(decode(batch)[1], decode(batch[1]), atol=1e-6)
    assert SNAPMOGEN_296.decode_pose(batch)[0].shape == (3, 29, 24, 4)


def test_another_body_takes_the_rotations():
    features = SNAPMOGEN_296.encode_pose(*rigged())
    larger = SNAPMOGEN_296.with_offsets(1.5 * SNAPMOGEN.offsets)
    lengths = bone_lengths(larger.decode(features), SNAPMOGEN)
    np.testing.assert_allclose(
        lengths[0], 1.5 * np.linalg.norm(SNAPMOGEN.offsets, axis=1) * (np.arange(24) > 0), atol=1e-5
    )


@pytest.mark.parametrize(("frames", "joints", "width"), [(1, 24, 4), (10, 22, 4), (10, 24, 3)])
def test_a_pose_of_another_shape_is_refused(frames, joints, width):
    with pytest.raises(InvalidInput, match=r"^snapmogen-296: .*shape"):
        SNAPMOGEN_296.encode_pose(np.ones((frames, joints, width)), np.zeros((frames, 3)))


def test_what_is_no_motion_is_refused():
    rotations, root = rigged()
    root[3, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"^snapmogen-296: .*NaN"):
        SNAPMOGEN_296.encode_pose(rotations, root)
    with pytest.raises(InvalidInput, match=r"^snapmogen-296: .*shape"):
        SNAPMOGEN_296.encode(np.zeros((5, 22, 3)))
    with pytest.raises(InvalidInput, match=r"^snapmogen-296: .*not .* 296"):
        SNAPMOGEN_296.decode(np.zeros((10, 263)))


def test_a_finished_clip_has_the_rotations_of_the_features():
    rotations, root = rigged(4, 50)
    features = SNAPMOGEN_296.encode_pose(rotations, root)
    clip = finish_motion(features, SNAPMOGEN_296, body=NamedBody("rig", SNAPMOGEN), clean=False)
    turned = np.degrees(angle_between(clip.rotations[:, 1:].astype(float), rotations[:-1, 1:]))
    assert turned.max() < 0.05, "twists of hands, head and limbs, which positions do not show, are there"


@pytest.mark.parametrize("fps", [None, 60])
def test_a_finished_clip_is_as_large_as_a_person_and_its_feet_do_not_slide(fps):
    features = SNAPMOGEN_296.encode_pose(*rigged(5, 90))
    clip = finish_motion(features, SNAPMOGEN_296, fps=fps, manifest={"prompt": "sway"})
    body = standard_body(SNAPMOGEN).skeleton
    assert clip.fps == (fps or 30)
    assert clip.features_fps == 30
    np.testing.assert_allclose(clip.offsets, body.offsets)
    np.testing.assert_allclose(forward_kinematics(clip.skeleton, clip.rotations, clip.root), clip.joints, atol=1e-6)
    assert skate(clip.joints, clip.contacts, SNAPMOGEN, clip.fps) < 5e-3


def test_cleaning_turns_only_legs_and_what_meets():
    features = SNAPMOGEN_296.encode_pose(*rigged(6, 60))
    raw, clean = (finish_motion(features, SNAPMOGEN_296, clean=each) for each in (False, True))
    turned = np.degrees(angle_between(raw.rotations.astype(float), clean.rotations.astype(float))).max(axis=0)
    legs = [j for j, name in enumerate(SNAPMOGEN.joint_names) if "leg" in name or "foot" in name]
    arms = [j for j, name in enumerate(SNAPMOGEN.joint_names) if "arm" in name or "hand" in name]
    kept = [j for j in range(24) if j not in legs + arms]
    assert turned[kept].max() < 0.05
    assert turned[legs].max() > 1


def test_a_clip_of_this_skeleton_is_exported_without_quality_and_match():
    clip = finish_motion(SNAPMOGEN_296.encode_pose(*rigged()), SNAPMOGEN_296)
    assert quality_of(clip, expected_by_prompts(["a person walks"])) is None
    assert match_of(clip, ["a person walks"]) == PromptMatch()
    made = export_clip(clip, "non-commercial")
    assert {file.format for file in made.files} == {name for name, each in exporters().items() if each.stored}
    assert (made.frames, made.fps) == (clip.frames, 30)


def test_an_evaluator_reads_the_rotations_of_an_exported_clip():
    features = SNAPMOGEN_296.encode_pose(*rigged(11, 60))
    clip = finish_motion(features, SNAPMOGEN_296, clean=False)
    again = encoded(SNAPMOGEN_296, clip)
    assert again.shape == features.shape
    within = slice(10, 40)  # away from the ends, where the facing is smoothed over other frames
    np.testing.assert_allclose(again[within, SLICES["rotations"]], features[within, SLICES["rotations"]], atol=0.02)
    np.testing.assert_allclose(again[within, 1:3], features[within, 1:3], atol=0.05)
    assert np.abs(again - features)[-1, SLICES["rotations"]].max() < 0.2


def test_features_that_are_not_finite_are_refused():
    features = SNAPMOGEN_296.encode_pose(*rigged())
    features[3, 150] = features[4, 20] = np.nan
    with pytest.raises(InvalidInput, match="NaN"):
        finish_motion(features, SNAPMOGEN_296)


@pytest.mark.parametrize("frames", [1, 2, 5])
def test_the_shortest_clips_are_finished(frames):
    clip = finish_motion(SNAPMOGEN_296.encode_pose(*rigged(0, frames + 1)), SNAPMOGEN_296)
    assert clip.frames == frames


@pytest.mark.parametrize("scale", [0.0, 1.0])
@pytest.mark.filterwarnings("error")
def test_what_is_no_body_is_finished_without_nan(scale):
    noise = scale * np.random.default_rng(0).normal(size=(50, 296)).astype(np.float32)
    clip = finish_motion(noise, SNAPMOGEN_296, fps=60)
    assert np.isfinite(clip.joints).all()
    assert np.isfinite(clip.rotations).all()


def test_features_reach_every_export_format(tmp_path):
    clip = finish_motion(SNAPMOGEN_296.encode_pose(*rigged(7, 16)), SNAPMOGEN_296, manifest={"prompt": "sway"})
    others = ("smplx", "usd")  # the one needs a model of the user's, the other an extra
    known = {name: each for name, each in exporters().items() if name not in others}
    files = {name: each.encode(clip, Coordinates()) for name, each in known.items()}
    assert {"bvh", "npz"} <= files.keys()
    back = parse_npz(files["npz"])
    np.testing.assert_array_equal(back.rotations, clip.rotations)
    assert back.skeleton.feet == SNAPMOGEN.feet
    html_player([clip], tmp_path / "a.html")
    contact_sheet([clip], tmp_path / "a.png")
    assert (tmp_path / "a.html").stat().st_size > 1000
    assert (tmp_path / "a.png").stat().st_size > 1000


@pytest.mark.parametrize("rest_pose", ["t", "a"])
def test_features_go_to_bvh_and_back(rest_pose, tmp_path):
    rotations, root = rigged(8, 40)
    clip = MotionClip.of(SNAPMOGEN, rotations, root, np.zeros((40, 4), bool), 30)
    decoded = finish_motion(
        SNAPMOGEN_296.encode_pose(rotations, root), SNAPMOGEN_296, body=NamedBody("rig", SNAPMOGEN), clean=False
    )
    decoded.save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.bvh", export=ExportOptions(rest_pose=rest_pose))
    convert(tmp_path / "b.bvh", tmp_path / "c.npz", source_rest_pose=rest_pose)
    back = load_npz(tmp_path / "c.npz")
    assert back.skeleton.name == "snapmogen"
    np.testing.assert_allclose(back.offsets[1:], SNAPMOGEN.offsets[1:], atol=2e-7)
    assert (
        np.degrees(angle_between(back.rotations[:, 1:].astype(float), clip.rotations[:-1, 1:].astype(float))).max()
        < 0.05
    )
    raw = read_bvh(tmp_path / "b.bvh")
    assert raw.skeleton.joint_names[:2] == ("ROOT", "C_spine0001_bind_JNT")
    np.testing.assert_allclose(raw.root, decoded.root, atol=1e-6)


def test_local_rotations_undo_global_ones():
    rotations, _ = rigged(9, 5)
    np.testing.assert_allclose(local_rotations(SNAPMOGEN, global_rotations(SNAPMOGEN, rotations)), rotations, atol=1e-9)
