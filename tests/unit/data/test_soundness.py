from __future__ import annotations

import numpy as np
import pytest

from marey.data.soundness import is_broken
from tests.support.bodies import FPS, bower, runner, walker, waver


@pytest.mark.parametrize("make", [lambda: walker(cadence=3.2), runner, bower, lambda: waver("both")])
def test_sound_motions_are_kept(make):
    assert not is_broken(make(), FPS)


def test_a_joint_that_jumps_is_broken():
    joints = bower()
    joints[30, 20] += [0.6, 0.0, 0.0]
    assert is_broken(joints, FPS)


def test_a_knee_bent_backward_is_broken():
    joints = bower()
    middle = (joints[:, 1] + joints[:, 7]) / 2
    joints[:, 4] = middle - [0.0, 0.0, 0.15]
    assert is_broken(joints, FPS)


def test_a_blow_is_sound():
    joints = bower()
    joints[30, 20] += [0.35, 0.0, 0.0]
    assert not is_broken(joints, FPS)


def test_a_knee_folded_flat_is_sound():
    joints = bower()
    thigh = joints[:, 4] - joints[:, 1]
    joints[:, 7] = joints[:, 4] - 0.95 * thigh + [0.0, 0.0, 0.02]
    joints[:, 10] = joints[:, 7] + [0.0, 0.0, 0.14]
    assert not is_broken(joints, FPS)


def test_a_foot_folded_against_the_shank_is_broken():
    joints = bower()
    joints[:, 10] = joints[:, 7] + np.array([0.0, 0.14, 0.01])
    assert is_broken(joints, FPS)
