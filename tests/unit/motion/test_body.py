"""One body: every motion is solved onto the same bones."""

from __future__ import annotations

import json
import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.motion.body import STATURE, NamedBody, standard_body, stature, travel_scale
from marey.motion.bones import AT_ONCE, BoneFit
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import skate
from marey.motion.finish import finish_motion
from marey.motion.io.bvh import format_bvh, parse_bvh
from marey.motion.kinematics import bone_lengths, forward_kinematics
from marey.motion.live import LiveMotion
from marey.motion.skeleton import HUMANML3D, KIT, SNAPMOGEN
from tests.support.motions import dancer, drift
from tests.support.stepping import sliding

LENGTHS = np.linalg.norm(HUMANML3D.offsets.astype(float), axis=1)[1:]
TRAINING = NamedBody("training", HUMANML3D)


def decoded(seed: int, frames: int = 40, size: float = 0.01):
    """Joints (T, 22, 3) of a dancer with a decoder's noise: bones that change by centimetres."""
    joints = forward_kinematics(HUMANML3D, *dancer(seed, frames))
    return joints + drift(seed, frames, 66, size).reshape(frames, 22, 3)


def of_another_size(seed: int):
    """Features of a walk on a body of another size in every clip, as a decoder makes them."""
    return HUMANML3D_263.encode(sliding(0.02, seed) * np.random.default_rng(seed).uniform(0.95, 1.05))


@pytest.mark.parametrize("training", [HUMANML3D, KIT, SNAPMOGEN], ids=lambda each: each.name)
def test_the_standard_body_is_the_training_skeleton_at_1_75_metres(training):
    body = standard_body(training).skeleton
    assert stature(body) == pytest.approx(STATURE, abs=1e-5)
    scale = travel_scale(training, body)
    np.testing.assert_allclose(body.offsets, scale * training.offsets, atol=2e-5 if training is SNAPMOGEN else 2e-6)


def test_the_standard_body_of_an_adult_of_1_73_metres_is_larger_by_a_hundredth():
    assert travel_scale(HUMANML3D, standard_body(HUMANML3D).skeleton) == pytest.approx(1.75 / 1.73, abs=1e-6)


def test_offsets_are_the_same_bits_after_json():
    offsets = standard_body(HUMANML3D).skeleton.offsets
    there = [[round(float(x), 6) for x in offset] for offset in offsets]
    np.testing.assert_array_equal(np.array(json.loads(json.dumps(there)), np.float32), offsets)


def test_bodies_have_equal_hashes_if_their_skeletons_are_equal():
    other = HUMANML3D.offsets.copy()
    other[4] *= 1.001
    assert TRAINING.sha256 == NamedBody("again", HUMANML3D.with_offsets(HUMANML3D.offsets.copy())).sha256
    assert TRAINING.sha256 != NamedBody("training", HUMANML3D.with_offsets(other)).sha256


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.0, 0.012))
def test_bones_of_any_decoder_get_the_lengths_of_the_skeleton(seed, size):
    joints = decoded(seed, size=size)
    fitted = BoneFit(HUMANML3D).fit(joints)
    assert np.abs(bone_lengths(fitted, HUMANML3D)[:, 1:] - LENGTHS).max() < 0.003
    before = np.abs(bone_lengths(joints, HUMANML3D)[:, 1:] - LENGTHS).mean()
    assert np.linalg.norm(fitted - joints, axis=-1).mean() < 2 * before + 1e-6


def test_joints_that_have_the_bones_already_stay_where_they_are():
    joints = forward_kinematics(HUMANML3D, *dancer(3, 40))
    np.testing.assert_allclose(BoneFit(HUMANML3D).fit(joints), joints, atol=1e-6)


def test_joints_that_are_no_body_stay_finite():
    noise = np.random.default_rng(0).normal(size=(20, 22, 3)) * 10
    for joints in (noise, np.zeros_like(noise)):
        assert np.isfinite(BoneFit(HUMANML3D).fit(joints)).all()


def test_toes_move_least_since_they_stand():
    joints = decoded(5)
    moved = np.linalg.norm(BoneFit(HUMANML3D).fit(joints) - joints, axis=-1).mean(axis=0)
    assert moved[[10, 11]].max() < 0.2 * moved.mean()


