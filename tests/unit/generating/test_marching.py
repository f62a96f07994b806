"""Marches ahead: counted, by seconds, with raised knees."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.marching import marches_straight
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.quality.record import SHOWN
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
KNEES, TOES, HANDS = [4, 5], [10, 11], [20, 21]


def marched(prompt: str, count: int | None = None, seed: int = 1, frames: int | None = None) -> np.ndarray:
    wish = FineWish(count, prompt=prompt, fixed=frames is not None)
    features = stated_features(LAYOUT, "walk", wish, frames, seed)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("prompt", "count"),
    [("a cadet marches seven paces", 7), ("goose-steps four steps", 4), ("marches twelve steps, knees up", 12)],
)
def test_a_march_has_as_many_steps_as_said_and_halts(prompt: str, count: int, seed: int) -> None:
    joints = marched(prompt, count, seed)
    motion = Motion(joints, FPS)
    assert len(REPETITIONS["walk"](motion)) == count
    assert RULES["walk"](motion, "") >= SHOWN
    assert joints[-1, TOES, 2] == pytest.approx(joints[-1, TOES, 2].mean(), abs=0.03)


def test_arms_swing_against_the_legs() -> None:
    joints = marched("marches forward")
    legs = joints[:, TOES[0], 2] - joints[:, TOES[1], 2]
    arms = joints[:, HANDS[0], 2] - joints[:, HANDS[1], 2]
    assert np.corrcoef(legs, arms)[0, 1] < -0.5
    assert arms.max() > 0.4


def test_knees_are_raised_where_the_words_say_so() -> None:
    high, plain = (marched(prompt)[:, KNEES, 1].max() for prompt in ("marches with high knees", "marches ahead"))
    assert high > 0.68
    assert 0.57 < plain < 0.66, "each knee is lifted, but not high"
    assert np.median(marched("marches ahead")[:, 0, 1]) > 0.86, "upright"


def test_a_march_fills_the_seconds_that_are_stated() -> None:
    joints = marched("marches for five seconds", frames=100)
    assert len(joints) == 100
    assert len(REPETITIONS["walk"](Motion(joints, FPS))) >= 6


@pytest.mark.parametrize(
    "prompt",
    [
        "marches in a circle",
        "marches up a hill",
        "in March he walks home",
        "marches off to the left",
    ],
)
def test_other_ways_are_no_straight_marches(prompt: str) -> None:
    assert not marches_straight(prompt)
    assert stated_features(LAYOUT, "walk", FineWish(prompt=prompt), None, 1) is None


def test_a_march_in_place_stays_there() -> None:
    assert not marches_straight("marches in place")
    features = stated_features(LAYOUT, "walk", FineWish(prompt="marches in place"), None, 1)
    assert features is not None
    hips = LAYOUT.decode(features)[:, 0, [0, 2]]
    assert np.ptp(hips, axis=0).max() < 0.2
