"""Motions at each other's ends: pose and speed of the first go over into those of the second."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion import MotionClip
from marey.motion.edits.joining import faded_in, placed_after
from marey.motion.rotations import Array, about, conjugate, multiply, to_rotvec
from marey.motion.skeleton import HUMANML3D

FRAMES = 60
SPAN = 40
JOINT = HUMANML3D.joint_names.index("L_elbow")


def moving(turn: float, way: float, first_turn: float = 0.0, first_place: float = 0.0) -> MotionClip:
    """A body of which an elbow turns about Y and the root moves along X by so much a frame, radians and metres."""
    rotations = np.zeros((FRAMES, len(HUMANML3D), 4))
    rotations[..., 0] = 1.0
    frames = np.arange(FRAMES)
    rotations[:, JOINT] = about("Y", first_turn + turn * frames)
    root = np.tile([first_place, 0.9, 0.0], (FRAMES, 1))
    root[:, 0] += way * frames
    return MotionClip.of(HUMANML3D, rotations, root, np.zeros((FRAMES, 4), bool), 20.0)


def frames_of(clip: MotionClip, some: slice) -> MotionClip:
    return MotionClip.of(clip.skeleton, clip.rotations[some], clip.root[some], clip.contacts[some], clip.fps)


def turns_of(rotations: Array) -> Array:
    """By how much the elbow turns about Y from each frame to the next (T - 1,), radians."""
    return to_rotvec(multiply(rotations[1:], conjugate(rotations[:-1])))[:, JOINT, 1]


def test_pose_and_speed_of_the_first_go_over_into_those_of_the_second() -> None:
    first = moving(0.05, 0.02)
    second = moving(-0.01, -0.005, first_turn=2.7, first_place=1.0)
    rotations, root = faded_in(first, second, SPAN)
    np.testing.assert_allclose(rotations[0, JOINT], first.rotations[-1, JOINT], atol=1e-6)
    np.testing.assert_allclose(root[0], first.root[-1], atol=1e-6)
    turns, ways = turns_of(rotations), np.diff(root[:, 0])
    assert turns[0] == pytest.approx(0.05, abs=5e-3)
    assert ways[0] == pytest.approx(0.02, abs=2e-3)
    assert turns[SPAN - 1] == pytest.approx(-0.01, abs=5e-3)
    assert np.abs(np.diff(turns)).max() < 8e-3, "no frame changes the speed by more than the curve does"
    np.testing.assert_allclose(rotations[SPAN:], second.rotations[SPAN:], atol=1e-6)
    np.testing.assert_allclose(root[SPAN:], second.root[SPAN:], atol=1e-6)


def test_pieces_of_one_motion_are_joined_as_they_are() -> None:
    whole = moving(0.05, 0.02)
    rotations, root = faded_in(frames_of(whole, slice(0, 30)), frames_of(whole, slice(29, None)), SPAN)
    np.testing.assert_array_equal(rotations, whole.rotations[29:])
    np.testing.assert_array_equal(root, whole.root[29:])


def test_a_motion_is_placed_where_the_other_ends_at_its_own_height() -> None:
    first, second = moving(0.0, 0.02), moving(0.0, 0.01, first_place=5.0)
    second.root[:, 1] = 0.5
    placed = placed_after(first, second)
    np.testing.assert_allclose(placed.root[0], [first.root[-1, 0], 0.5, first.root[-1, 2]], atol=1e-6)
