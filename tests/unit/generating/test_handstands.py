"""Handstands: held, repeated, and walked on."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.drawing.handstands import handstand
from marey.generation.fine_wish import FineWish
from marey.generation.named import MOST_HANDSTANDS
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.posing.standing import StandingBody
from marey.posing.still import standing_still
from marey.quality.measure import range_degrees, self_contact
from marey.vocabulary.bearing_words import stated_bearings

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
PELVIS, CHEST, WRISTS, ANKLES, TOES = 0, 9, [20, 21], [7, 8], [10, 11]


def drawn(prompt: str, *, frames: int | None = None, beside: tuple[str, str] = ("", ""), seed: int = 1) -> np.ndarray:
    wish = FineWish(prompt=prompt, fixed=frames is not None, beside=beside)
    features = stated_features(LAYOUT, "idle", wish, frames, seed)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


def inverted(joints: np.ndarray) -> np.ndarray:
    """Frames (T,) in which the trunk hangs and both hands carry it."""
    trunk = joints[:, PELVIS] - joints[:, CHEST]
    upright = trunk[:, 1] / np.linalg.norm(trunk, axis=-1)
    return (upright > 0.95) & (joints[:, WRISTS, 1].max(axis=1) < 0.1)


def times_of(frames: np.ndarray) -> int:
    return int((np.diff(frames.astype(int), prepend=0) == 1).sum())


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_body_stands_on_its_hands_and_then_on_its_feet_again(seed: int) -> None:
    joints = drawn("a gymnast does a handstand", seed=seed)
    held = inverted(joints)
    assert times_of(held) == 1
    assert 0.8 < held.sum() / FPS < 3.0
    assert joints[held][:, ANKLES, 1].min() > 1.25
    assert np.ptp(joints[held][:, WRISTS], axis=0).max() < 0.04, "the hands stay"
    for ends in (joints[0], joints[-1]):
        assert ends[PELVIS, 1] > 0.85
        assert ends[TOES, 1].max() < 0.05
    assert joints[..., 1].min() > -0.01
    assert range_degrees(joints) == 0.0
    assert self_contact(joints) < 0.02
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() * FPS < 8.0


def test_it_is_held_for_as_long_as_there_is_room() -> None:
    short, long = (inverted(drawn("does a handstand", frames=round(s * FPS))).sum() / FPS for s in (7, 14))
    assert long - short > 5.0
    assert 2.5 < inverted(drawn("kicks up into a handstand and holds it for three seconds")).sum() / FPS < 4.5


@pytest.mark.parametrize(
    ("prompt", "number"),
    [("does two handstands", 2), ("does ten handstands", MOST_HANDSTANDS), ("does a handstand for five seconds", 1)],
)
def test_a_number_is_one_of_handstands_not_of_seconds(prompt: str, number: int) -> None:
    assert times_of(inverted(drawn(prompt))) == number


def test_hands_walk_ahead_one_after_the_other() -> None:
    joints = drawn("walks on her hands for four steps")
    on_hands = joints[:, ANKLES, 1].min(axis=1) > 1.5
    ways = joints[on_hands][:, WRISTS, 2]
    assert (ways[-1] - ways[0]).min() > 0.4
    lifted = joints[on_hands][:, WRISTS, 1] > 0.1
    assert [times_of(each) for each in lifted.T] == [2, 2]
    assert not lifted.all(axis=1).any()
    assert np.abs(joints[-1, :, 1] - joints[0, :, 1]).max() < 0.1


@pytest.mark.parametrize("side", ["left", "right"])
def test_the_foot_that_is_named_leaves_the_floor_last(side: str) -> None:
    gesture = handstand(random.Random(1), side)
    body = StandingBody(standing_still(round(gesture.seconds * FPS), random.Random(1)))
    gesture.change(body)
    first = [int(np.argmax(body.joints[:, ankle, 1] > 0.4)) for ankle in ANKLES]
    assert (first[0] > first[1]) == (side == "left")
    assert gesture.side == side


@pytest.mark.parametrize(
    ("prompt", "asked"),
    [
        ("handstand against a wall", True),
        ("she performs a perfect handstand", True),
        ("kicking up into a handstand", True),
        ("he walks on his hands", True),
        ("a handstand walk", True),
        ("crawls on his hands and knees", False),
        ("walks with his hands on his head", False),
        ("does a cartwheel", False),
        ("walks on his hands and knees", False),
    ],
)
def test_words_of_a_handstand(prompt: str, asked: bool) -> None:
    assert any(each.name == "handstand" for each in stated_bearings(prompt)) == asked
