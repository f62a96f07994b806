"""Resampling, finishing and converting."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import Conflict, InvalidFile, InvalidInput, NotFound
from marey.exporters.convert import convert
from marey.motion.body import NamedBody
from marey.motion.capsules import depth
from marey.motion.clip import MotionClip, load_npz
from marey.motion.features import HUMANML3D_263, KIT_251
from marey.motion.feet import skate
from marey.motion.finish import finish_motion
from marey.motion.io.bvh import BvhClip, format_bvh, parse_bvh, read_bvh, write_bvh
from marey.motion.io.convert import steady
from marey.motion.kinematics import bone_lengths, facing, forward_kinematics
from marey.motion.resample import frame_times, interpolate, interpolate_rotations, resample
from marey.motion.rotations import about, angle_between, multiply
from marey.motion.skeleton import HUMANML3D
from tests.support.arms import with_hand_in_the_trunk
from tests.support.bodies import runner
from tests.support.exported import tumbling
from tests.support.motions import dancer, drift
from tests.support.walker import walker

RATES = [24000 / 1001, 24, 25, 30000 / 1001, 30, 50, 60, 120]


def generated(frames: int = 100, seed: int = 0):
    """Features as a model gives them: those of a body, and noise that no body makes."""
    rotations, root = dancer(seed, frames + 1)
    features = HUMANML3D_263.encode(forward_kinematics(HUMANML3D, rotations, root))
    features[:, HUMANML3D_263.slices["positions"]] += drift(seed, frames, 63, 0.003)
    return features


@pytest.mark.parametrize("fps", RATES)
@pytest.mark.parametrize("source", [20.0, 60.0])
def test_resampling_keeps_the_length_and_passes_through_old_frames(fps, source):
    clip = walker(seconds=2, fps=source, turn=0.6)
    new = resample(clip, fps)
    assert new.fps == fps
    assert (clip.frames - 1) / source - 1 / fps < (new.frames - 1) / fps <= (clip.frames - 1) / source + 1e-6
    for k in range(0, clip.frames, 10):  # each half second or less
        at = k / source * fps
        if abs(at - round(at)) < 1e-9 and round(at) < new.frames:
            np.testing.assert_allclose(new.joints[round(at)], clip.joints[k], atol=1e-5)
    assert np.abs(bone_lengths(new.joints, HUMANML3D) - bone_lengths(clip.joints[:1], HUMANML3D)).max() < 1e-5


def test_upsampling_stays_close_to_the_motion_itself():
    slow, fast = walker(fps=20, seconds=3, turn=1), walker(fps=120, seconds=3, turn=1)
    turned = angle_between(resample(slow, 120).rotations.astype(float), fast.rotations.astype(float))
    assert np.degrees(turned).max() < 0.5


def test_upsampling_makes_no_jerk_at_old_frames():
    speed = np.linalg.norm(np.diff(resample(walker(fps=20, seconds=3), 120).joints[:, 20], axis=0), axis=-1) * 120
    true = np.linalg.norm(np.diff(walker(fps=120, seconds=3).joints[:, 20], axis=0), axis=-1) * 120
    assert np.abs(np.diff(speed)).max() < 2.5 * np.abs(np.diff(true)).max()


@settings(max_examples=30, deadline=None)
@given(st.floats(0.01, 0.7), st.integers(2, 12), st.floats(0, 1))
def test_an_even_turn_is_interpolated_evenly_whatever_the_signs(step, frames, at):
    q = about("Y", step * np.arange(frames)) * np.where(np.arange(frames) % 2, -1, 1)[:, None]
    time = np.array([at * (frames - 1)])
    assert angle_between(interpolate_rotations(q, time), about("Y", step * time)) < 0.02 * step


def test_contacts_are_resampled_with_the_motion():
    clip = walker(fps=20)
    np.testing.assert_array_equal(resample(clip, 40).contacts[::2], clip.contacts)


@pytest.mark.parametrize("fps", [0, -1, 0.5, 241, float("nan"), float("inf")])
def test_a_rate_out_of_bounds_is_refused(fps):
    with pytest.raises(InvalidInput, match="frames a second"):
        resample(walker(), fps)


def test_one_frame_is_resampled():
    assert frame_times(1, 20, 60).tolist() == [0.0]
    np.testing.assert_array_equal(interpolate(np.ones((1, 3)), np.zeros(1)), np.ones((1, 3)))


@pytest.mark.parametrize("fps", [None, 24000 / 1001, 60, 120])
def test_a_finished_clip_is_what_the_contract_says(fps):
    features = generated()
    clip = finish_motion(features, HUMANML3D_263, fps=fps, manifest={"prompt": "dance"})
    assert clip.fps == (fps or 20.0)
    assert clip.seconds == pytest.approx(5.0, abs=0.06)
    np.testing.assert_array_equal(clip.features, features)
    assert clip.features_fps == 20
    np.testing.assert_allclose(forward_kinematics(clip.skeleton, clip.rotations, clip.root), clip.joints, atol=1e-6)
    assert np.ptp(bone_lengths(clip.joints, HUMANML3D), axis=0).max() < 1e-5
    assert facing(clip.joints[0].astype(float), HUMANML3D)[2] > 0.95
    assert skate(clip.joints, clip.contacts, HUMANML3D, clip.fps) < 1e-3
    assert clip.manifest == {"prompt": "dance"}
    read = parse_bvh(format_bvh(clip).encode())
    order = [read.skeleton.joint_names.index(n) for n in HUMANML3D.joint_names]
    assert np.linalg.norm(read.joints()[:, order] - clip.joints, axis=-1).max() < 1e-3


def test_fixed_bones_are_near_to_what_the_features_say():
    features = generated(196)
    clip = finish_motion(features, HUMANML3D_263, body=NamedBody("training", HUMANML3D), clean=False)
    assert np.linalg.norm(clip.joints - HUMANML3D_263.decode(features), axis=-1).mean() < 0.005


def test_feet_are_left_alone_when_asked():
    features = HUMANML3D_263.encode(walker(seconds=4).joints)
    raw, clean = (finish_motion(features, HUMANML3D_263, clean=c) for c in (False, True))
    assert skate(raw.joints, raw.contacts, HUMANML3D, 20) > 0.02
    assert skate(clean.joints, clean.contacts, HUMANML3D, 20) < 1e-4


def test_kit_features_are_finished_too():
    clip = tumbling(KIT_251.skeleton, 12.5)
    done = finish_motion(KIT_251.encode(clip.joints), KIT_251, fps=30)
    assert done.skeleton.joint_names == KIT_251.skeleton.joint_names
    assert np.isfinite(done.joints).all()


@pytest.mark.parametrize("frames", [1, 2, 3, 7])
@pytest.mark.parametrize("fps", [20, 60])
def test_the_shortest_clips_are_finished(frames, fps):
    clip = finish_motion(generated(frames), HUMANML3D_263, fps=fps)
    assert clip.frames == (frames - 1) * fps // 20 + 1
    assert np.isfinite(clip.joints).all()


@pytest.mark.parametrize("scale", [0.0, 1.0])
@pytest.mark.filterwarnings("error")
def test_what_is_no_body_is_finished_without_nan(scale):
    noise = scale * np.random.default_rng(0).normal(size=(50, 263)).astype(np.float32)
    clip = finish_motion(noise, HUMANML3D_263, fps=60)
    assert np.isfinite(clip.joints).all()
    assert np.isfinite(clip.rotations).all()


def test_features_that_are_not_finite_are_refused():
    features = generated()
    features[10, 20] = np.nan
    with pytest.raises(InvalidInput, match=r"^humanml3d: .*NaN"):
        finish_motion(features, HUMANML3D_263)


def test_features_of_another_shape_are_refused():
    with pytest.raises(InvalidInput, match=r"^humanml3d-263: .*shape"):
        finish_motion(np.zeros((2, 10, 263)), HUMANML3D_263)


def test_npz_to_bvh_and_back(tmp_path):
    clip = finish_motion(generated(), HUMANML3D_263)
    clip.save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.bvh")
    convert(tmp_path / "b.bvh", tmp_path / "c.npz")
    back = load_npz(tmp_path / "c.npz")
    assert back.skeleton.joint_names == HUMANML3D.joint_names, "in our order again"
    assert back.skeleton.feet == HUMANML3D.feet
    assert np.abs(back.joints - clip.joints).max() < 0.1, "turned to face +Z"
    np.testing.assert_allclose(bone_lengths(back.joints, HUMANML3D), bone_lengths(clip.joints, HUMANML3D), atol=1e-5)
    assert (
        np.degrees(angle_between(back.rotations[:, 1:].astype(float), clip.rotations[:, 1:].astype(float))).max() < 0.1
    )
    assert back.manifest["origin"] == "b.bvh"


@pytest.mark.parametrize(("unit", "up"), [("m", "z"), ("in", "y")])
def test_unit_axis_and_rate_are_options(unit, up, tmp_path):
    clip = walker()
    clip.save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.bvh", fps=60, unit=unit, up=up)
    read = read_bvh(tmp_path / "b.bvh", unit=unit, up=up)
    assert read.fps == 60
    np.testing.assert_allclose(read.root, resample(clip, 60).root, atol=1e-5)
    raw = read_bvh(tmp_path / "b.bvh", unit="m")
    height = raw.root[:, 2 if up == "z" else 1].mean()
    assert height == pytest.approx(clip.root[:, 1].mean() * (39.37 if unit == "in" else 1), rel=0.01)
    convert(tmp_path / "b.bvh", tmp_path / "c.bvh", source_unit=unit, source_up=up, fps=20)
    np.testing.assert_allclose(read_bvh(tmp_path / "c.bvh").root, clip.root, atol=1e-4)


def test_npz_to_npz_resamples(tmp_path):
    walker().save_npz(tmp_path / "a.npz")
    convert(tmp_path / "a.npz", tmp_path / "b.npz", fps=30)
    assert load_npz(tmp_path / "b.npz").fps == 30


def carried() -> BvhClip:
    """A root that stands still and carries hips which travel, as in Bandai-Namco's files."""
    clip = walker()
    names = ("carrier", *HUMANML3D.joint_names)
    parents = (-1, *(p + 1 for p in HUMANML3D.parents))
    skeleton = type(HUMANML3D)(
        "x", names, parents, np.concatenate([np.zeros((1, 3)), HUMANML3D.offsets]), tuple(range(23))
    )
    rotations = np.concatenate([np.tile(about("Y", 0.5), (clip.frames, 1, 1)), clip.rotations], axis=1)
    positions = np.tile(skeleton.offsets.astype(float), (clip.frames, 1, 1))
    positions[:, 1] = clip.root
    root = np.tile([0.1, 0.0, 0.2], (clip.frames, 1))
    return BvhClip(skeleton, rotations, root, positions, 20.0, np.full((23, 3), np.nan))


