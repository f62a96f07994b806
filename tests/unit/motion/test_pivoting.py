"""Feet that turn on the floor."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.motion.pivoting import on_balls
from marey.motion.rotations import about, length, rotate
from marey.motion.skeleton import HUMANML3D
from tests.support.bodies import Body

FPS = 20.0
Array = NDArray[np.float64]
R_ANKLE, R_TOE, L_TOE = 8, 11, 10


def turning(degrees: float, seconds: float = 0.6, *, lifted: float = 0.3, on: int = R_ANKLE) -> Array:
    """A body whose left foot is in the air, and that turns flat on the other one after a second, about one joint."""
    joints = np.array(Body(3.0).joints(), np.float64)
    time = np.arange(len(joints)) / FPS
    up = lifted * np.clip((time - 0.5) / 0.3, 0, 1) * np.clip((2.6 - time) / 0.3, 0, 1)
    joints[:, [4, 7, 10], 1] += up[:, None]
    share = np.clip((time - 1.0) / seconds, 0, 1)
    turn = about("Y", np.radians(degrees) * share**2 * (3 - 2 * share))
    middle = joints[:, on] * [1.0, 0.0, 1.0]
    return np.asarray(rotate(turn[:, None], joints - middle[:, None]) + middle[:, None], np.float64)


@pytest.mark.parametrize("on", [R_ANKLE, R_TOE])
@pytest.mark.parametrize("degrees", [90.0, -150.0])
def test_who_turns_on_one_foot_turns_on_its_ball(degrees: float, on: int) -> None:
    joints = turning(degrees, on=on)
    moved = on_balls(joints, HUMANML3D, FPS)
    turns = slice(22, 31)
    swept = [np.linalg.norm(np.diff(each[turns, R_TOE], axis=0), axis=1).sum() for each in (joints, moved)]
    assert swept[1] < 0.02 + 0.1 * swept[0]
    rises = moved[turns, R_ANKLE, 1] - joints[turns, R_ANKLE, 1]
    assert rises.min() > 0.025
    assert rises.max() < 0.07
    np.testing.assert_allclose(moved[:12], joints[:12], atol=1e-3)
    np.testing.assert_allclose(moved[-8:, R_ANKLE, 1], joints[-8:, R_ANKLE, 1], atol=1e-3)
    for joint, parent in enumerate(HUMANML3D.parents[1:], start=1):
        before, after = (length(each[:, joint] - each[:, parent]) for each in (joints, moved))
        np.testing.assert_allclose(after, before, atol=1e-6)
    assert np.linalg.norm(np.diff(moved, 2, axis=0), axis=-1).max() * FPS**2 < 40


@pytest.mark.parametrize(
    "joints",
    [turning(20.0), turning(90.0, 2.4), turning(90.0, lifted=0.0), turning(90.0)[:2]],
    ids=["little", "slowly", "on both feet", "two frames"],
)
def test_other_turns_are_left(joints: Array) -> None:
    assert on_balls(joints, HUMANML3D, FPS) is joints


def test_finished_turns_are_on_the_ball() -> None:
    clip = finish_motion(HUMANML3D_263.encode(turning(150.0)), HUMANML3D_263)
    ankle = clip.joints[:, R_ANKLE, 1]
    assert ankle[23:30].min() > ankle[:8].max() + 0.025


@pytest.mark.parametrize(("held", "joined"), [(0, True), (1, True), (2, False)])
def test_the_heel_stays_up_between_a_turn_and_one_back_soon_after(held: int, joined: bool) -> None:
    """Each of them turns by 30 degrees, too few to be looked at alone; the foot rests for two frames more."""
    joints = turning(0.0)
    degrees = np.zeros(len(joints))
    degrees[22:29] = np.arange(7) * 5.0
    degrees[29 : 29 + held] = 30.0
    degrees[29 + held : 36 + held] = 30.0 - np.arange(7) * 5.0
    middle = joints[:, R_ANKLE] * [1.0, 0.0, 1.0]
    turn = about("Y", np.radians(degrees))
    joints = np.asarray(rotate(turn[:, None], joints - middle[:, None]) + middle[:, None])
    assert (on_balls(joints, HUMANML3D, FPS) is not joints) is joined
