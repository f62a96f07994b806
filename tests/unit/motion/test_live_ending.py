"""The last frames of a stream pass into a pose."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.kinematics import facing, forward_kinematics
from marey.motion.live_ending import LiveEnding
from marey.motion.rotations import about, multiply
from marey.motion.skeleton import HUMANML3D
from marey.motion.stance import heading, standing_height
from tests.support.motions import dancer

FIRST, FRAMES = 30, 20


def body(turn: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Rotations and roots of a body that moves and faces anywhere."""
    rotations, root = dancer(4, FIRST + FRAMES)
    rotations[:, 0] = multiply(about("Y", turn), rotations[:, 0])
    return rotations, root


def pose() -> np.ndarray:
    return dancer(9, 8)[0][5]


@pytest.mark.parametrize("turn", [0.0, 2.5, -1.0])
def test_the_last_frame_has_the_pose_where_the_body_is_and_faces(turn: float) -> None:
    rotations, root = body(turn)
    ending = LiveEnding(HUMANML3D, pose(), 0.9, FIRST, FRAMES)
    assert ending.last == FIRST + FRAMES - 1
    turns, place = ending.passed(ending.last, rotations[ending.last], root[ending.last])
    np.testing.assert_allclose(place, [root[ending.last, 0], 0.9, root[ending.last, 2]], atol=1e-9)
    assert heading(turns, HUMANML3D) == pytest.approx(heading(rotations[ending.last], HUMANML3D), abs=1e-6)
    own = forward_kinematics(HUMANML3D, np.stack([turns, pose()]), np.zeros((2, 3)))
    x, _, z = np.moveaxis(facing(own, HUMANML3D), -1, 0)
    same = multiply(about("Y", -np.arctan2(x, z))[:, None], np.stack([turns, pose()])[:, :1])
    assert abs((same[0] * same[1]).sum()) == pytest.approx(1.0, abs=1e-9)
    assert np.abs((turns[1:] * pose()[1:]).sum(axis=-1)).min() == pytest.approx(1.0, abs=1e-9)


def test_frames_pass_into_the_pose_without_a_jump() -> None:
    rotations, root = body()
    ending = LiveEnding(HUMANML3D, pose(), None, FIRST, FRAMES)
    made = [
        ending.passed(n, rotations[n], root[n]) if n >= FIRST else (rotations[n], root[n]) for n in range(len(root))
    ]
    joints = forward_kinematics(HUMANML3D, np.stack([turns for turns, _ in made]), np.stack([at for _, at in made]))
    own = forward_kinematics(HUMANML3D, rotations, root)
    steps, usual = (np.linalg.norm(np.diff(each, axis=0), axis=-1).max(axis=1) for each in (joints, own))
    far = np.linalg.norm(joints[-1] - own[-1], axis=-1).max()
    assert steps.max() < usual.max() + 3 * far / FRAMES
    assert np.linalg.norm(joints[FIRST] - own[FIRST], axis=-1).max() < 0.05 * far
    assert made[-1][1][1] == pytest.approx(standing_height(pose(), HUMANML3D))


def test_a_pose_is_reached_at_once_where_there_is_one_frame() -> None:
    rotations, root = body()
    ending = LiveEnding(HUMANML3D, pose(), 0.8, FIRST, 1)
    assert ending.last == FIRST
    turns, place = ending.passed(FIRST, rotations[FIRST], root[FIRST])
    assert place[1] == pytest.approx(0.8)
    assert np.abs((turns[1:] * pose()[1:]).sum(axis=-1)).min() == pytest.approx(1.0, abs=1e-9)
