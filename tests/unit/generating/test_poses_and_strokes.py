"""Poses of yoga, and strokes, stamps and slow forms that are asked for by name."""

from __future__ import annotations

import numpy as np
import pytest

from marey.drawing.yoga import POSES
from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from tests.support.drawn_motions import named_movement

FPS = HUMANML3D_263.fps
PELVIS, NECK, HEAD, ANKLES, SHOULDERS, WRISTS = 0, 12, 15, [7, 8], [16, 17], [20, 21]
SEEDS = range(2)


def middle_of(joints: np.ndarray) -> np.ndarray:
    return joints[len(joints) // 2]


@pytest.mark.parametrize("pose", list(POSES))
@pytest.mark.parametrize("seed", SEEDS)
def test_a_pose_is_held_on_still_feet_as_long_as_is_said(pose: str, seed: int) -> None:
    said = pose.replace("-", " ") + ("" if "dog" in pose else " pose")
    joints = named_movement(f"{said}, holding it for four seconds", seed=seed)
    still = np.linalg.norm(np.diff(joints[:, WRISTS], axis=0), axis=-1).max(axis=1) < 0.012
    longest = max(len(run) for run in "".join("x" if each else " " for each in still).split())
    assert 3.0 * FPS < longest < 7.0 * FPS
    assert joints[-1, PELVIS, 1] > 0.88
    assert np.linalg.norm(joints[-1, PELVIS, [0, 2]] - joints[0, PELVIS, [0, 2]]) < 0.1


def test_warriors_stand_wide_with_the_arms_as_they_are_named() -> None:
    two = middle_of(named_movement("warrior two pose"))
    assert abs(two[ANKLES[0], 0] - two[ANKLES[1], 0]) > 0.9
    assert np.abs(two[WRISTS, 1] - two[SHOULDERS, 1]).max() < 0.12
    assert two[PELVIS, 1] < 0.72
    one = middle_of(named_movement("warrior one pose"))
    assert one[WRISTS, 1].min() > one[HEAD, 1] + 0.1
    assert abs(one[ANKLES[0], 2] - one[ANKLES[1], 2]) > 0.7
    three = middle_of(named_movement("warrior three pose on the left leg"))
    assert abs(three[NECK, 1] - three[PELVIS, 1]) < 0.2
    assert three[ANKLES[1], 1] > 0.6
    assert three[ANKLES[0], 1] < 0.12


def test_a_tree_stands_on_the_leg_that_is_named_with_the_other_foot_at_its_thigh() -> None:
    tree = middle_of(named_movement("tree pose on the right leg"))
    assert tree[ANKLES[1], 1] < 0.12
    assert 0.4 < tree[ANKLES[0], 1] < 0.7
    assert np.linalg.norm(tree[WRISTS[0]] - tree[WRISTS[1]]) < 0.2


@pytest.mark.parametrize("seed", SEEDS)
def test_a_cricket_ball_leaves_a_straight_arm_over_the_head_behind_a_run(seed: int) -> None:
    joints = named_movement("bowling a cricket ball", seed=seed)
    arm = np.linalg.norm(joints[:, 21] - joints[:, 17], axis=-1)
    high = int(joints[:, 21, 1].argmax())
    assert joints[high, 21, 1] > joints[high, HEAD, 1] + 0.2
    assert arm[high] > 0.42
    assert joints[-1, PELVIS, 2] - joints[0, PELVIS, 2] > 2.0


def test_a_kayak_is_paddled_on_both_sides_in_turn_and_a_canoe_on_one_at_a_time() -> None:
    kayak, canoe = named_movement("paddles a kayak"), named_movement("paddles a canoe")
    for joints in (kayak, canoe):
        assert joints[:, PELVIS, 1].max() < 0.3
        assert joints[:, PELVIS].std(axis=0).max() < 0.02
    changes = [
        (np.diff(np.sign(joints[:, WRISTS[0], 1] - joints[:, WRISTS[1], 1])) != 0).sum() for joints in (kayak, canoe)
    ]
    assert changes[0] >= 4 > changes[1]


@pytest.mark.parametrize(("prompt", "turns"), [("spin attack with a sword", 1), ("double spin attack with a sword", 2)])
def test_a_spin_attack_turns_all_the_way_round_with_the_blade_out(prompt: str, turns: int) -> None:
    joints = named_movement(prompt)
    across = joints[:, 1] - joints[:, 2]
    heading = np.degrees(np.unwrap(np.arctan2(across[:, 2], across[:, 0])))
    assert abs(abs(heading[-1] - heading[0]) - 360 * turns) < 15
    speed = np.linalg.norm(np.diff(joints[:, 21], axis=0), axis=-1).max() * FPS
    assert speed > 3.0


@pytest.mark.parametrize(("prompt", "stamps"), [("sumo stomp left and right", 2), ("does four sumo stomps", 4)])
def test_sumo_stamps_lift_one_leg_after_the_other_on_the_spot(prompt: str, stamps: int) -> None:
    joints = named_movement(prompt)
    lifted = joints[:, ANKLES, 1] > 0.4
    assert (np.diff(lifted.astype(int), axis=0) == 1).sum() == stamps
    assert lifted.any(axis=0).all()
    assert np.linalg.norm(joints[:, PELVIS, [0, 2]] - joints[0, PELVIS, [0, 2]], axis=-1).max() < 0.6


def test_tai_chi_is_slow_and_low_and_goes_from_side_to_side() -> None:
    joints = named_movement("does tai chi")
    assert np.linalg.norm(np.diff(joints[:, WRISTS], axis=0), axis=-1).max() * FPS < 1.6
    assert 9.0 < len(joints) / FPS < 18.0
    assert np.ptp(joints[:, PELVIS, 0]) > 0.2
    assert np.median(joints[:, PELVIS, 1]) < 0.88


def test_a_victory_dance_is_danced_with_the_hands_up() -> None:
    features = stated_features(HUMANML3D_263, "cheer", FineWish(prompt="does a victory dance"), None, 1)
    assert features is not None
    joints = HUMANML3D_263.decode(features)
    middle = joints[round(2 * FPS) : -round(2 * FPS)]
    assert (middle[:, WRISTS, 1] > middle[:, SHOULDERS, 1] + 0.1).mean() > 0.9
    assert np.ptp(middle[:, PELVIS, 0]) > 0.1
