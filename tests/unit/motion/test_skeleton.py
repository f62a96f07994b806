from __future__ import annotations

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.motion.kinematics import bone_lengths, facing, forward_kinematics
from marey.motion.rotations import IDENTITY, about
from marey.motion.skeleton import (
    HUMANML3D,
    KIT,
    SKELETONS,
    SNAPMOGEN,
    Skeleton,
    known_order,
    mirror_by_name,
    skeleton_of,
)

# As published: EricGuo5513/HumanML3D, paramUtil.py; KIT in EricGuo5513/momask-codes, utils/paramUtil.py
HML_PARENTS = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
KIT_PARENTS = (-1, 0, 1, 2, 3, 3, 5, 6, 3, 8, 9, 0, 11, 12, 13, 14, 0, 16, 17, 18, 19)
HML_RIGHT, HML_LEFT = (2, 5, 8, 11, 14, 17, 19, 21), (1, 4, 7, 10, 13, 16, 18, 20)


def test_trees_are_the_published_ones():
    assert HUMANML3D.parents == HML_PARENTS
    assert KIT.parents == KIT_PARENTS
    assert (len(HUMANML3D), len(KIT), len(SNAPMOGEN)) == (22, 21, 24)
    assert (HUMANML3D.feet, HUMANML3D.facing) == ((7, 10, 8, 11), (2, 1, 17, 16))
    assert (KIT.feet, KIT.facing) == ((19, 20, 14, 15), (11, 16, 5, 8))
    assert [
        SNAPMOGEN.joint_names.index(n) for n in ("L_clavicle_bind_JNT", "C_pelvis0001_bind_JNT", "R_foot0002_bind_JNT")
    ] == [7, 15, 23]


def test_humanml3d_mirrors_the_published_pairs():
    assert [HUMANML3D.mirror[j] for j in HML_RIGHT] == list(HML_LEFT)


@pytest.mark.parametrize("skeleton", SKELETONS.values(), ids=SKELETONS)
def test_the_t_pose_is_symmetrical_faces_z_and_stands(skeleton):
    rest = skeleton.rest
    off = 2e-5 if skeleton is SNAPMOGEN else 1e-6  # its published hands are 10 micrometres apart
    np.testing.assert_allclose(rest[list(skeleton.mirror)] * [-1, 1, 1], rest, atol=off)
    np.testing.assert_allclose(facing(rest.astype(float), skeleton), [0, 0, 1], atol=off)
    left_toe, left_ankle = skeleton.feet[1], skeleton.feet[0]
    assert rest[left_toe, 2] > rest[left_ankle, 2]
    assert rest[left_toe, 0] > 0, "left is +X"
    assert rest[skeleton.facing[3], 0] > 0


@pytest.mark.parametrize("skeleton", [HUMANML3D, KIT])
def test_people_are_of_adult_size_and_stand_on_the_floor(skeleton):
    assert skeleton.rest[:, 1].min() == pytest.approx(0, abs=1e-6)
    assert 1.5 < skeleton.rest[:, 1].max() < 1.7  # joints end at the head's base


def test_forward_kinematics_of_no_rotation_is_the_t_pose():
    rotations = np.tile(IDENTITY, (2, 22, 1))
    joints = forward_kinematics(HUMANML3D, rotations, np.tile(HUMANML3D.offsets[0], (2, 1)))
    np.testing.assert_allclose(joints[1], HUMANML3D.rest, atol=1e-6)


def test_a_joint_turns_what_hangs_on_it_and_nothing_else():
    rotations = np.tile(IDENTITY, (1, 22, 1))
    elbow, wrist = HUMANML3D.index("L_elbow"), HUMANML3D.index("L_wrist")
    rotations[0, elbow] = about("Y", -np.pi / 2)
    still = forward_kinematics(HUMANML3D, np.tile(IDENTITY, (1, 22, 1)), np.zeros((1, 3)))
    bent = forward_kinematics(HUMANML3D, rotations, np.zeros((1, 3)))
    assert np.flatnonzero(np.abs(bent - still).max(axis=(0, 2)) > 1e-9).tolist() == [wrist]
    np.testing.assert_allclose(bent[0, wrist] - bent[0, elbow], [0, 0, 0.25], atol=1e-6)
    np.testing.assert_allclose(bone_lengths(bent, HUMANML3D), bone_lengths(still, HUMANML3D), atol=1e-9)


@pytest.mark.parametrize(
    ("names", "mirror"),
    [
        (("Hips", "LeftArm", "RightArm"), (0, 2, 1)),
        (("hips", "hand_l", "hand_r", "spine_lower"), (0, 2, 1, 3)),
        (("Root", "CC_Base_L_Thigh", "CC_Base_R_Thigh"), (0, 2, 1)),
        (("pelvis", "thigh.L", "thigh.R"), (0, 2, 1)),
        (("Hips", "LeftArm"), (0, 1)),
    ],
)
def test_sides_are_paired_by_name(names, mirror):
    assert mirror_by_name(names) == mirror


def test_known_joints_are_found_in_any_order():
    order = [0, 3, 6, 9, 12, 15, 13, 16, 18, 20, 14, 17, 19, 21, 1, 4, 7, 10, 2, 5, 8, 11]
    names = tuple(HUMANML3D.joint_names[j] for j in order)
    parents = tuple(order.index(p) if p >= 0 else -1 for p in (HUMANML3D.parents[j] for j in order))
    found = known_order(names, parents)
    assert found is not None
    assert found[0] is HUMANML3D
    assert tuple(names[j] for j in found[1]) == HUMANML3D.joint_names
    assert known_order(names[:-1], parents[:-1]) is None


def test_skeleton_of_knows_ours_and_makes_others():
    assert skeleton_of(KIT.joint_names, KIT.parents, KIT.offsets).feet == KIT.feet
    assert skeleton_of(("a", "b"), (-1, 0), np.zeros((2, 3))).feet == ()


@pytest.mark.parametrize(
    ("names", "parents"),
    [
        ((), ()),
        (("a", "b"), (-1, 1)),
        (("a", "b"), (0, 0)),
        (("a", "a"), (-1, 0)),
        (("a", "b"), (-1, 5)),
        (("a",), (-1, 0)),
    ],
)
def test_a_tree_that_is_none_is_refused(names, parents):
    with pytest.raises(InvalidInput, match=r"^x: "):
        Skeleton("x", names, parents, np.zeros((len(names), 3), np.float32), tuple(range(len(names))))


@pytest.mark.parametrize("shape", [(1, 3), (3, 3), (2, 2), (2,)])
def test_offsets_of_another_shape_are_refused(shape) -> None:
    with pytest.raises(InvalidInput, match=r"^x: offsets have shape .*, not \(2, 3\)"):
        Skeleton("x", ("a", "b"), (-1, 0), np.zeros(shape, np.float32), (0, 1))


def test_of_two_sides_in_a_name_the_first_is_swapped() -> None:
    names = ("left_arm_left", "right_arm_left", "hips")
    assert mirror_by_name(names) == (1, 0, 2)
