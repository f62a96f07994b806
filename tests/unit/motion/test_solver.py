from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.motion.kinematics import bone_lengths, forward_kinematics
from marey.motion.live_poses import LivePoses
from marey.motion.rotations import about, from_rotvec
from marey.motion.skeleton import HUMANML3D, KIT, SKELETONS, Skeleton
from marey.motion.solver import _limbs, _spines
from tests.support.motions import drift


def noisy(skeleton, seed, frames=12, noise=0.02):
    """Joints (T, J, 3) of a body that moves in every joint, and a decoder's noise on them."""
    count = len(skeleton)
    rotations = from_rotvec(drift(seed, frames, 3 * count, 0.4).reshape(frames, count, 3))
    joints = forward_kinematics(skeleton, rotations, drift(seed + 1, frames, 3, 0.3))
    return joints + drift(seed + 2, frames, 3 * count, noise).reshape(frames, count, 3)


def stretched(joints, skeleton):
    """Metres by which the most wrong bone is too long or too short."""
    right = np.linalg.norm(skeleton.offsets.astype(float), axis=1)
    return np.abs(bone_lengths(joints, skeleton) - right)[:, 1:].max()


@settings(max_examples=10, deadline=None)
@given(st.sampled_from([HUMANML3D, KIT]), st.integers(0, 1000))
def test_places_are_those_of_the_solved_pose(skeleton, seed):
    joints, live = noisy(skeleton, seed), LivePoses(skeleton, 20.0)
    pose, _ = live.run(joints, live.start())
    np.testing.assert_allclose(live.places(joints), pose.joints, atol=1e-9)


@pytest.mark.parametrize("skeleton", SKELETONS.values())
def test_places_lie_on_bones_of_the_skeletons_lengths(skeleton):
    assert stretched(LivePoses(skeleton, 20.0).places(noisy(skeleton, 3)), skeleton) < 1e-9


def test_places_of_joints_all_in_one_place_have_bones_too():
    assert stretched(LivePoses(HUMANML3D, 20.0).places(np.zeros((2, 22, 3))), HUMANML3D) < 1e-9


def test_a_chain_without_rigid_bodies_is_solved_too():
    offsets = np.array([[0, 0, 0], [0, 1, 0], [0, 1, 0], [0, 0.5, 0]], np.float32)
    chain = Skeleton("chain", ("a", "b", "c", "d"), (-1, 0, 1, 2), offsets, (0, 1, 2, 3))
    bent = about("X", np.linspace(0.1, 0.8, 12).reshape(3, 4))
    joints = forward_kinematics(chain, bent, np.ones((3, 3)))
    live = LivePoses(chain, 20.0)
    pose, _ = live.run(joints, live.start())
    np.testing.assert_allclose(pose.joints, joints, atol=1e-9)
    np.testing.assert_allclose(live.places(joints), joints, atol=1e-9)
    np.testing.assert_allclose(forward_kinematics(chain, pose.rotations, pose.root), joints, atol=1e-9)


def test_a_chain_that_begins_under_a_root_without_a_rigid_body_is_no_spine() -> None:
    assert _spines((-1, 0, 1, 2), frozenset({3})) == {}
    assert _spines((-1, 0, 1, 2), frozenset({0, 3})) == {1: (1, 2, 3)}


def test_knees_bend_one_way_and_elbows_both() -> None:
    limbs = _limbs(HUMANML3D.parents, HUMANML3D.facing)
    names = {HUMANML3D.joint_names[limb.upper]: limb.one_way for limb in limbs}
    assert names == {"R_hip": True, "L_hip": True, "R_shoulder": False, "L_shoulder": False}
