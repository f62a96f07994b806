from __future__ import annotations

from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput, NotFound
from marey.motion.features import (
    HUMANML3D_263,
    KIT_251,
    LAYOUTS,
    FeatureLayout,
    canonicalize,
    encode_all,
    layout,
    mirror_joints,
)
from marey.motion.filters import smooth, smooth_above
from marey.motion.kinematics import facing, forward_kinematics
from marey.motion.rotations import about, angle_between, from_6d, from_rotvec, multiply, rotate
from marey.motion.skeleton import HUMANML3D, Skeleton
from tests.support.motions import dancer, drift
from tests.support.walker import walker

HEADING = (HUMANML3D_263, KIT_251)


def dance(skeleton: Skeleton = HUMANML3D, seed: int = 0, frames: int = 60, turns: float = 0.0):
    """Joints of a dancer, who can also spin; on KIT's skeleton any rotations do."""
    if skeleton is HUMANML3D:
        rotations, root = dancer(seed, frames)
    else:
        rotations = from_rotvec(drift(seed, frames, 3 * len(skeleton), 0.3).reshape(frames, -1, 3))
        root = np.array([0, 0.9, 0]) + drift(seed + 1, frames, 3, 0.3)
    joints = forward_kinematics(skeleton, rotations, root)
    return rotate(about("Y", np.linspace(0, 2 * np.pi * turns, frames))[:, None], joints)


def test_a_body_in_humanml3ds_raw_pose_has_no_rotations():
    """Bones along the raw directions of HumanML3D: hips to the sides, legs and arms down, feet ahead, trunk up."""
    up, down, ahead, left, right = (0, 1, 0), (0, -1, 0), (0, 0, 1), (1, 0, 0), (-1, 0, 0)
    bones = {"L_hip": left, "R_hip": right, "L_collar": left, "R_collar": right, "L_foot": ahead, "R_foot": ahead}
    bones |= dict.fromkeys(("spine1", "spine2", "spine3", "neck"), up) | {"head": ahead}
    joints = np.zeros((4, 22, 3))
    for j, (name, parent) in enumerate(zip(HUMANML3D.joint_names, HUMANML3D.parents, strict=True)):
        if parent >= 0:
            length = np.linalg.norm(HUMANML3D.offsets[j])
            joints[:, j] = joints[:, parent] + length * np.array(bones.get(name, down))
    joints[..., 1] -= joints[..., 1].min()
    rotations = HUMANML3D_263.encode(joints)[:, 67:193].reshape(-1, 21, 6)
    np.testing.assert_allclose(rotations, np.broadcast_to([1, 0, 0, 0, 1, 0], rotations.shape), atol=1e-5)


@pytest.mark.parametrize("name", LAYOUTS)
def test_layouts_have_the_published_widths_and_slices(name):
    each = layout(name)
    assert isinstance(each, FeatureLayout)
    assert each.dim == int(name.rsplit("-", 1)[1])
    ends = [s.stop for s in each.slices.values()]
    assert ends[-1] == each.dim
    assert [s.start for s in each.slices.values()] == [0, *ends[:-1]]
    if name == "humanml3d-263":
        assert ends == [1, 3, 4, 67, 193, 259, 263]
    elif name == "kit-251":
        assert ends == [1, 3, 4, 64, 184, 247, 251]
    else:
        assert ends == [1, 3, 4, 148, 220, 292, 296]


def test_an_unknown_layout_is_not_found():
    with pytest.raises(NotFound, match="humanml3d-263"):
        layout("humanml3d-264")


@settings(max_examples=25, deadline=None)
@given(st.sampled_from(HEADING), st.integers(0, 50), st.integers(2, 90), st.floats(-4, 4))
def test_decoding_gives_back_the_canonical_joints(each, seed, frames, turns):
    joints = dance(each.skeleton, seed, frames, turns)
    features = each.encode(joints)
    assert features.shape == (frames - 1, each.dim)
    assert features.dtype == np.float32
    np.testing.assert_allclose(each.decode(features), canonicalize(joints, each.skeleton)[:-1], atol=1e-5)


@pytest.mark.parametrize("sigma", [0.0, 5.0, 20.0])
def test_decoding_does_not_depend_on_how_the_heading_was_found(sigma):
    joints = dance(turns=1.5)
    own = HUMANML3D_263.with_facing(sigma=sigma)
    np.testing.assert_allclose(HUMANML3D_263.decode(own.encode(joints)), own.canonicalize(joints)[:-1], atol=1e-5)


@pytest.mark.parametrize("each", HEADING, ids=lambda each: each.name)
def test_features_do_not_depend_on_where_the_body_is_and_faces(each):
    joints = dance(each.skeleton)
    moved = rotate(about("Y", 2.1), joints) + np.array([3.0, 0.4, -7.0])
    np.testing.assert_allclose(each.encode(moved), each.encode(joints), atol=2e-4 / each.unit**0.5)


