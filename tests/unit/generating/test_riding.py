"""Rides on a horse and on a bicycle."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from tests.support.drawn_motions import named_movement

LAYOUT = HUMANML3D_263
PELVIS, KNEES, ANKLES, TOES, WRISTS = 0, [4, 5], [7, 8], [10, 11], [20, 21]
SEEDS = range(3)


def rises(joints: np.ndarray) -> tuple[float, float]:
    """Return by how many metres the hips rise and fall, and how often a second."""
    height = joints[:, PELVIS, 1] - joints[:, PELVIS, 1].mean()
    turns = np.flatnonzero(np.diff(np.sign(height)) != 0)
    return float(np.ptp(joints[:, PELVIS, 1])), len(turns) / 2 / (len(joints) / LAYOUT.fps)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("prompt", ["rides a horse", "rides a horse at a trot", "a cowboy gallops away"])
def test_a_rider_sits_astride_with_standing_feet_and_the_reins_ahead(prompt: str, seed: int) -> None:
    joints = named_movement(prompt, seed=seed)
    assert np.linalg.norm(joints[:, ANKLES[0]] - joints[:, ANKLES[1]], axis=-1).min() > 0.5
    assert np.linalg.norm(np.diff(joints[:, ANKLES], axis=0), axis=-1).max() < 0.01
    assert joints[:, PELVIS, 1].max() < 0.86  # the knees stay bent
    assert (joints[:, WRISTS, 2] - joints[:, [PELVIS], 2]).min() > 0.15
    assert np.abs(joints[:, TOES, 1]).max() < 0.05


@pytest.mark.parametrize("seed", SEEDS)
def test_a_gallop_is_faster_than_a_trot_and_both_rise_more_than_a_walk(seed: int) -> None:
    walk, trot, gallop = (
        rises(named_movement(f"rides a horse{pace}", seed=seed)) for pace in ("", " at a trot", " at a full gallop")
    )
    assert walk[0] < 0.03 < min(trot[0], gallop[0])
    assert walk[1] < trot[1] < gallop[1]


@pytest.mark.parametrize("seed", SEEDS)
def test_feet_go_round_with_the_pedals_one_against_the_other(seed: int) -> None:
    joints = named_movement("pedals a bicycle", seed=seed)
    heights = joints[:, ANKLES, 1]
    assert np.ptp(heights, axis=0).min() > 0.25
    assert np.corrcoef(heights.T)[0, 1] < -0.9
    assert np.ptp(joints[:, PELVIS], axis=0).max() < 0.03
    assert joints[:, TOES, 1].min(axis=1).max() < 0.2  # one foot is low at any time
    fast = named_movement("a cyclist races down the road", seed=seed)
    assert rises_of(fast) > 1.3 * rises_of(joints)


def rises_of(joints: np.ndarray) -> float:
    """Return how often a second the left foot goes round."""
    height = joints[:, ANKLES[0], 1]
    return float(np.count_nonzero(np.diff(np.sign(height - height.mean())) > 0) / (len(height) / LAYOUT.fps))


@pytest.mark.parametrize("prompt", ["rides the bus", "rides a motorcycle", "he walks his bike home", "rides a wave"])
def test_other_rides_are_not_named_movement(prompt: str) -> None:
    assert stated_features(LAYOUT, "idle", FineWish(prompt=prompt), 60, 1) is None
