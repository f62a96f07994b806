"""Toes that bend at the floor, and hands that lie on it and lag."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.body import standard_body
from marey.motion.ends import HAND, MOST_LAG, TOES, turn_ends
from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.motion.io.bvh import format_bvh, parse_bvh
from marey.motion.kinematics import forward_kinematics, global_rotations
from marey.motion.rotations import IDENTITY, about, angle_between, rotate
from marey.motion.skeleton import HUMANML3D, KIT, Skeleton
from tests.support.walker import walker

BODY = standard_body(HUMANML3D).skeleton
L_TOE, R_TOE, L_WRIST, R_WRIST = (BODY.index(name) for name in ("L_foot", "R_foot", "L_wrist", "R_wrist"))
L_HIP, L_ANKLE, L_SHOULDER, L_ELBOW = (BODY.index(name) for name in ("L_hip", "L_ankle", "L_shoulder", "L_elbow"))


def still(frames: int = 20, skeleton: Skeleton = BODY):
    """A body in its T-pose: rotations and root."""
    return np.tile(IDENTITY, (frames, len(skeleton), 1)), np.repeat(skeleton.offsets[None, 0].astype(float), frames, 0)


def never(frames: int):
    return np.zeros((frames, 4), bool)


def tips(rotations, root, joint, bone):
    """Places (T, 3) of the end of a bone beyond a joint."""
    world = global_rotations(BODY, rotations)
    return forward_kinematics(BODY, rotations, root)[:, joint] + rotate(world[:, joint], np.array(bone))


def tiptoe(degrees: float = 60.0, frames: int = 60):
    """A body that rises onto its toes, which stay on the floor."""
    rotations, root = still(frames)
    share = np.clip(np.linspace(-0.4, 1.2, frames), 0.0, 1.0)
    for ankle in (L_ANKLE, L_ANKLE + 1):
        rotations[:, ankle] = about("X", np.radians(degrees) * share)
    root[:, 1] -= forward_kinematics(BODY, rotations, root)[:, L_TOE, 1]
    return rotations, root


def on_hands(frames: int = 20, high: float = 0.035):
    """A body that leans on both hands, its arms straight down, over a floor."""
    rotations, root = still(frames)
    rotations[:, 0] = about("X", np.pi / 2)  # face down
    for side, shoulder in ((1, L_SHOULDER), (-1, L_SHOULDER + 1)):
        rotations[:, shoulder] = about("Y", -side * np.pi / 2)  # arms ahead, which is down
    root[:, 1] += high - forward_kinematics(BODY, rotations, root)[:, L_WRIST, 1]
    return rotations, root


def test_toes_of_a_rising_heel_stay_on_the_floor():
    rotations, root = tiptoe()
    under = tips(rotations, root, L_TOE, [0.0, 0.0, TOES.length])[:, 1]
    assert under.min() < -0.04
    turned = turn_ends(rotations, root, never(len(root)), BODY, 20.0)
    assert tips(turned, root, L_TOE, [0.0, 0.0, TOES.length])[:, 1].min() > -0.001
    assert np.degrees(angle_between(turned[0, L_TOE], IDENTITY)) < 1.0  # they were flat


def test_toes_that_stand_are_flat_at_any_height():
    rotations, root = tiptoe()
    root[:, 1] += 0.5  # on a step
    assert (turn_ends(rotations, root, never(len(root)), BODY, 20.0)[:, L_TOE] == rotations[:, L_TOE]).all()
    turned = turn_ends(rotations, root, ~never(len(root)), BODY, 20.0)
    for toe in (L_TOE, R_TOE):
        assert np.ptp(tips(turned, root, toe, [0.0, 0.0, TOES.length])[:, 1]) < 0.008


def test_hands_on_which_a_body_leans_lie_flat_and_point_to_its_head():
    rotations, root = on_hands()
    turned = turn_ends(rotations, root, never(len(root)), BODY, 20.0)
    for wrist, side in ((L_WRIST, 1), (R_WRIST, -1)):
        bone = [side * HAND.length, 0.0, 0.0]
        assert tips(rotations, root, wrist, bone)[:, 1].max() < -0.08
        assert tips(turned, root, wrist, bone)[:, 1].min() > 0.0
        pointing = tips(turned, root, wrist, bone) - forward_kinematics(BODY, turned, root)[:, wrist]
        assert pointing[:, 2].min() > 0.9 * HAND.length  # the head is ahead


def test_a_swung_hand_comes_after_its_forearm_and_a_still_one_does_not():
    rotations, root = still(30)
    swing = np.radians(90) * np.clip((np.arange(30) - 8) / 6, 0.0, 1.0)
    rotations[:, L_ELBOW] = about("Z", swing)
    turned = turn_ends(rotations, root, never(30), BODY, 20.0)
    apart = np.degrees(angle_between(turned[:, L_WRIST], np.tile(IDENTITY, (30, 1))))
    assert 5.0 < apart[10:13].max() <= MOST_LAG
    behind = rotate(turned[11, L_WRIST], np.array([1.0, 0.0, 0.0]))
    assert behind[1] < -0.05  # the forearm goes up
    assert apart[:5].max() < 0.01
    assert apart[22:].max() < 0.01
    assert np.abs(turned[:, R_WRIST] - IDENTITY).max() < 1e-9


def test_bends_are_smooth():
    rotations, root = tiptoe(60.0, 30)
    turned = turn_ends(rotations, root, never(30), BODY, 20.0)
    assert np.degrees(angle_between(turned[1:, L_TOE], turned[:-1, L_TOE])).max() < 12.0


def test_no_joint_moves_by_it():
    clip = walker(seconds=3)
    turned = turn_ends(clip.rotations.astype(float), clip.root.astype(float), clip.contacts, clip.skeleton, clip.fps)
    assert (np.abs(turned[:, [L_TOE, R_TOE]] - clip.rotations[:, [L_TOE, R_TOE]]).max(axis=(0, 2)) > 0.05).all()
    before, after = (forward_kinematics(clip.skeleton, each, clip.root) for each in (clip.rotations, turned))
    np.testing.assert_allclose(after, before, atol=1e-6)


def test_feet_that_have_joints_beyond_are_left():
    rotations, root = still(5, KIT)
    turned = turn_ends(rotations, root, never(5), KIT, 20.0)
    assert np.isfinite(turned).all()


@pytest.mark.parametrize("fps", [20.0, 60.0])
def test_a_finished_motion_and_its_bvh_have_toes_that_bend(fps):
    rotations, root = tiptoe(60.0, 40)
    features = HUMANML3D_263.encode(forward_kinematics(HUMANML3D, rotations, root))
    clip = finish_motion(features, HUMANML3D_263, fps=fps)
    bent = np.degrees(angle_between(clip.rotations[-1, L_TOE].astype(float), IDENTITY))
    assert bent > 30.0
    read = parse_bvh(format_bvh(clip).encode())
    toe = read.skeleton.joint_names.index("L_foot")
    assert np.degrees(angle_between(read.rotations[-1, toe], IDENTITY)) == pytest.approx(bent, abs=0.1)
    np.testing.assert_allclose(read.skeleton.offsets[toe], BODY.offsets[L_TOE], atol=1e-6)