def test_a_leg_that_was_made_too_long_does_not_turn_the_pelvis():
    joints = np.repeat(HUMANML3D.rest[None].astype(np.float64), 2, axis=0)
    right = [HUMANML3D.joint_names.index(f"R_{name}") for name in ("knee", "ankle", "foot")]
    joints[0, right] += [[0.0, -0.06, 0.06], [0.0, -0.1, 0.1], [0.0, -0.1, 0.1]]  # a swing that a decoder stretched
    joints[1, right] += [[0.0, -0.005, 0.0], [0.0, -0.005, 0.0], [0.0, -0.005, 0.0]]  # a stance
    fitted = BoneFit(HUMANML3D).fit(joints)
    hips = fitted[:, HUMANML3D.facing[0]] - fitted[:, HUMANML3D.facing[1]]
    assert np.degrees(np.abs(np.arctan2(hips[:, 2], -hips[:, 0]))).max() < 3
    moved = np.linalg.norm(fitted - joints, axis=-1)[:, right[-1]]
    assert moved[0] > 0.05
    assert moved[1] < 0.002


def test_all_clips_have_the_same_offsets_to_the_last_bit():
    clips = [finish_motion(of_another_size(seed), HUMANML3D_263, fps=fps) for seed in range(4) for fps in (20, 60)]
    assert len({clip.offsets.tobytes() for clip in clips}) == 1
    heads = {format_bvh(clip).split("MOTION")[0] for clip in clips}
    assert len(heads) == 1


def test_streams_have_the_offsets_of_clips():
    clip = finish_motion(of_another_size(0), HUMANML3D_263)
    np.testing.assert_array_equal(LiveMotion(HUMANML3D_263).skeleton.offsets, clip.offsets)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 1000), st.sampled_from([20.0, 30.0, 60.0]))
def test_a_file_of_the_body_is_read_back_with_its_joints(seed, fps):
    clip = finish_motion(of_another_size(seed), HUMANML3D_263, fps=fps)
    read = parse_bvh(format_bvh(clip).encode())
    order = [read.skeleton.joint_names.index(name) for name in HUMANML3D.joint_names]
    assert np.linalg.norm(read.joints()[:, order] - clip.joints, axis=-1).max() < 1e-3
    np.testing.assert_allclose(read.skeleton.offsets[order][1:], clip.offsets[1:], atol=1e-7)


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 1000))
def test_feet_that_stand_are_locked_on_the_body(seed):
    clip = finish_motion(of_another_size(seed), HUMANML3D_263)
    assert clip.contacts[:, 1::2].mean() > 0.3
    assert skate(clip.joints, clip.contacts, clip.skeleton, clip.fps) < 1e-3


def test_the_pose_on_the_training_skeleton_is_near_to_what_was_decoded():
    features = of_another_size(1)
    clip = finish_motion(features, HUMANML3D_263, body=TRAINING, clean=False)
    off = np.linalg.norm(clip.joints - HUMANML3D_263.decode(features), axis=-1)
    assert off.mean() < 0.015


def test_travel_grows_with_the_body():
    features = of_another_size(2)
    one, two = (
        finish_motion(features, HUMANML3D_263, body=body, clean=False) for body in (TRAINING, standard_body(HUMANML3D))
    )
    way = [np.linalg.norm(clip.root[-1] - clip.root[0]) for clip in (one, two)]
    assert way[1] / way[0] == pytest.approx(1.75 / 1.73, abs=1e-4)


def test_bones_of_a_long_motion_are_those_of_its_parts() -> None:
    joints, fit = decoded(4, 2 * AT_ONCE + 30), BoneFit(HUMANML3D)
    whole = fit.fit(joints)
    assert np.array_equal(whole, np.concatenate([fit.fit(part) for part in np.array_split(joints, 5)]))
    assert fit.fit(joints[:0]).shape == (0, 22, 3)


def test_bones_of_a_minute_take_hardly_more_memory_than_those_of_ten_seconds() -> None:
    joints, fit = decoded(4, 1200), BoneFit(HUMANML3D)

    def peak(frames: int) -> int:
        tracemalloc.start()
        fit.fit(joints[:frames])
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    peak(200)
    assert peak(1200) - peak(200) < 5 * joints.nbytes
