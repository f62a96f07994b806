"""Joining clips: nothing jumps at the seam."""

from __future__ import annotations

import numpy as np
import pytest

from marey.data.splice import join_clips, turned
from marey.motion import rotations
from marey.motion.kinematics import bone_lengths, forward_kinematics
from marey.motion.skeleton import HUMANML3D
from tests.support.walker import walker

FPS = 20.0


def walked(**options: float) -> np.ndarray:
    return walker(**options).joints.astype(np.float64)


def raised(seconds: float) -> np.ndarray:
    """Standing; the left arm goes from down to straight up within 0.3 s, and stays."""
    time = np.arange(round(seconds * FPS)) / FPS
    share = np.clip(time / 0.3, 0, 1)
    share = share * share * (3 - 2 * share)
    local = np.tile(rotations.IDENTITY, (len(time), 22, 1))
    local[:, HUMANML3D.index("L_shoulder")] = rotations.about("Z", np.radians(-80 + 160 * share))
    root = np.tile(HUMANML3D.offsets[0], (len(time), 1))
    return forward_kinematics(HUMANML3D, local, root)


def jerk(joints: np.ndarray) -> np.ndarray:
    return np.linalg.norm(np.diff(joints, 3, axis=0), axis=-1) * FPS**3


@pytest.mark.parametrize("seed", range(8))
def test_directions_turn_over_without_a_jump_however_far_they_are_apart(seed):
    random = np.random.default_rng(seed)
    axis, start = rotations.normalize(random.normal(size=(2, 3)))
    spin = rotations.from_rotvec(np.arange(-1, 12)[:, None] * 0.25 * axis)  # the second clip's: 5 rad/s
    second = rotations.rotate(spin, start)[:, None]
    away = rotations.from_rotvec(2.6 * rotations.normalize(random.normal(size=3)))
    first = rotations.rotate(away, np.repeat(second[1:2], 2, axis=0))  # the first clip's: still, 150 degrees off
    blended = turned(first, second[1:3], second[2:])
    steps = np.concatenate([first[-1:], blended])
    angles = np.arccos(np.clip(np.einsum("tki,tki->tk", steps[1:], steps[:-1]), -1, 1))
    assert angles.max() < 1.0  # 150 degrees in half a second is 0.26 rad a frame; nothing turns round at once
    np.testing.assert_allclose(blended[-1], second[-1], atol=0.02)


def test_an_arm_that_is_thrown_up_right_after_the_seam_does_not_jump():
    hanging = raised(1)[:1].repeat(20, axis=0)
    second = raised(1.5)
    joined = join_clips(hanging, second, FPS)
    assert jerk(joined).max() < 1.5 * jerk(second).max()


def test_a_straight_knee_never_bends_back_at_a_seam():
    first, second = walked(seconds=2), walked(seconds=2, turn=0.8)
    for leave in range(20, 40, 3):
        joined = join_clips(first[:leave], second[5:], FPS)
        across = joined[:, 1] - joined[:, 2]
        forward = rotations.cross(across, np.broadcast_to([0.0, 1.0, 0.0], across.shape))
        for hip, knee, ankle in ((1, 4, 7), (2, 5, 8)):
            line = joined[:, ankle] - joined[:, hip]
            bend = joined[:, knee] - joined[:, hip]
            bend -= line * (np.einsum("ti,ti->t", bend, line) / np.einsum("ti,ti->t", line, line))[:, None]
            assert np.einsum("ti,ti->t", bend, forward).min() > -1e-3


def test_a_join_keeps_the_first_clip_the_lengths_and_where_the_second_ends_up_going():
    first, second = walked(seconds=2), walked(seconds=2, turn=0.8)
    joined = join_clips(first, second, FPS)
    assert joined.shape == (len(first) + len(second) - 1, 22, 3)
    np.testing.assert_array_equal(joined[: len(first)], first)
    lengths = bone_lengths(joined, HUMANML3D)[:, 1:]
    np.testing.assert_allclose(
        lengths, np.broadcast_to(np.linalg.norm(HUMANML3D.offsets, axis=1)[1:], lengths.shape), atol=1e-3
    )
    own, after = (np.diff(clip[-15:], axis=0) for clip in (second, joined))
    np.testing.assert_allclose(np.linalg.norm(after, axis=-1), np.linalg.norm(own, axis=-1), atol=1e-6)
