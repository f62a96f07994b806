"""A body that stands and waits."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.motion.kinematics import facing
from marey.motion.skeleton import HUMANML3D
from marey.posing.limbs import BONE_LENGTHS, PARENTS
from marey.posing.still import standing_still

FEET, PELVIS, HEAD, WRISTS = [7, 8, 10, 11], 0, 15, [20, 21]


@pytest.mark.parametrize("seed", range(4))
def test_a_body_stands_on_the_floor_breathes_and_keeps_its_feet(seed: int) -> None:
    joints = standing_still(100, random.Random(seed))
    lengths = np.linalg.norm(joints - joints[:, PARENTS], axis=-1)[:, 1:]
    np.testing.assert_allclose(lengths, np.broadcast_to(BONE_LENGTHS[1:], lengths.shape), atol=1e-6)
    assert np.abs(joints[:, FEET] - joints[0, FEET]).max() < 1e-9
    assert joints[:, FEET, 1].min() > 0.0
    assert joints[:, [10, 11], 1].max() < 0.03
    assert joints[:, HEAD, 1].min() > 1.5
    sways = np.ptp(joints[:, PELVIS], axis=0)
    assert 0.003 < sways.max() < 0.03
    assert (joints[:, WRISTS, 1] < joints[:, [PELVIS], 1] + 0.1).all(), "the arms hang"
    np.testing.assert_allclose(facing(joints, HUMANML3D)[:, 2], 1.0, atol=0.02)


def test_bodies_differ_from_seed_to_seed() -> None:
    first, second = (standing_still(20, random.Random(seed)) for seed in (1, 2))
    assert np.abs(first - second).max() > 0.02


def test_the_arms_of_a_body_that_waits_are_not_rigid() -> None:
    joints = standing_still(160, random.Random(1))
    for shoulder, elbow, wrist in ((16, 18, 20), (17, 19, 21)):
        upper, fore = (joints[:, b] - joints[:, a] for a, b in ((shoulder, elbow), (elbow, wrist)))
        cosine = (upper * fore).sum(-1) / np.linalg.norm(upper, axis=-1) / np.linalg.norm(fore, axis=-1)
        assert 1.5 < np.ptp(np.degrees(np.arccos(cosine))) < 12.0
