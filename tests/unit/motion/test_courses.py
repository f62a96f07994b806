"""Bodies that are carried along a course, and what their feet do of it by themselves."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.courses import carried_on, turned
from marey.motion.rotations import about, rotate


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
