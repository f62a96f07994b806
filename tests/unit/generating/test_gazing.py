"""Heads that turn where the prompt has them look."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from marey.generation.gazing import with_gaze
from marey.motion.clip import MotionClip
from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.motion.kinematics import forward_kinematics
from marey.motion.rotations import rotate
from marey.motion.skeleton import HUMANML3D
from tests.support.bodies import Body


def clip(**manifest: Any) -> MotionClip:
    layout = HUMANML3D_263
    return finish_motion(layout.encode(Body(6.0).joints()), layout, manifest={"seed": 3, **manifest})


def faced(made: MotionClip) -> tuple[Any, Any]:
    """Return degrees (T,) to the left and down that the head faces, from the chest."""
    forward = np.broadcast_to([0.0, 0.0, 1.0], (made.frames, 3))
    for name in ("head", "neck"):
        forward = rotate(made.rotations[:, made.skeleton.joint_names.index(name)].astype(float), forward)
    left, up, ahead = forward.T
    return np.degrees(np.arctan2(left, ahead)), -np.degrees(np.arcsin(up))


def test_the_head_looks_to_one_side_and_then_to_the_other() -> None:
    yaw, _ = faced(with_gaze(clip(gaze=["left", "right"])))
    assert yaw[15:50].min() > 40
    assert yaw[70:105].max() < -40
    assert abs(yaw[0]) < 5
    assert abs(yaw[-1]) < 5
    assert np.abs(np.diff(yaw)).max() * 20 < 450  # degrees a second


@pytest.mark.parametrize(("glance", "sign"), [("down", 1), ("up", -1)])
def test_the_head_looks_up_and_down(glance: str, sign: int) -> None:
    _, before = faced(clip())
    _, pitch = faced(with_gaze(clip(gaze=[glance])))
    assert sign * (pitch - before)[40:80].mean() > 20


def test_a_head_is_shaken_to_and_fro() -> None:
    yaw, _ = faced(with_gaze(clip(gaze=["shake"])))
    assert yaw.max() > 12
    assert yaw.min() < -12
    turns = np.flatnonzero(np.diff(np.sign(yaw[np.abs(yaw) > 5])))
    assert len(turns) >= 8


def test_of_a_timeline_the_row_that_looks_does() -> None:
    rows = [{"start": 0.0, "end": 3.0, "seed": 1}, {"start": 3.0, "end": 5.95, "seed": 2, "gaze": ["around"]}]
    yaw, _ = faced(with_gaze(clip(timeline={"rows": rows})))
    assert np.abs(yaw[:55]).max() < 5
    assert yaw[60:].max() > 40
    assert yaw[60:].min() < -40


def test_all_but_the_head_stays() -> None:
    before, made = clip(gaze=["around"]), with_gaze(clip(gaze=["around"]))
    head = HUMANML3D.index("head")
    np.testing.assert_array_equal(np.delete(made.joints, head, axis=1), np.delete(before.joints, head, axis=1))
    np.testing.assert_allclose(made.joints, forward_kinematics(made.skeleton, made.rotations, made.root), atol=1e-5)
    assert with_gaze(clip()).rotations is not None
    np.testing.assert_array_equal(with_gaze(clip()).rotations, clip().rotations)


def test_a_shake_of_the_head_is_as_large_behind_a_glance() -> None:
    for glances in (["shake"], ["left", "shake"]):
        yaw, _ = faced(with_gaze(clip(gaze=glances)))
        assert yaw[len(yaw) // 2 + 10 :].max() > 20
        assert yaw[len(yaw) // 2 + 10 :].min() < -20


@pytest.mark.parametrize(("glance", "sign"), [("behind_left", 1.0), ("behind_right", -1.0)])
def test_who_looks_behind_turns_the_shoulders_too(glance: str, sign: float) -> None:
    before, made = clip(), with_gaze(clip(gaze=[glance]))

    def yaw(joints: np.ndarray, left: int, right: int) -> np.ndarray:
        across = joints[:, left] - joints[:, right]
        return np.degrees(np.arctan2(-across[:, 2], across[:, 0]))

    middle = len(made.joints) // 2
    shoulders = (yaw(made.joints, 16, 17) - yaw(before.joints, 16, 17))[middle]
    assert 35 < sign * shoulders < 60
    np.testing.assert_allclose(made.joints[:, :3], before.joints[:, :3], atol=1e-5)
