"""Nearest training motion: aligned in time, wherever it is and whatever it faces."""

from __future__ import annotations

import numpy as np
import pytest

from marey.evaluator.copies import RATE, TrainingPoses, aligned_distance, poses
from marey.motion.skeleton import HUMANML3D


def motion(seed: int, frames: int = 60) -> np.ndarray:
    """A smooth random motion at 20 fps around the rest pose, (frames, 22, 3)."""
    rng = np.random.default_rng(seed)
    rest = HUMANML3D.offsets.astype(np.float64).copy()
    for joint, parent in enumerate(HUMANML3D.parents):
        if parent >= 0:
            rest[joint] += rest[parent]
    time = np.arange(frames)[:, None, None] / 20
    swing = rng.normal(0, 0.15, (1, 22, 3)) * np.sin(2 * np.pi * (0.4 * time + rng.random((1, 22, 1))))
    swing[:, [0, 1, 2, 16, 17]] = 0  # pelvis, hips and shoulders stay: the heading is that of the rest pose
    return rest[None] + swing


def moved(joints: np.ndarray, degrees: float, shift: tuple[float, float]) -> np.ndarray:
    sin, cos = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    x, z = joints[..., 0], joints[..., 2]
    return np.stack([cos * x + sin * z + shift[0], joints[..., 1], -sin * x + cos * z + shift[1]], axis=-1)


def of(joints: np.ndarray, fps: float = 20.0) -> np.ndarray:
    return poses(joints, fps, HUMANML3D)


def test_place_and_heading_do_not_count() -> None:
    one = motion(1)
    assert of(one).shape == (30, 22, 3)
    assert aligned_distance(of(one), of(moved(one, 130, (3.0, -2.0)))) == pytest.approx(0, abs=1e-6)


def test_a_part_of_a_longer_clip_is_found() -> None:
    long = motion(2, 160)
    assert aligned_distance(of(long[60:120]), of(long)) == pytest.approx(0, abs=1e-6)
    assert aligned_distance(of(long), of(long[60:120])) == pytest.approx(0, abs=1e-6)


def test_a_pause_within_half_a_second_is_warped_away_and_a_longer_one_is_not() -> None:
    one = motion(3, 100)
    brief = np.concatenate([one[:40], np.repeat(one[40:41], 6, axis=0), one[40:94]])
    long = np.concatenate([one[:40], np.repeat(one[40:41], 40, axis=0), one[40:60]])
    apart = aligned_distance(of(motion(4, 100)), of(one))
    assert aligned_distance(of(brief), of(one)) < 0.15 * apart
    assert aligned_distance(of(long), of(one)) > 0.3 * apart


def test_a_shift_of_every_joint_is_the_distance() -> None:
    one = of(motion(5))
    assert aligned_distance(one + np.array([0.0, 0.03, 0.0]), one) == pytest.approx(30, rel=0.05)


def test_the_nearest_of_many_clips_is_found() -> None:
    clips = [(f"clip-{seed}", of(motion(seed, 80))) for seed in range(30)]
    training = TrainingPoses([*clips, ("short", of(motion(7, 12)))])
    noisy = motion(7, 80)[10:70] + np.random.default_rng(0).normal(0, 0.004, (60, 22, 3))
    found = training.nearest(of(noisy))
    assert found.clip == "clip-7"
    assert 2 < found.millimetres < 12
    assert training.nearest(of(motion(99, 80))).millimetres > 40
    assert RATE == 10