def test_a_root_that_only_carries_is_merged_into_what_it_carries():
    clip = carried()
    merged = steady(clip)
    assert merged.skeleton.joint_names == HUMANML3D.joint_names
    assert merged.positions is None
    np.testing.assert_allclose(merged.joints(), clip.joints()[:, 1:], atol=1e-6)
    assert merged.notes == ()


def test_bones_that_stretch_are_noted():
    clip = carried()
    assert clip.positions is not None
    clip.positions[:, 5, 1] += np.linspace(0, 0.1, len(clip.root))
    assert "mm off at most" in steady(clip).notes[0]


def test_a_clip_from_bvh_faces_z(tmp_path):
    clip = walker()
    rotations = clip.rotations.copy()
    rotations[:, 0] = multiply(about("Y", 2.0), rotations[:, 0].astype(float))
    write_bvh(tmp_path / "a.bvh", MotionClip.of(HUMANML3D, rotations, clip.root, clip.contacts, 20))
    convert(tmp_path / "a.bvh", tmp_path / "b.npz")
    np.testing.assert_allclose(
        facing(load_npz(tmp_path / "b.npz").joints[0].astype(float), HUMANML3D), [0, 0, 1], atol=1e-5
    )


def test_conversion_refuses_what_it_cannot_do(tmp_path):
    walker().save_npz(tmp_path / "a.npz")
    (tmp_path / "b.bvh").write_text("mine")
    with pytest.raises(Conflict):
        convert(tmp_path / "a.npz", tmp_path / "b.bvh")
    assert (tmp_path / "b.bvh").read_text() == "mine"
    convert(tmp_path / "a.npz", tmp_path / "b.bvh", overwrite=True)
    assert (tmp_path / "b.bvh").read_text().startswith("HIERARCHY")
    with pytest.raises(InvalidInput, match="c3d"):
        convert(tmp_path / "a.npz", tmp_path / "b.c3d")
    with pytest.raises(NotFound):
        convert(tmp_path / "none.npz", tmp_path / "c.bvh")
    (tmp_path / "bad.bvh").write_text("HIERARCHY\nROOT a\n{\n")
    with pytest.raises(InvalidFile):
        convert(tmp_path / "bad.bvh", tmp_path / "c.npz")
    assert not (tmp_path / "c.npz").exists()


def test_a_finished_body_is_solid_and_its_running_feet_stand() -> None:
    through = HUMANML3D_263.encode(with_hand_in_the_trunk())
    raw, clean = (
        finish_motion(through, HUMANML3D_263, clean=clean).joints.astype(np.float64) for clean in (False, True)
    )
    assert depth(raw, "R_forearm", "trunk").max() > 0.03
    assert depth(clean, "R_forearm", "trunk").max() < 0.015
    run = np.asarray(runner(4.0), np.float64)
    run[..., 2] += 0.4 * (np.arange(len(run)) / 20)[:, None]
    assert finish_motion(HUMANML3D_263.encode(run), HUMANML3D_263).contacts[:, 1::2].mean() > 0.05
