"""Hands that meet."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.motion.capsules import depth
from marey.motion.hands import APART, MEET, clear_arms, join_hands, wrist_distance
from marey.motion.kinematics import bone_lengths, forward_kinematics
from marey.motion.skeleton import HUMANML3D
from tests.support.arms import with_hand_in_the_trunk
from tests.support.motions import dancer
from tests.support.walker import walker

HANDS = [18, 19, 20, 21]  # elbows and wrists


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 500), st.floats(0.05, MEET))
def test_hands_that_meet_get_their_distance_and_bones_stay(seed, distance):
    joints = forward_kinematics(HUMANML3D, *dancer(seed, 30))
    now = wrist_distance(joints, HUMANML3D)
    wanted = np.where(np.abs(now - distance) < 0.06, distance, now)  # as far as proportions move a hand
    joined = join_hands(joints, wanted, HUMANML3D)
    near = wanted <= MEET
    assert np.abs(wrist_distance(joined, HUMANML3D) - wanted)[near].max(initial=0) < 0.02
    assert np.abs(bone_lengths(joined, HUMANML3D) - bone_lengths(joints, HUMANML3D)).max() < 1e-9
    others = [j for j in range(22) if j not in HANDS]
    np.testing.assert_array_equal(joined[:, others], joints[:, others])


def test_hands_that_are_3_cm_too_far_meet():
    joints = np.array(walker(seconds=2).joints, np.float64)
    wanted = wrist_distance(joints, HUMANML3D)
    assert wanted.min() > APART  # a walker's hands are apart
    middle = joints[:, [16, 17]].mean(axis=1) + np.array([0, -0.25, 0.3])
    for side, wrist, elbow, shoulder in ((1, 20, 18, 16), (-1, 21, 19, 17)):
        joints[:, wrist] = middle + np.array([side * 0.08, 0, 0])
        joints[:, elbow] = (joints[:, shoulder] + joints[:, wrist]) / 2 + [side * 0.1, -0.1, -0.1]
    joined = join_hands(joints, np.full(len(joints), 0.13), HUMANML3D)
    np.testing.assert_allclose(wrist_distance(joined, HUMANML3D), 0.13, atol=1e-6)


def test_hands_that_are_apart_are_left_alone_to_the_last_bit():
    joints = forward_kinematics(HUMANML3D, *dancer(1, 30))
    np.testing.assert_array_equal(join_hands(joints, np.full(30, APART), HUMANML3D), joints)


def test_an_arm_inside_the_trunk_comes_out_smoothly_and_bones_stay():
    joints = with_hand_in_the_trunk()
    cleared = clear_arms(joints, HUMANML3D, 20.0)
    assert depth(joints, "R_forearm", "trunk").max() > 0.03
    assert depth(cleared, "R_forearm", "trunk").max() < 0.01
    assert np.abs(bone_lengths(cleared, HUMANML3D) - bone_lengths(joints, HUMANML3D)).max() < 1e-9
    others = [j for j in range(22) if j not in (19, 21)]
    np.testing.assert_array_equal(cleared[:, others], joints[:, others])
    jerks = [np.abs(np.diff(each[:, 21], 2, axis=0)).max() for each in (joints, cleared)]
    assert jerks[1] < jerks[0] + 0.02


def test_arms_outside_of_the_body_are_left_alone_to_the_last_bit():
    joints = np.array(walker(seconds=2).joints, np.float64)
    np.testing.assert_array_equal(clear_arms(joints, HUMANML3D, 20.0), joints)


@pytest.mark.parametrize("size", [0.55, 1.3])
def test_hands_of_a_child_meet_as_those_of_an_adult(size):
    joints = forward_kinematics(HUMANML3D, *dancer(3, 60))
    wanted = wrist_distance(joints, HUMANML3D) - 0.03
    child = HUMANML3D.with_offsets(size * HUMANML3D.offsets)
    adults, childs = join_hands(joints, wanted, HUMANML3D), join_hands(size * joints, size * wanted, child)
    moved = wrist_distance(adults, HUMANML3D) - wrist_distance(joints, HUMANML3D)
    assert moved.min() < -0.02 < moved.max() == 0.0
    np.testing.assert_allclose(wrist_distance(childs, child) / size, wrist_distance(adults, HUMANML3D), atol=1e-3)
