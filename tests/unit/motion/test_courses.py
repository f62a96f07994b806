"""Bodies that are carried along a course, and what their feet do of it by themselves."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.courses import (
    STEP_EVERY_S,
    STEP_FROM,
    STEP_S,
    Course,
    bent,
    carried_on,
    stand_clock,
    turned,
    with_steps,
)
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import about, rotate
from marey.motion.skeleton import HUMANML3D


def path(*speeds: tuple[float, float, float], frames: int = 4) -> np.ndarray:
    """Two toes (T, 2, 3) that move by so much a frame."""
    return np.arange(frames)[:, None, None] * np.array(speeds)


def test_a_toe_is_carried_by_what_its_own_step_leaves_of_the_way() -> None:
    carried = path((0.03, 0.0, 0.04), (0.0, 0.5, 0.03))
    toes = path((0.0, 0.02, 0.0), (0.0, 0.0, 0.0))
    way = carried_on(carried, toes)
    assert way[0].tolist() == [[0.0] * 3] * 2, "nothing moves before the first frame"
    np.testing.assert_allclose(way[1:, 0], [[0.018, 0.0, 0.024]] * 3)  # 5 cm less 2, on the floor
    np.testing.assert_allclose(way[1:, 1], [[0.0, 0.0, 0.03]] * 3)


def test_a_toe_that_goes_further_by_itself_is_not_carried() -> None:
    assert not carried_on(path((0.01, 0.0, 0.0), (0.0, 0.0, 0.0)), path((0.0, 0.0, 0.02), (0.0, 0.0, 0.0))).any()


@pytest.mark.parametrize("degrees", [0, 30, 90, 200])
def test_a_place_on_the_floor_turns_as_the_body_that_stands_on_it(degrees: float) -> None:
    places = np.array([[0.3, 1.2], [-2.0, 0.4]])
    standing = np.insert(places, 1, 0.7, axis=-1)
    there = rotate(about("Y", np.radians(degrees)), standing)
    np.testing.assert_allclose(turned(places, np.radians(degrees)), there[:, [0, 2]], atol=1e-12)


def test_feet_that_are_carried_far_step_after() -> None:
    pushed = path((0.0, 0.0, 0.015), (0.0, 0.0, 0.015), frames=100)
    stands, lifts = with_steps(np.ones((100, 2), bool), pushed, np.zeros((100, 2, 3)), 20.0)
    for side in range(2):
        assert not stands[:, side].all()
        assert lifts[:, side].max() > 0.02
        assert not lifts[stands[:, side], side].any()
    assert (stands.sum(axis=1) >= 1).all(), "one foot stands while the other one steps"
    still, level = with_steps(np.ones((100, 2), bool), np.zeros((100, 2, 3)), np.zeros((100, 2, 3)), 20.0)
    assert still.all()
    assert not level.any()


def test_a_body_that_is_moved_lifts_its_feet_and_none_goes_under_the_floor() -> None:
    frames = 100
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (frames, len(HUMANML3D.joint_names), 1))
    root = np.tile(HUMANML3D.offsets[0], (frames, 1)).astype(np.float64)
    standing = forward_kinematics(HUMANML3D, rotations, root)
    stays = Course(np.zeros((frames, 2)), np.zeros(frames))
    goes = Course(np.stack([np.zeros(frames), np.linspace(0.0, 1.5, frames)], axis=1), np.zeros(frames))
    moved, place, contacts = bent(rotations, root, np.ones((frames, 4), bool), stays, goes, HUMANML3D, 20.0)
    toes = (
        forward_kinematics(HUMANML3D, moved, place)[:, HUMANML3D.feet[1::2], 1] - standing[:, HUMANML3D.feet[1::2], 1]
    )
    assert toes.max() > 0.02
    assert toes.min() > -0.02
    assert not contacts.all()
    assert place[-1, 2] - place[0, 2] == pytest.approx(1.5, abs=0.05)


def test_a_stand_is_carried_by_its_middle_and_a_swing_from_one_middle_to_the_next() -> None:
    stands = np.zeros(60, bool)
    stands[10:20] = stands[35:46] = True
    clock, still = stand_clock(stands, 20.0)
    np.testing.assert_array_equal(still, stands)
    assert set(clock[10:20]) == {14.5}
    assert set(clock[35:46]) == {40.0}
    assert clock[[0, 59]].tolist() == [0.0, 59.0]
    assert (np.diff(clock) >= 0).all()
    assert (np.diff(clock[19:36]) > 0.01).all()
    back, _ = stand_clock(stands[::-1], 20.0)
    np.testing.assert_allclose(59 - back[::-1], clock, atol=1e-9)


def test_a_foot_steps_again_only_after_it_was_carried_as_far_again() -> None:
    for speed in (0.003, 0.004, 0.008):
        pushed = path((0.0, 0.0, speed), (0.0, 0.0, speed), frames=400)
        stands, _ = with_steps(np.ones((400, 2), bool), pushed, np.zeros((400, 2, 3)), 20.0)
        for side in range(2):
            begins = np.flatnonzero(np.diff(stands[:, side].astype(int)) < 0)
            carried = speed * np.diff(begins)
            assert len(carried) > 5
            ahead = speed * (STEP_EVERY_S - STEP_S / 2) * 20.0  # from the middle of a step to where the next one ends
            assert carried.min() > STEP_FROM - ahead
            assert carried.max() < STEP_FROM + speed * 2 * STEP_EVERY_S * 20.0 + 0.01


@pytest.mark.parametrize("swing", [0, 2])
def test_the_first_and_the_last_stand_of_a_clip_begin_and_end_with_it(swing: int) -> None:
    """Also those that a swing is before, or after, which is too short for one."""
    stands = np.zeros(40, bool)
    stands[swing:12] = stands[28 : 40 - swing] = True
    clock, still = stand_clock(stands, 20.0)
    assert still[:11].all()
    assert still[-11:].all()
    assert set(clock[:11]) == {(swing + 11) / 2}
    assert set(clock[-11:]) == {39 - (swing + 11) / 2}
    np.testing.assert_allclose(39 - clock[::-1], clock, atol=1e-9)
