from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.motion.features import mirror_joints
from marey.motion.kinematics import bone_lengths, forward_kinematics
from marey.motion.pose import measure_offsets, solve_pose
from marey.motion.rigid import fit_rotation
from marey.motion.rotations import about, angle_between, from_rotvec, multiply, rotate, to_rotvec
from marey.motion.skeleton import HUMANML3D, KIT, SKELETONS
from tests.support.exported import tumbling
from tests.support.motions import dancer, drift
from tests.support.walker import walker


def joints_of(rotations, root, skeleton=HUMANML3D):
    return forward_kinematics(skeleton, rotations, root)


def steps(rotations) -> float:
    """Degrees of the largest turn of any joint between two frames."""
    return float(np.degrees(angle_between(rotations[1:], rotations[:-1])).max())


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 1000), st.integers(1, 90))
def test_joints_of_a_body_come_back_exactly(seed, frames):
    joints = joints_of(*dancer(seed, frames))
    pose = solve_pose(joints, HUMANML3D)
    np.testing.assert_allclose(pose.joints, joints, atol=2e-6)
    np.testing.assert_allclose(forward_kinematics(pose.skeleton, pose.rotations, pose.root), pose.joints, atol=1e-9)
    np.testing.assert_allclose(pose.offsets, HUMANML3D.offsets, atol=1e-6)


@pytest.mark.parametrize("skeleton", [HUMANML3D, KIT])
def test_any_joints_on_fixed_bones_come_back(skeleton):
    clip = tumbling(skeleton, 20)
    pose = solve_pose(clip.joints, skeleton, measure=False)
    # a tumbling spine bends more than a fit of the chest can follow; all else is met
    assert np.linalg.norm(pose.joints - clip.joints, axis=-1).max() < 1e-3


@pytest.mark.parametrize("seed", range(5))
def test_rotations_of_bodies_and_of_limbs_with_a_bend_come_back(seed):
    rotations, root = dancer(seed, 80)
    solved = solve_pose(joints_of(rotations, root), HUMANML3D).rotations
    off = np.degrees(angle_between(solved, rotations))
    assert off[:, HUMANML3D.index("pelvis")].max() < 0.01
    for hip, knee in (("L_hip", "L_knee"), ("R_hip", "R_knee")):
        bent = np.linalg.norm(to_rotvec(rotations[:, HUMANML3D.index(knee)]), axis=-1) > 0.6
        assert off[bent, HUMANML3D.index(hip)].max() < 35
        assert off[bent, HUMANML3D.index(hip)].mean() < 6


def test_elbows_bent_ahead_of_a_t_pose_turn_about_the_vertical_on_both_sides():
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (3, 22, 1))
    for side, sign in (("L", -1), ("R", 1)):  # towards +Z
        rotations[:, HUMANML3D.index(f"{side}_elbow")] = about("y", np.radians(sign * 80.0))
    joints = forward_kinematics(HUMANML3D, rotations, np.zeros((3, 3)))
    assert (joints[:, [20, 21], 2] > joints[:, [18, 19], 2] + 0.2).all()
    solved = solve_pose(joints, HUMANML3D).rotations
    for side in ("L", "R"):
        for joint in (f"{side}_shoulder", f"{side}_elbow"):
            off = angle_between(solved[:, HUMANML3D.index(joint)], rotations[:, HUMANML3D.index(joint)])
            assert np.degrees(off).max() < 1, joint


def test_a_bent_knee_turns_about_its_hinge():
    joints = joints_of(*dancer(1, 80))
    knee = to_rotvec(solve_pose(joints, HUMANML3D).rotations[:, HUMANML3D.index("L_knee")])
    assert knee[:, 0].min() > 0, "knees bend backwards only"
    assert np.abs(knee[:, 1:]).max() < 0.25 * np.abs(knee[:, 0]).max()


def test_quaternions_do_not_change_sign_between_frames():
    pose = solve_pose(joints_of(*dancer(2, 120)), HUMANML3D)
    assert np.einsum("tji,tji->tj", pose.rotations[1:], pose.rotations[:-1]).min() > 0.5


