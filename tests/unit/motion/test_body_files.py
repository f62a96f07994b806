"""Bodies of other proportions: read from files, refused where they are none, and motions on them."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.motion.body import standard_body, stature, travel_scale
from marey.motion.body_files import FOREIGN, read_body
from marey.motion.clip import MotionClip
from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.motion.hands import arms, join_hands, wrist_distance
from marey.motion.io.bvh import write_bvh
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import IDENTITY
from marey.motion.skeleton import HUMANML3D, KIT, Skeleton
from tests.support.motions import dancer
from tests.support.stepping import sliding


def shaped(legs: float = 1.0, arms: float = 1.0, size: float = 1.0) -> Skeleton:
    """A body with other legs and arms, toes on the floor."""
    offsets = size * HUMANML3D.offsets.astype(float)
    for j, name in enumerate(HUMANML3D.joint_names):
        offsets[j] *= legs if "knee" in name or "ankle" in name else arms if "elbow" in name or "wrist" in name else 1
    offsets[0] = 0
    offsets[0, 1] = -HUMANML3D.with_offsets(offsets).rest[:, 1].min()
    return HUMANML3D.with_offsets(np.round(offsets, 6))


CHILD, SHORT_LEGS, TALL = shaped(0.8, 0.85, 0.65), shaped(0.75), shaped(1.1, 1.1, 1.1)


def still(skeleton: Skeleton, joints: int | None = None) -> MotionClip:
    rotations = np.broadcast_to(IDENTITY, (3, joints or len(skeleton), 4))
    return MotionClip.of(skeleton, rotations, np.tile(skeleton.offsets[:1], (3, 1)), np.zeros((3, 4), bool), 20)


def write(path, skeleton: Skeleton):
    write_bvh(path, still(skeleton))
    return path


def renamed(skeleton: Skeleton, prefix: str = "mixamorig:") -> Skeleton:
    names = tuple(prefix + FOREIGN[name] for name in skeleton.joint_names)
    return Skeleton("rig", names, skeleton.parents, skeleton.offsets, skeleton.mirror)


def test_standard_is_the_standard_body():
    assert read_body("standard", HUMANML3D) is standard_body(HUMANML3D)


@pytest.mark.parametrize("skeleton", [CHILD, SHORT_LEGS, TALL])
def test_a_body_is_read_from_bvh_and_npz_alike(tmp_path, skeleton):
    still(skeleton).save_npz(tmp_path / "rig.npz")
    of_npz = read_body(tmp_path / "rig.npz", HUMANML3D)
    of_bvh = read_body(write(tmp_path / "rig.bvh", skeleton), HUMANML3D)
    np.testing.assert_array_equal(of_npz.skeleton.offsets, skeleton.offsets)
    np.testing.assert_allclose(of_bvh.skeleton.offsets, skeleton.offsets, atol=2e-6)
    assert of_bvh.name == "rig.bvh"
    assert of_bvh.skeleton.feet == HUMANML3D.feet


@pytest.mark.parametrize("prefix", ["mixamorig:", ""])
def test_a_rig_with_mixamos_names_is_a_body(tmp_path, prefix):
    found = read_body(write(tmp_path / "hero.bvh", renamed(CHILD, prefix)), HUMANML3D).skeleton
    np.testing.assert_allclose(found.offsets, CHILD.offsets, atol=2e-6)


def test_a_rig_in_an_a_pose_has_the_arms_of_the_t_pose(tmp_path):
    offsets = TALL.offsets.copy()
    for j, name in enumerate(TALL.joint_names):
        if "elbow" in name or "wrist" in name:
            x, _, z = offsets[j]
            offsets[j] = [x * np.cos(0.8), -abs(x) * np.sin(0.8), z]
    found = read_body(write(tmp_path / "hero.bvh", renamed(TALL.with_offsets(offsets))), HUMANML3D).skeleton
    np.testing.assert_allclose(found.offsets, TALL.offsets, atol=1e-5)


def test_missing_joints_are_named(tmp_path):
    with pytest.raises(InvalidFile, match="lacks 22 of 22 joints: Hips, LeftUpLeg"):
        read_body(write(tmp_path / "kit.bvh", KIT), HUMANML3D)


@pytest.mark.parametrize(
    ("skeleton", "message"),
    [
        (shaped(size=0.01), r"0\.0173 m tall"),
        (shaped(size=2), r"3\.46 m tall"),
        (shaped(arms=0.1), "bone to L_elbow"),
        (HUMANML3D.with_offsets(HUMANML3D.offsets * [-1, 1, 1]), "no T-pose"),
    ],
    ids=["millimetres", "giant", "no arms", "mirrored"],
)
def test_bodies_that_no_human_has_are_refused(tmp_path, skeleton, message):
    with pytest.raises(InvalidFile, match=message):
        read_body(write(tmp_path / "rig.bvh", skeleton), HUMANML3D)


def test_other_files_and_bundles_are_refused(tmp_path):
    with pytest.raises(InvalidInput, match="not a body"):
        read_body(tmp_path / "rig.fbx", HUMANML3D)
    with pytest.raises(NotFound):
        read_body(tmp_path / "rig.bvh", HUMANML3D)
    with pytest.raises(InvalidInput, match="this bundle has kit"):
        read_body(tmp_path / "rig.bvh", KIT)


@pytest.mark.parametrize("skeleton", [CHILD, SHORT_LEGS, TALL], ids=["child", "short legs", "tall"])
def test_feet_stand_on_other_bodies_and_travel_follows_the_legs(skeleton):
    body = SimpleNamespace(skeleton=skeleton)
    features = HUMANML3D_263.encode(sliding(0.02, 1))
    own = finish_motion(features, HUMANML3D_263)
    clip = finish_motion(features, HUMANML3D_263, body=body)  # pyright: ignore[reportArgumentType]
    np.testing.assert_array_equal(clip.offsets, skeleton.offsets)
    toes = clip.joints[:, list(skeleton.feet[1::2])]
    stands = clip.contacts[:, 1::2]
    assert stands.any()
    assert np.abs(toes[..., 1][stands]).max() < 0.03
    moved = np.linalg.norm(np.diff(toes, axis=0)[..., [0, 2]], axis=-1)
    assert moved[stands[1:] & stands[:-1]].max() < 0.010
    ratio = travel_scale(standard_body(HUMANML3D).skeleton, skeleton)
    far, wanted = (np.linalg.norm(each.root[-1] - each.root[0]) for each in (clip, own))
    assert far == pytest.approx(ratio * wanted, rel=0.05)


@pytest.mark.parametrize("skeleton", [CHILD, SHORT_LEGS, TALL], ids=["child", "short legs", "tall"])
def test_hands_that_meet_do_so_on_other_bodies(skeleton):
    rotations, root = dancer(3, 40)
    joints = forward_kinematics(HUMANML3D, rotations, root)
    (*_, right), (*_, left) = arms(HUMANML3D)
    moved = forward_kinematics(skeleton, rotations, travel_scale(HUMANML3D, skeleton) * root)
    wanted = np.full(len(joints), 0.1 * stature(skeleton) / stature(HUMANML3D))
    front = moved.copy()
    middle, aside = moved[:, 9] + [0, -0.1, 0.25 * stature(skeleton)], np.array([0.08, 0, 0])
    front[:, right], front[:, left] = middle - aside, middle + aside
    found = wrist_distance(join_hands(front, wanted, skeleton), skeleton)
    assert np.abs(found - wanted).max() < 0.020
