"""Bones of constant length: limbs of two bones."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.posing.bones import steady_bends, two_bones
from marey.posing.standing import LEFT, StandingBody
from marey.posing.still import standing_still

FRAMES, LENGTHS = 60, (0.26, 0.25)
MOST_M = 0.16  # metres a frame of an elbow whose wrist goes slowly


def past_the_pole(beside: float) -> np.ndarray:
    """The wrist (T, 3) from the shoulder, on a way that passes the direction in which the elbow points."""
    share = np.linspace(-1.0, 1.0, FRAMES)
    return np.stack([0.3 * np.ones(FRAMES), beside * np.ones(FRAMES), 0.2 * share], axis=-1)


@pytest.mark.parametrize("beside", [0.004, -0.01])
def test_an_elbow_does_not_whip_around_where_the_wrist_passes_its_pole(beside: float) -> None:
    wrists, pole = past_the_pole(beside), np.tile([1.0, 0.0, 0.0], (FRAMES, 1))
    elbows, ends = two_bones(np.zeros((FRAMES, 3)), wrists, pole, LENGTHS)
    assert np.linalg.norm(np.diff(elbows, axis=0), axis=-1).max() < MOST_M
    np.testing.assert_allclose(ends, wrists, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(elbows, axis=-1), LENGTHS[0], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(ends - elbows, axis=-1), LENGTHS[1], atol=1e-9)


def test_a_hand_that_is_held_bends_its_elbow_as_steadily() -> None:
    body = StandingBody(standing_still(FRAMES, random.Random(1)))
    upper, fore = body.reach(LEFT, past_the_pole(0.004), (1.0, 0.0, 0.0))
    assert np.linalg.norm(np.diff(upper, axis=0), axis=-1).max() * LENGTHS[0] < MOST_M
    assert np.isfinite(fore).all()


def test_a_limb_that_turns_slowly_bends_exactly_towards_its_pole() -> None:
    angle = np.linspace(0.0, 1.0, FRAMES)
    axis = np.stack([np.cos(angle), np.sin(angle), np.zeros(FRAMES)], axis=-1)
    pole = np.tile([0.0, 0.0, -2.0], (FRAMES, 1))
    np.testing.assert_allclose(steady_bends(axis, pole), 0.5 * pole, atol=1e-12)
    np.testing.assert_allclose(steady_bends(axis[:1], pole[:1]), 0.5 * pole[:1], atol=1e-12)
