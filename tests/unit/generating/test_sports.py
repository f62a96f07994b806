"""Movements of sports that are asked for by name."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.features import HUMANML3D_263
from tests.support.drawn_motions import named_movement

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
NECK = 12
SEEDS = range(3)
PELVIS, HEAD, ANKLES, TOES, SHOULDERS, WRISTS = 0, 15, [7, 8], [10, 11], [16, 17], [20, 21]


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_goalkeeper_dives_to_the_side_that_is_named_and_lies_on_it(side: str, sign: float, seed: int) -> None:
    joints = named_movement(f"the goalkeeper dives to his {side} to save the ball", seed=seed)
    way = joints[-1, PELVIS] - joints[0, PELVIS]
    assert sign * way[0] > 1.4
    assert abs(way[2]) < 0.3
    assert joints[-1, [PELVIS, HEAD], 1].max() < 0.3
    assert joints[:, [*ANKLES, *TOES, *WRISTS], 1].min(axis=1).max() > 0.1  # it flies
    shoulders = joints[-1, 16, 1] - joints[-1, 17, 1]
    assert sign * shoulders < -0.15  # on that shoulder


def test_who_slides_runs_up_has_a_leg_ahead_and_gets_up_unless_that_comes_next() -> None:
    joints = named_movement("slides on the ground feet first")
    assert joints[-1, PELVIS, 2] - joints[0, PELVIS, 2] > 2.0
    low = joints[:, PELVIS, 1] < 0.2
    assert np.median(joints[low][:, ANKLES, 2].max(axis=1) - joints[low][:, PELVIS, 2]) > 0.6
    assert joints[-1, PELVIS, 1] > 0.85
    assert named_movement("slides on the ground feet first", after="gets up and runs on")[-1, PELVIS, 1] < 0.25


@pytest.mark.parametrize(
    ("prompt", "strikes"),
    [
        ("serves a tennis ball", 21),
        ("a left-handed tennis player serves", 20),
        ("an overhead serve with the left hand", 20),
    ],
)
def test_a_serve_tosses_with_one_hand_and_strikes_overhead_with_the_other(prompt: str, strikes: int) -> None:
    joints = named_movement(prompt)
    tosses = 41 - strikes
    struck, tossed = int(joints[:, strikes, 1].argmax()), int(joints[:, tosses, 1].argmax())
    assert 0.2 * FPS < struck - tossed < FPS
    assert joints[[struck, tossed], [strikes, tosses], 1].min() > joints[0, HEAD, 1] + 0.2
    behind = joints[struck - 4 : struck, strikes] - joints[struck - 4 : struck, HEAD]
    assert behind[:, 2].min() < -0.1  # drops behind the back before
    assert joints[struck : struck + round(0.8 * FPS), strikes, 1].min() < 1.1
    assert np.linalg.norm(joints[-1, ANKLES, 2] - joints[0, ANKLES, 2]) < 0.1


@pytest.mark.parametrize(
    ("prompt", "way", "height"),
    [
        ("an athlete throws the javelin", 1.6, 1.7),
        ("puts the shot", 0.6, 1.6),
        ("throws a discus", 0.0, 1.2),
        ("throws a frisbee across the park", 0.0, 1.1),
    ],
)
@pytest.mark.parametrize("side", ["right", "left"])
def test_throws_of_sports_let_go_ahead_after_the_hand_was_drawn_back(
    prompt: str, way: float, height: float, side: str
) -> None:
    joints = named_movement(f"{prompt} with the {side} hand")
    hand = joints[:, 21 if side == "right" else 20] - joints[:, PELVIS]
    fastest = int(np.linalg.norm(np.diff(hand, axis=0), axis=1).argmax())
    ahead = fastest + int(hand[fastest : fastest + 8, 2].argmax())
    assert hand[max(fastest - 20, 0) : fastest + 1, 2].min() < hand[ahead, 2] - 0.25
    assert (hand + joints[:, PELVIS])[fastest : ahead + 3, 1].max() > height
    assert joints[-1, PELVIS, 2] - joints[0, PELVIS, 2] == pytest.approx(way, abs=0.45)
    assert joints[-1, PELVIS, 1] > 0.88


def test_who_bowls_steps_ahead_and_lets_go_low() -> None:
    joints = named_movement("throws a bowling ball down the lane")
    hand = joints[:, 21] - joints[:, PELVIS]
    low = int(joints[:, PELVIS, 1].argmin())
    assert joints[low, PELVIS, 1] < 0.75
    assert hand[: low + 1, 2].min() < -0.2
    assert hand[low : low + 15, 2].max() > 0.35
    assert joints[-1, PELVIS, 2] > joints[0, PELVIS, 2] + 0.8


@pytest.mark.parametrize(
    ("prompt", "times"), [("a jump shot", 1), ("three jump shots", 3), ("shoots a three-pointer with a jump shot", 1)]
)
def test_a_jump_shot_lets_go_in_the_air(prompt: str, times: int) -> None:
    joints = named_movement(prompt)
    up = joints[:, TOES, 1].min(1) > 0.08
    assert (np.diff(up.astype(int)) == 1).sum() == times
    first = np.flatnonzero(up)
    assert joints[first, 21, 1].max() > joints[first, HEAD, 1].max() + 0.15


@pytest.mark.parametrize(
    ("prompt", "wrist", "times"),
    [("a fencer lunges", 21, 1), ("a fencer lunges twice with her left arm", 20, 2)],
)
def test_a_fencer_lunges_with_a_stretched_sword_arm_and_recovers(prompt: str, wrist: int, times: int) -> None:
    joints = named_movement(prompt)
    down = joints[:, PELVIS, 1] < 0.72
    assert (np.diff(down.astype(int)) == 1).sum() == times
    low = int(joints[:, PELVIS, 1].argmin())
    assert np.linalg.norm(joints[low, wrist] - joints[low, wrist - 4]) > 0.46
    assert joints[low, wrist, 2] > joints[low, PELVIS, 2] + 0.4
    assert abs(joints[low, ANKLES[0], 2] - joints[low, ANKLES[1], 2]) > 0.8
    assert joints[low, 41 - wrist, 2] < joints[low, PELVIS, 2]
    assert joints[-1, PELVIS, 1] > 0.9


def test_who_rows_pulls_with_legs_trunk_and_arms() -> None:
    joints = named_movement("rows a boat")
    away = joints[:, PELVIS, 2] - joints[:, ANKLES, 2].mean(1)
    assert joints[:, PELVIS, 1].max() < 0.35
    assert np.ptp(away) > 0.25
    near = np.linalg.norm(joints[:, WRISTS] - joints[:, SHOULDERS], axis=-1).mean(1)
    assert near[int(away.argmin())] < near[int(away.argmax())] - 0.12
    assert np.ptp(joints[:, ANKLES], axis=0).max() < 0.02


@pytest.mark.parametrize(
    ("prompt", "knee", "wrist"), [("a pitcher throws", 4, 21), ("a left-handed pitcher throws", 5, 20)]
)
def test_a_pitch_lifts_the_knee_strides_and_lets_go_over_the_other_foot(prompt: str, knee: int, wrist: int) -> None:
    joints = named_movement(prompt)
    lifted = int(joints[:, knee, 1].argmax())
    assert joints[lifted, knee, 1] > 0.85
    ahead = joints[:, wrist, 2] - joints[:, PELVIS, 2]
    lets_go = int(ahead.argmax())
    assert lets_go > lifted
    assert np.abs(joints[lets_go, ANKLES[0], 2] - joints[lets_go, ANKLES[1], 2]) > 0.5
    assert ahead[lifted:lets_go].min() < -0.1


@pytest.mark.parametrize(
    ("prompt", "wrists"), [("catches the ball", WRISTS), ("catches the keys in her left hand", [20])]
)
def test_who_catches_reaches_out_and_gives_way(prompt: str, wrists: list[int]) -> None:
    joints = named_movement(prompt)
    ahead = (joints[:, wrists, 2] - joints[:, [PELVIS], 2]).min(1)
    reached = int(ahead.argmax())
    assert ahead[reached] > 0.4
    assert ahead[reached + round(0.4 * FPS)] < ahead[reached] - 0.12
    idle = [wrist for wrist in WRISTS if wrist not in wrists]
    assert all(joints[reached, wrist, 1] < joints[reached, NECK, 1] - 0.25 for wrist in idle)


@pytest.mark.parametrize(
    ("prompt", "guard"), [("a fighter bounces lightly on his toes", True), ("bounces on the balls of her feet", False)]
)
@pytest.mark.parametrize("seed", SEEDS)
def test_who_bounces_on_the_toes_stays_on_the_floor_with_raised_heels(prompt: str, guard: bool, seed: int) -> None:
    joints = named_movement(prompt, seed=seed)
    middle = joints[25:-25]
    assert 0.03 < np.ptp(middle[:, PELVIS, 1]) < 0.08
    assert middle[:, TOES, 1].max() < 0.03
    assert (middle[:, ANKLES, 1] > 0.08).mean() > 0.6
    ups = np.diff((middle[:, PELVIS, 1] > middle[:, PELVIS, 1].mean()).astype(int)) == 1
    assert 1.7 < ups.sum() / (len(middle) / FPS) < 3.0
    assert (middle[:, WRISTS, 1].min() > middle[:, SHOULDERS, 1].max() - 0.25) == guard
