"""Dribbles, kicks of a ball and throws that are drawn."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from marey.generation.ball_games import kicks_well
from marey.generation.fine import drawn_features
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263
from marey.motion.skeleton import HUMANML3D
from marey.selector.motion import Motion
from marey.selector.rules import RULES
from tests.support.bodies import Body
from tests.support.drawn_motions import drawn_on

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
STANDS = Body(5.0).joints()
PELVIS, HEAD, FEET = 0, 15, [7, 8, 10, 11]


drawn = partial(drawn_on, STANDS)


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_leg_swings_through_the_ball_and_the_other_one_stands(side: str) -> None:
    joints = drawn("kick-ball", "kicks a ball", side=side)
    ankle, other = (HUMANML3D.index(f"{each}_ankle") for each in (("L", "R") if side == "left" else ("R", "L")))
    way = joints[:, ankle, 2] - joints[0, ankle, 2]
    assert way.min() < -0.3
    assert way.max() > 0.4
    assert way.argmin() < way.argmax()
    assert np.abs(joints[:, other] - joints[0, other]).max() < 0.05
    assert RULES["kick-ball"](Motion(joints, FPS), side) >= 0.5


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_hand_dribbles_beside_the_hips(side: str) -> None:
    joints = drawn("dribble", "dribbles", side=side)
    assert RULES["dribble"](Motion(joints, FPS), side) >= 0.5
    k = 20 if side == "left" else 21
    height = joints[:, k, 1]
    assert 0.15 < np.ptp(height) < 0.35
    downs = np.sum((np.diff(height)[:-1] < 0) & (np.diff(height)[1:] >= 0))
    assert 1.3 < downs / (len(joints) / FPS) < 2.1
    assert np.ptp(joints[:, 21 if side == "left" else 20, 1]) < 0.05
    made = drawn("dribble", "dribbles")
    assert np.abs(made - LAYOUT.decode(LAYOUT.encode(STANDS))[: len(made)])[:, FEET].max() < 0.03


@pytest.mark.parametrize("side", ["left", "right"])
def test_an_arm_throws_from_behind_the_shoulder_and_the_feet_stay(side: str) -> None:
    joints = drawn("throw", "throws a stone", side=side)
    shoulder, wrist = (16, 20) if side == "left" else (17, 21)
    ahead = joints[:, wrist, 2] - joints[:, shoulder, 2]
    assert ahead.min() < -0.1
    assert ahead.max() > 0.3
    assert ahead.argmin() < ahead.argmax()
    assert joints[ahead.argmin(), wrist, 1] > joints[ahead.argmin(), shoulder, 1]
    assert np.abs(joints[:, FEET] - joints[0, FEET]).max() < 0.03
    assert RULES["throw"](Motion(joints, FPS), side) >= 0.5
    assert RULES["throw"](Motion(joints, FPS), "left" if side == "right" else "right") < 0.6


@pytest.mark.parametrize("lifted", [slice(0, 70), slice(0, 100)], ids=["at first", "all the time"])
@pytest.mark.parametrize("action", ["kick-ball", "throw", "dodge"])
def test_a_body_on_one_leg_is_not_what_a_movement_is_drawn_on(action: str, lifted: slice) -> None:
    joints = STANDS.copy()
    joints[lifted, 4, 2] += 0.3
    joints[lifted, 7:11:3, 1] += 0.35
    joints[70:, [20, 21], 2] += 0.2 * np.sin(np.arange(len(joints) - 70))[:, None]  # less calm on both feet
    made = drawn_on(joints, action, side="right")
    assert made[0, FEET[2:], 1].max() < 0.05
    assert made[-1, FEET[2:], 1].max() < 0.05
    assert np.abs(made[:, [7, 10]] - made[0, [7, 10]]).max() < 0.05, "the left foot stands"


@pytest.mark.parametrize("action", ["kick-ball", "throw"])
def test_nothing_is_drawn_without_time_for_it(action: str) -> None:
    short = LAYOUT.encode(Body(1.3).joints())
    assert drawn_features(short, LAYOUT, action, FineWish(), 1) is None


def test_a_kick_of_the_network_is_kept_where_a_run_up_is_asked_for() -> None:
    assert kicks_well(STANDS, FPS, FineWish(prompt="runs up and kicks the ball"))
    assert not kicks_well(STANDS, FPS, FineWish(prompt="a footballer takes a penalty"))
