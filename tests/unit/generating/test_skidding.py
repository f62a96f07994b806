"""Runs that end in a skid or stop abruptly."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.skidding import skidded
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import Body, steady

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
PELVIS, NECK = 0, 12


def run(seconds: float = 5.0, speed: float = 3.6) -> np.ndarray:
    return LAYOUT.encode(Body(seconds, speed=steady(speed)).joints())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("how", "slides"), [("skid", 0.7), ("stop", 0.3)])
def test_it_slides_leaning_back_and_stands_in_the_end(how: str, slides: float, seed: int) -> None:
    made = skidded(run(), LAYOUT, how, seed)
    assert made is not None
    joints = LAYOUT.decode(made).astype(np.float64)
    speed = np.linalg.norm(np.gradient(joints[:, PELVIS, [0, 2]], axis=0), axis=1) * FPS
    trunk = joints[:, NECK] - joints[:, PELVIS]
    leans = np.degrees(np.arctan2(trunk[:, 2], trunk[:, 1]))
    assert speed[5:20].min() > 2.8
    assert speed[-6:].max() < 0.1
    back = np.flatnonzero(leans < -3)
    assert len(back) >= 4
    assert joints[back[-1], PELVIS, 2] - joints[back[0], PELVIS, 2] > slides
    assert joints[-1, PELVIS, 1] > 0.88
    assert joints[..., 1].min() > -0.02


def test_a_skid_keeps_a_length_that_is_fixed() -> None:
    made = skidded(run(), LAYOUT, "skid", 1, fixed=80)
    assert made is not None
    assert len(made) == 80


def test_who_does_not_run_does_not_skid() -> None:
    assert skidded(run(speed=0.8), LAYOUT, "skid", 1) is None
