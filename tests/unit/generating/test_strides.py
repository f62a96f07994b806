"""A few strides by number, from standing to standing."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.posing.still import standing_still
from marey.quality.record import SHOWN
from marey.selector.matching import wanted_of
from marey.selector.motion import Motion
from marey.selector.records import match_joints
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
TOES = [10, 11]
SEEDS = range(4)


def features_of(action: str, prompt: str, count: int | None, seed: int = 1) -> np.ndarray | None:
    return stated_features(LAYOUT, action, FineWish(count, prompt=prompt), None, seed)


@pytest.mark.parametrize(
    ("action", "prompt", "count"),
    [
        ("walk", "takes two steps forward", 2),
        ("walk", "three paces ahead, no more", 3),
        ("walk", "she walks exactly five steps and stops", 5),
        ("walk", "slowly takes four steps", 4),
        ("walk-backward", "takes three steps back", 3),
        ("walk-backward", "backs away six quick steps", 6),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_strides_are_as_many_as_said_and_end_side_by_side(action: str, prompt: str, count: int, seed: int) -> None:
    features = features_of(action, prompt, count, seed)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    motion = Motion(joints, FPS)
    assert len(REPETITIONS[action](motion)) == count
    assert count < 3 or RULES[action](motion, "") >= SHOWN
    ahead = joints[:, TOES, 2]
    assert ahead[-1, 0] == pytest.approx(ahead[-1, 1], abs=0.03)
    stands = joints[:, TOES, 1] < joints[:, TOES, 1].min() + 0.006
    slides = np.linalg.norm(np.diff(joints[:, TOES][..., [0, 2]], axis=0), axis=-1)
    assert np.where(stands[1:] & stands[:-1], slides, 0.0).max() < 0.025
    way = (-1.0 if action == "walk-backward" else 1.0) * joints[:, 0, 2]
    assert (way.max() - way[-1]) < 0.03, "it does not slide back"
    for hip, knee, ankle in ((1, 4, 7), (2, 5, 8)):
        upper, lower = joints[-1, hip] - joints[-1, knee], joints[-1, ankle] - joints[-1, knee]
        cosine = upper @ lower / np.linalg.norm(upper) / np.linalg.norm(lower)
        assert np.degrees(np.arccos(cosine)) > 155, "it ends with straight knees"


@pytest.mark.parametrize(
    ("prompt", "count"),
    [
        ("walks forward", None),
        ("walks twelve steps", 12),
        ("limps three steps forward", 3),
        ("tiptoes four steps", 4),
        ("takes three steps and turns left", 3),
    ],
)
def test_other_ways_are_left_to_networks(prompt: str, count: int | None) -> None:
    assert features_of("walk", prompt, count) is None


@pytest.mark.parametrize(
    ("action", "prompt", "count"),
    [
        ("walk", "takes a step forward", None),
        ("walk", "the boy steps ahead", None),
        ("walk-backward", "steps back", None),
        ("walk-backward", "takes one step backward", 1),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_single_step_is_one(action: str, prompt: str, count: int | None, seed: int) -> None:
    features = features_of(action, prompt, count, seed)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    went = (joints[-1, 0, 2] - joints[0, 0, 2]) * (-1.0 if action == "walk-backward" else 1.0)
    assert 0.45 < went < 0.72
    assert (match_joints(joints, LAYOUT.skeleton, FPS, wanted_of((prompt,))) or 0.0) >= SHOWN


@pytest.mark.parametrize(
    ("prompt", "least"), [("backs away", 1.6), ("walks backward", 1.6), ("takes a few steps back", 0.8)]
)
def test_ways_back_are_small_steps(prompt: str, least: float) -> None:
    features = features_of("walk-backward", prompt, None)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    assert joints[0, 0, 2] - joints[-1, 0, 2] > least
    assert joints[:, [7, 8], 1].max() < 0.25, "no heel is kicked up"
    steps = REPETITIONS["walk-backward"](Motion(joints, FPS))
    assert (joints[0, 0, 2] - joints[-1, 0, 2]) / len(steps) < 0.55


def test_bodies_that_stand_have_their_feet_at_the_same_places() -> None:
    one, other = (standing_still(20, random.Random(seed)) for seed in (1, 2))
    assert np.abs(one - other)[:, [7, 8, 10, 11]].max() < 1e-6
    assert np.abs(one - other)[:, [20, 21]].max() > 0.01


@pytest.mark.parametrize(
    "prompt",
    ["a toddler waddles along", "shuffles down the hall", "slowly shuffles off", "takes baby steps to the door"],
)
@pytest.mark.parametrize("seed", range(2))
def test_tiny_steps_are_short(prompt: str, seed: int) -> None:
    features = features_of("walk", prompt, None, seed)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    steps = len(REPETITIONS["walk"](Motion(joints, FPS)))
    assert steps >= 7
    assert (joints[-1, 0, 2] - joints[0, 0, 2]) / steps < 0.34
    assert RULES["walk"](Motion(joints, FPS), "") >= SHOWN
    if "shuffle" in prompt:
        assert joints[:, TOES, 1].max() < 0.05


@pytest.mark.parametrize("prompt", ["shuffles the cards", "limps with small steps", "takes small steps to the left"])
def test_other_ways_have_no_tiny_steps(prompt: str) -> None:
    assert features_of("walk", prompt, None) is None
