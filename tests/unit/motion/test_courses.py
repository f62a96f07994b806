"""Bodies that are carried along a course, and what their feet do of it by themselves."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.courses import Course, bent, carried_on, turned, with_steps
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