@pytest.mark.parametrize("joint", ["L_elbow", "R_elbow", "L_knee"])
def test_a_limb_that_is_straight_for_a_while_does_not_spin(joint):
    rotations, root = dancer(4, 100)
    j = HUMANML3D.index(joint)
    bend = np.clip(np.abs(np.linspace(-1.5, 1.5, 100)) - 0.4, 0, None)  # bent, straight for a second, bent
    rotations[:, j] = from_rotvec(bend[:, None] * np.array([1.0, 0, 0] if "knee" in joint else [0, -1.0, 0]))
    if joint.startswith("R_elbow"):
        rotations[:, j] = from_rotvec(bend[:, None] * np.array([0, 1.0, 0]))
    noise = drift(9, 100, 66, 0.001).reshape(100, 22, 3)
    pose = solve_pose(joints_of(rotations, root) + noise, HUMANML3D)
    assert steps(pose.rotations) < steps(rotations) + 15


def test_noise_of_millimetres_makes_no_flips():
    rotations, root = dancer(5, 196)
    joints = joints_of(rotations, root)
    noisy = joints + drift(1, 196, 66, 0.004).reshape(196, 22, 3)
    pose = solve_pose(noisy, HUMANML3D)
    assert steps(pose.rotations) < steps(solve_pose(joints, HUMANML3D).rotations) + 20
    assert np.linalg.norm(pose.joints - noisy, axis=-1).mean() < 0.005


def test_bones_keep_their_length_and_both_sides_are_equal():
    joints = joints_of(*dancer(6, 60)) * 1.1 + drift(3, 60, 66, 0.005).reshape(60, 22, 3)
    pose = solve_pose(joints, HUMANML3D)
    lengths = bone_lengths(pose.joints, HUMANML3D)
    assert np.ptp(lengths, axis=0).max() < 1e-9
    np.testing.assert_allclose(lengths[0], lengths[0, list(HUMANML3D.mirror)], atol=1e-6)
    np.testing.assert_allclose(pose.offsets[:, 0], -pose.offsets[list(HUMANML3D.mirror), 0], atol=1e-6)
    assert lengths[0, 4] == pytest.approx(1.1 * 0.39, rel=0.02)


def test_the_t_pose_of_a_bigger_body_stands_on_the_floor_too():
    pose = solve_pose(1.2 * joints_of(*dancer(6, 60)), HUMANML3D)
    assert pose.skeleton.rest[:, 1].min() == pytest.approx(0, abs=1e-5)
    assert pose.offsets[0, 1] == pytest.approx(1.2 * 0.94, abs=1e-5)


def test_another_body_is_measured_in_its_own_frame():
    """Hips further back and apart than in our T-pose: what SMPL's pelvis looks like."""
    other = HUMANML3D.offsets.copy()
    other[[1, 2]] += [[0.02, 0, -0.02], [-0.02, 0, -0.02]]
    other[[13, 14], 1] -= 0.03
    skeleton = HUMANML3D.with_offsets(other)
    rotations, root = dancer(7, 60)
    joints = joints_of(rotations, root, skeleton)
    assert np.linalg.norm(solve_pose(joints, HUMANML3D).joints - joints, axis=-1).max() < 1e-5
    measured = measure_offsets(joints, HUMANML3D)
    assert np.linalg.norm(measured[1] - measured[2]) == pytest.approx(0.2, abs=1e-5)


def test_a_mirrored_motion_has_mirrored_rotations():
    joints = joints_of(*dancer(8, 60))
    pose, other = solve_pose(joints, HUMANML3D), solve_pose(mirror_joints(joints, HUMANML3D), HUMANML3D)
    mirrored = pose.rotations[:, list(HUMANML3D.mirror)] * [1, 1, -1, -1]
    assert np.degrees(angle_between(mirrored, other.rotations)).max() < 0.1


