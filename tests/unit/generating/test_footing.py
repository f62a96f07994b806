"""Runs that are held back by the slide of their feet."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.footing import LOW_M, footed
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import Body, steady

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps


def sliding(speed: float, slide: float) -> np.ndarray:
    """Return joints of a run whose body goes ahead by `slide` m/s faster than its legs carry it."""
    joints = np.array(Body(5.0, speed=steady(speed), duty=0.4, cadence=2.6).joints(), np.float64)
    joints[..., 2] += slide * (np.arange(len(joints)) / FPS)[:, None]
    return joints


def speed_of(joints: np.ndarray) -> float:
    return float(np.linalg.norm(joints[-1, 0, [0, 2]] - joints[0, 0, [0, 2]]) / (len(joints) - 1) * FPS)


def slide_of(joints: np.ndarray) -> float:
    """Return the median speed ahead of the lower toe while it is near the floor, m/s."""
    toes = joints[:, [10, 11]]
    lower = toes[..., 1].argmin(axis=1)
    ahead = (np.gradient(toes[..., 2], axis=0) * FPS)[np.arange(len(joints)), lower]
    return float(np.median(ahead[toes[..., 1].min(axis=1) < LOW_M]))


def test_a_run_goes_as_far_as_its_feet_carry_it() -> None:
    joints = sliding(2.5, 0.8)
    before = LAYOUT.decode(LAYOUT.encode(joints)).astype(np.float64)
    held = footed(LAYOUT.encode(joints), LAYOUT, 2.1)
    assert held is not None
    after = LAYOUT.decode(held).astype(np.float64)
    assert slide_of(before) > 0.5
    assert abs(slide_of(after)) < 0.35
    assert speed_of(after) == pytest.approx(2.5, abs=0.4)
    np.testing.assert_allclose(after[..., 1], before[..., 1], atol=1e-4)


def test_a_run_whose_feet_stand_stays() -> None:
    assert footed(LAYOUT.encode(sliding(2.5, 0.0)), LAYOUT, 2.1) is None


def test_it_remains_a_run() -> None:
    features = LAYOUT.encode(sliding(2.0, 0.8))
    held = footed(features, LAYOUT, 2.5)
    assert held is not None
    assert speed_of(LAYOUT.decode(held).astype(np.float64)) == pytest.approx(2.5, abs=0.15)
    assert footed(features, LAYOUT, 3.0) is None