def test_canonical_motion_faces_z_over_the_origin_on_the_floor():
    place = canonicalize(dance(turns=0.3) + np.array([5, 2, 1]), HUMANML3D)
    np.testing.assert_allclose(facing(place[0], HUMANML3D), [0, 0, 1], atol=1e-9)
    np.testing.assert_allclose(place[0, 0, [0, 2]], 0, atol=1e-9)
    assert place[..., 1].min() == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("each", HEADING, ids=lambda each: each.name)
@pytest.mark.parametrize("last_step", [-0.08, 0.0, 0.08])
def test_a_whole_motion_stays_on_the_floor_when_it_ends_in_a_step_down_or_up(each, last_step):
    joints = dance(each.skeleton)
    joints[-2:] = joints[:1]
    joints[..., 1] -= joints[..., 1].min()
    foot = each.skeleton.feet[0]
    joints[-2:, foot, 1] = max(-last_step, 0.0), max(last_step, 0.0)
    made = each.decode(encode_all(each, joints))
    assert len(made) == len(joints)
    assert made[..., 1].min() == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("falls", [0.0, 0.05, 0.3])
def test_a_hanging_body_keeps_its_height_whatever_its_last_step(falls):
    joints = dance()
    joints[..., 1] += 0.15 - joints[..., 1].min()
    joints[-2] += [0.0, falls, 0.0]
    made = HUMANML3D_263.decode(encode_all(HUMANML3D_263, joints))
    np.testing.assert_allclose(made[..., 1], joints[..., 1], atol=1e-5)


def test_the_yaw_rate_is_half_the_step_of_the_heading():
    clip = walker(turn=0.8, seconds=4)
    features = HUMANML3D_263.with_facing(sigma=0.0).encode(clip.joints)
    per_frame = 0.8 / clip.fps  # to the left, which is about +Y
    assert features[10:-10, 0].mean() == pytest.approx(-per_frame / 2, rel=0.02)


def test_a_spinning_body_has_no_wrong_yaw_where_it_passes_behind():
    clip = walker(turn=2.0, seconds=8)  # two and a half turns
    yaw = HUMANML3D_263.encode(clip.joints)[1:, 0]
    assert yaw.max() < 0


def test_the_measured_start_jumps_and_the_smoothed_start_does_not():
    joints = dance(seed=3)
    published = HUMANML3D_263.encode(joints)[:, 0]
    smooth = HUMANML3D_263.with_facing(sigma=20.0).encode(joints)[:, 0]
    assert abs(published[0]) > 5 * abs(published[1])
    assert abs(smooth[0]) < 2 * abs(smooth[1]) + 1e-3


def test_root_velocity_is_turned_by_the_next_heading_and_joint_velocity_by_this_one():
    joints = dance(turns=1.0)
    each = HUMANML3D_263.with_facing(sigma=0.0, start="measured")
    features, place = each.encode(joints), canonicalize(joints, HUMANML3D)
    angle = np.concatenate([[0], np.cumsum(features[:, 0].astype(float))])
    steps = place[1:] - place[:-1]
    for t in (0, 7, 30):
        ahead, here = about("Y", 2 * angle[t + 1]), about("Y", 2 * angle[t])
        np.testing.assert_allclose(features[t, 1:3], rotate(ahead, steps[t, 0])[[0, 2]], atol=1e-6)
        np.testing.assert_allclose(
            features[t, each.slices["velocities"]].reshape(22, 3), rotate(here, steps[t]), atol=1e-6
        )
        np.testing.assert_allclose(
            features[t, each.slices["positions"]].reshape(21, 3),
            rotate(here, place[t, 1:] - place[t, :1] * [1, 0, 1]),
            atol=1e-6,
        )


def test_6d_rotations_turn_raw_directions_along_chains_that_restart_at_the_root():
    joints = dance(seed=2, turns=0.5)
    features, place = HUMANML3D_263.encode(joints), canonicalize(joints, HUMANML3D)
    angle = np.concatenate([[0], np.cumsum(features[:, 0].astype(float))])
    local = from_6d(features[:, HUMANML3D_263.slices["rotations"]].reshape(-1, 21, 6).astype(float))
    raw = {1: [1, 0, 0], 4: [0, -1, 0], 7: [0, -1, 0], 10: [0, 0, 1], 13: [1, 0, 0], 16: [0, -1, 0], 18: [0, -1, 0]}
    for chain in ([0, 1, 4, 7, 10], [9, 13, 16, 18]):
        for t in (0, 20):
            turn = about("Y", 2 * angle[t])
            for parent, child in pairwise(chain):
                turn = multiply(turn, local[t, child - 1])
                bone = place[t, child] - place[t, parent]
                np.testing.assert_allclose(
                    rotate(turn, np.array(raw[child], float)), bone / np.linalg.norm(bone), atol=1e-5
                )


def test_6d_blocks_are_rotations():
    six = HUMANML3D_263.encode(dance())[:, 67:193].reshape(-1, 6)
    np.testing.assert_allclose(np.linalg.norm(six[:, :3], axis=1), 1, atol=1e-5)
    np.testing.assert_allclose(np.einsum("ni,ni->n", six[:, :3], six[:, 3:]), 0, atol=1e-5)
    assert angle_between(from_6d(six), from_6d(six)).max() < 1e-5


