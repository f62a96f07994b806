"""Weight of standing bodies that gesture."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.generation.drawn_whole import drawn_whole
from marey.generation.fine_wish import FineWish
from marey.generation.weight import STAYS_M, WEIGHS, with_weight
from marey.motion.features import HUMANML3D_263
from marey.posing.still import standing_still
from marey.quality.measure import range_degrees
from marey.selector.motion import Motion
from marey.selector.rules import RULES
from marey.vocabulary.entries import load_vocabulary

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
FEET, PELVIS, NECK = [7, 8, 10, 11], 0, 12


def still(seconds: float = 5.0) -> np.ndarray:
    return standing_still(round(seconds * FPS), random.Random(1))


def trunk_of(joints: np.ndarray) -> np.ndarray:
    trunk = joints[:, NECK] - joints[:, PELVIS]
    return trunk / np.linalg.norm(trunk, axis=-1, keepdims=True)


@pytest.mark.parametrize("seed", range(4))
def test_hips_shift_over_feet_that_stay_and_the_spine_leans_back(seed: int) -> None:
    before = still()
    after = with_weight(before, random.Random(seed))
    moved = after[:, PELVIS] - before[:, PELVIS]
    assert np.abs(after - before)[:, FEET].max() < 0.002
    assert 0.01 < np.abs(moved[:, 0]).max() < 0.04
    assert np.abs(after - before)[[0, -1]].max() < 0.002, "it begins and ends as the gesture does"
    far = int(np.abs(moved[:, 0]).argmax())
    leans = trunk_of(after)[far, 0] - trunk_of(before)[far, 0]
    assert leans * moved[far, 0] < 0
    assert np.linalg.norm(np.diff(after, n=2, axis=0), axis=-1).max() * FPS**2 < 4.0
    bones = [(1, 4), (4, 7), (2, 5), (5, 8), (16, 18), (18, 20)]
    lengths = [[np.linalg.norm(each[:, a] - each[:, b], axis=-1) for a, b in bones] for each in (before, after)]
    assert np.abs(np.array(lengths[0]) - np.array(lengths[1])).max() < 0.003


def test_bodies_that_move_their_feet_or_hips_stay_as_they_are() -> None:
    steps = still()
    steps[40:, FEET[0], 2] += 2 * STAYS_M
    assert with_weight(steps, random.Random(1)) is steps
    sways = still()
    sways[:, :, 0] += 0.05 * np.sin(np.arange(len(sways)) / 8.0)[:, None]
    sways[:, FEET] = still()[:, FEET]
    assert with_weight(sways, random.Random(1)) is sways


@pytest.mark.parametrize("action", ["wave", "clap", "drink", "signal", "arm-circles"])
def test_drawn_gestures_have_weight_and_still_show(action: str) -> None:
    assert action in WEIGHS
    made = drawn_whole(LAYOUT, action, FineWish(prompt=load_vocabulary().need(action).plain_words), 2, None)
    assert made is not None
    joints = LAYOUT.decode(made.features).astype(np.float64)
    assert np.ptp(joints[:, FEET], axis=0).max() < 0.02
    assert np.ptp(joints[:, PELVIS, 0]) > 0.018
    assert range_degrees(joints) < 15
    assert RULES[action](Motion(joints, FPS), "") >= 0.5
