"""Parts of movements that their prompts ask for: numbers, legs by turns, jumps, draws, heights of hands."""

from __future__ import annotations

import itertools
import random

import numpy as np
import pytest

from marey.drawing.shots import drawn_pistol
from marey.generation.bearing_drawing import arms_of
from marey.generation.fine_wish import FineWish
from marey.generation.named import times_again
from marey.generation.overhead import LEAST_UP, overhead
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.posing.standing import StandingBody
from marey.posing.still import standing_still
from marey.vocabulary.bearing_words import stated_bearings
from tests.support.drawn_motions import named_movement

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
PELVIS, HEAD, TOES, SHOULDERS, WRISTS, ANKLES = 0, 15, [10, 11], [16, 17], [20, 21], [7, 8]


def runs(mask: np.ndarray) -> int:
    """Return how often a mask (T,) becomes true."""
    return int(np.count_nonzero(np.diff(np.concatenate([[0], mask.astype(int)])) == 1))


@pytest.mark.parametrize(("prompt", "times"), [("burpees x3", 3), ("burpees x4", 4), ("3x burpees", 3)])
def test_burpees_are_done_as_often_as_is_noted(prompt: str, times: int) -> None:
    assert runs(named_movement(prompt)[:, WRISTS, 1].min(axis=1) > 1.8) == times


@pytest.mark.parametrize(
    ("prompt", "times"), [("lunges x4", 4), ("lunges, alternating legs", 4), ("lunges, left leg then right leg", 4)]
)
def test_lunges_are_done_on_both_legs(prompt: str, times: int) -> None:
    joints = named_movement(prompt)
    low = joints[:, PELVIS, 1] < 0.65
    assert runs(low) == times
    ahead = [
        joints[part[0][0], ANKLES, 2].argmax()
        for part in ([*each] for down, each in itertools.groupby(enumerate(low), lambda pair: pair[1]) if down)
    ]
    assert set(ahead) == {0, 1}


def test_movements_that_are_drawn_once_are_done_again() -> None:
    assert (times_again("tennis serve x2"), times_again("tennis serve"), times_again("burpees x3")) == (2, 1, 1)
    joints = named_movement("tennis serve x2")
    assert runs(joints[:, WRISTS, 1].max(axis=1) > joints[0, HEAD, 1] + 0.2) >= 2
    assert len(joints) > 1.7 * len(named_movement("tennis serve"))


@pytest.mark.parametrize(("prompt", "times"), [("volleyball spike", 1), ("volleyball spike x2", 2)])
def test_who_spikes_a_volleyball_jumps_and_strikes_at_the_top(prompt: str, times: int) -> None:
    joints = named_movement(prompt)
    high = joints[:, TOES, 1].min(axis=1)
    assert runs(high > 0.15) == times
    highest = int(joints[:, 21, 1].argmax())
    assert high[highest] > 0.2
    assert joints[highest, 21, 1] > 2.0
    assert high[-1] < 0.05


@pytest.mark.parametrize(
    ("said", "action", "kicks"),
    [
        ("draws pistol from hip and fires twice", "shoot", 2),
        ("draws a gun and shoots", "shoot", 1),
        ("pulls a revolver", "aim", 0),
    ],
)
def test_a_pistol_comes_from_the_hip_and_is_fired(said: str, action: str, kicks: int) -> None:
    wish = FineWish(prompt=said, count=2 if kicks == 2 else None)
    features = stated_features(LAYOUT, action, wish, None, 3)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    hand = joints[:, 21] - joints[:, 17]
    aims = hand[:, 2] > 0.38
    assert runs(aims) >= 1
    assert np.linalg.norm(hand[: aims.argmax()] - hand[0], axis=1).max() > 0.02
    assert hand[: aims.argmax(), 1].min() < -0.35, "from the hip"
    up = hand[aims][:, 1]
    tops = np.count_nonzero((up[1:-1] > up[:-2] + 0.005) & (up[1:-1] >= up[2:]) & (up[1:-1] > np.median(up) + 0.02))
    assert tops == kicks
    assert stated_features(LAYOUT, action, FineWish(prompt="fires a gun"), None, 3) is None


def test_the_hand_that_is_named_draws() -> None:
    gesture = drawn_pistol(random.Random(2), "left")
    body = StandingBody(standing_still(round(gesture.seconds * FPS), random.Random(2)))
    gesture.change(body)
    joints = body.solved()
    assert (joints[:, 20, 2] - joints[:, 16, 2]).max() > 0.38
    assert (joints[:, 21, 2] - joints[:, 17, 2]).max() < 0.2


@pytest.mark.parametrize("prompt", ["block low", "a low block", "blocks a kick to the shin"])
def test_a_low_block_sweeps_down_from_the_guard(prompt: str) -> None:
    features = stated_features(LAYOUT, "block", FineWish(prompt=prompt), None, 2)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    up = joints[:, WRISTS, 1] - joints[:, SHOULDERS, 1]
    ahead = joints[:, WRISTS, 2] - joints[:, SHOULDERS, 2]
    low = (up < -0.36) & (ahead > 0.12)
    assert low[round(0.5 * FPS) : -5].any()
    assert stated_features(LAYOUT, "block", FineWish(prompt="block high"), None, 2) is None


@pytest.mark.parametrize("name", ["hammers a nail overhead", "saws a branch overhead", "paints the ceiling"])
def test_hands_that_work_overhead_are_above_the_shoulders(name: str) -> None:
    (stated,) = stated_bearings(name)
    assert stated.is_overhead
    raised = overhead(stated.bearing)
    assert raised.head < 0.0
    for pose in arms_of(stated, raised).values():
        places = [*pose.path, *([pose.hand] if pose.hand else [])]
        assert all(place[1] >= LEAST_UP for place in places if pose.at in ("shoulder", "chest"))