def test_turning_and_moving_a_motion_turns_and_moves_its_root_alone():
    joints = joints_of(*dancer(9, 60))
    turn = about("Y", 2.0)
    pose = solve_pose(joints, HUMANML3D)
    moved = solve_pose(rotate(turn, joints) + np.array([1.0, 2.0, 3.0]), HUMANML3D)
    assert np.degrees(angle_between(moved.rotations[:, 1:], pose.rotations[:, 1:])).max() < 1e-3
    assert np.degrees(angle_between(moved.rotations[:, 0], multiply(turn, pose.rotations[:, 0]))).max() < 1e-3


def test_a_spine_shares_its_twist():
    rotations, root = dancer(0, 40)
    rotations[:, :] = [1, 0, 0, 0]
    rotations[:, HUMANML3D.index("spine3")] = about("Y", np.linspace(0, 0.9, 40))
    turned = np.degrees(np.linalg.norm(to_rotvec(solve_pose(joints_of(rotations, root), HUMANML3D).rotations), axis=-1))
    chain = [HUMANML3D.index(n) for n in ("spine1", "spine2", "spine3")]
    np.testing.assert_allclose(turned[-1, chain], np.degrees(0.3), atol=0.1)


def test_snapmogens_rig_with_a_bone_of_no_length_is_solved():
    skeleton = SKELETONS["snapmogen"]
    rotations = from_rotvec(drift(2, 50, 72, 0.25).reshape(50, 24, 3))
    rotations[:, [0, 15]] = [1, 0, 0, 0]
    joints = joints_of(rotations, np.zeros((50, 3)), skeleton)
    pose = solve_pose(joints, skeleton)
    assert np.linalg.norm(pose.joints - joints, axis=-1).max() < 1e-3
    assert steps(pose.rotations) < 75  # elbows here bend any way, which real ones do not


def test_one_frame_is_enough():
    clip = walker()
    pose = solve_pose(clip.joints[:1], HUMANML3D)
    np.testing.assert_allclose(pose.joints, clip.joints[:1], atol=1e-4)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 1000))
def test_a_fit_finds_the_rotation(seed):
    random = np.random.default_rng(seed)
    rest = random.normal(size=(3, 3))
    turns = from_rotvec(random.normal(size=(5, 3)))
    assert angle_between(fit_rotation(rest, rotate(turns[:, None], rest)), turns).max() < 1e-4


def test_a_fit_of_one_line_turns_no_more_than_it_must():
    rest = np.array([[0, 1.0, 0], [0, 2.0, 0]])
    turn = about("X", np.array([0.4]))
    assert angle_between(fit_rotation(rest, rotate(turn[:, None], rest)), turn).max() < 1e-3


@pytest.mark.parametrize("bad", [np.zeros((5, 21, 3)), np.zeros((0, 22, 3)), np.full((5, 22, 3), np.nan)])
def test_joints_that_are_none_are_refused(bad):
    with pytest.raises(InvalidInput):
        solve_pose(bad, HUMANML3D)


def test_joints_all_in_one_place_are_solved_without_nan():
    pose = solve_pose(np.zeros((5, 22, 3)), HUMANML3D)
    assert np.isfinite(pose.rotations).all()


def test_a_folded_forearm_that_moves_a_little_turns_a_little():
    frames, elbow, wrist = 24, HUMANML3D.index("L_elbow"), HUMANML3D.index("L_wrist")
    joints = np.repeat(HUMANML3D.rest[None].astype(float), frames, axis=0)
    circle, fold = np.linspace(0, 4 * np.pi, frames), np.radians(12)
    back = np.stack([np.full(frames, -np.cos(fold)), np.sin(fold) * np.sin(circle), np.sin(fold) * np.cos(circle)], -1)
    joints[:, wrist] = joints[:, elbow] + 0.25 * back
    solved = solve_pose(joints, HUMANML3D, measure=False)
    np.testing.assert_allclose(solved.joints, joints, atol=1e-5)
    moved = np.degrees(angle_between(solved.rotations[1:, elbow], solved.rotations[:-1, elbow]))
    assert moved.max() < 12