def test_contacts_are_feet_slower_than_the_threshold_left_before_right():
    joints = dance().copy()
    joints[:, [7, 10]] = joints[0, [7, 10]]  # the left foot stands
    joints[:, [8, 11]] += np.linspace(0, 20, len(joints))[:, None, None] * [0, 0, 1]  # the right one flies
    contacts = HUMANML3D_263.contacts(HUMANML3D_263.encode(joints))
    assert contacts[:, :2].all()
    assert not contacts[:, 2:].any()


def test_kit_counts_in_millimetres():
    features = KIT_251.encode(dance(KIT_251.skeleton))
    assert 200 < features[:, 3].mean() < 3000
    assert KIT_251.decode(features)[0, 0, 1] < 3


def test_a_mirror_exchanges_the_sides_and_undoes_itself():
    joints = dance()
    mirrored = mirror_joints(joints, HUMANML3D)
    np.testing.assert_array_equal(mirrored[:, 20], joints[:, 21] * [-1, 1, 1])
    np.testing.assert_array_equal(mirror_joints(mirrored, HUMANML3D), joints)


def test_features_of_the_mirrored_motion_turn_the_other_way():
    joints = dance(turns=0.5)
    a, b = HUMANML3D_263.encode(joints), HUMANML3D_263.encode(mirror_joints(joints, HUMANML3D))
    np.testing.assert_allclose(b[:, :2], -a[:, :2], atol=1e-5)
    np.testing.assert_allclose(b[:, 2:4], a[:, 2:4], atol=1e-5)
    np.testing.assert_array_equal(b[:, 259:], a[:, [261, 262, 259, 260]])


@pytest.mark.parametrize("each", HEADING, ids=lambda each: each.name)
def test_mirrored_features_are_those_of_the_mirrored_motion(each: FeatureLayout):
    joints = dance(each.skeleton, turns=0.5)
    features = each.encode(joints)
    np.testing.assert_allclose(each.mirror(features), each.encode(each.mirror_joints(joints)), rtol=1e-4, atol=1e-4)
    np.testing.assert_array_equal(each.mirror(each.mirror(features)), features)


def test_decode_takes_batches():
    batch = np.stack([HUMANML3D_263.encode(dance(seed=s)) for s in range(3)])
    together = HUMANML3D_263.decode(batch)
    assert together.shape == (3, 59, 22, 3)
    np.testing.assert_array_equal(together[1], HUMANML3D_263.decode(batch[1]))


@pytest.mark.parametrize("shape", [(10, 21, 3), (1, 22, 3), (10, 22), (0, 22, 3)])
def test_joints_of_another_shape_are_refused(shape):
    with pytest.raises(InvalidInput, match=r"^humanml3d-263: .*shape"):
        HUMANML3D_263.encode(np.zeros(shape))


def test_joints_that_are_not_finite_are_refused():
    joints = dance()
    joints[3, 4, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"^humanml3d-263: .*NaN"):
        HUMANML3D_263.encode(joints)


@pytest.mark.parametrize("shape", [(10, 251), (0, 263), (263,)])
def test_features_of_another_shape_are_refused(shape):
    with pytest.raises(InvalidInput, match=r"^humanml3d-263: .*shape"):
        HUMANML3D_263.decode(np.zeros(shape))


def test_smoothing_keeps_constants_and_narrows_noise():
    assert smooth(np.full((30, 2), 3.0), 5) == pytest.approx(3.0)
    noise = np.random.default_rng(0).normal(size=(500, 1))
    assert smooth(noise, 4).std() == pytest.approx((2 * 4 * np.pi**0.5) ** -0.5, rel=0.2)


@pytest.mark.parametrize("frames", [1, 4, 40])
@pytest.mark.parametrize("order", ["C", "F"])
def test_a_smoothed_frame_is_the_mean_of_those_around_it_with_the_ends_repeated(
    frames: int, order: Literal["C", "F"]
) -> None:
    values = np.asarray(np.random.default_rng(1).normal(size=(frames, 3)), order=order)
    weights = np.exp(-0.5 * (np.arange(-6, 7) / 2.0) ** 2)
    around = np.clip(np.arange(frames)[:, None] + np.arange(-6, 7), 0, frames - 1)
    wanted = (values[around] * (weights / weights.sum())[:, None]).sum(axis=1)
    np.testing.assert_allclose(smooth(values, 2.0), wanted, atol=1e-12)
    np.testing.assert_allclose(smooth_above(values[:, 0], 2.0), smooth(values[around, :1].max(axis=1), 2.0)[:, 0])


@pytest.mark.parametrize(("step", "stands"), [(0.04, True), (0.055, False)])
def test_a_foot_stands_while_it_moves_less_than_45_mm_a_frame(step: float, stands: bool) -> None:
    joints = np.repeat(HUMANML3D.rest[None].astype(np.float64), 20, axis=0)
    joints[..., 2] += step * np.arange(20)[:, None]
    contacts = HUMANML3D_263.encode(joints)[:, HUMANML3D_263.slices["contacts"]]
    assert (contacts == float(stands)).all()
