"""Motions that do not show their action are drawn instead."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.drawing.kinds import DRAWINGS
from marey.generation.fine import FINE
from marey.generation.fine_wish import FineWish
from marey.generation.redrawn import drawn_alone, redrawn
from marey.motion.features import HUMANML3D_263, encode_all
from marey.posing.limbs import BONE_LENGTHS, PARENTS
from marey.posing.still import standing_still
from marey.quality.record import SHOWN
from marey.selector.motion import Motion
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
IDLE = encode_all(LAYOUT, standing_still(100, random.Random(0)))


def joints_of(features: np.ndarray | None) -> np.ndarray:
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


@pytest.mark.parametrize("action", DRAWINGS)
def test_a_body_that_only_stands_is_drawn_as_it_was_asked_for(action: str) -> None:
    joints = joints_of(redrawn(IDLE, LAYOUT, action, FineWish(), 3))
    assert RULES[action](Motion(joints, LAYOUT.fps), "") >= SHOWN - 0.1
    lengths = np.linalg.norm(joints - joints[:, PARENTS], axis=-1)[:, 1:]
    np.testing.assert_allclose(lengths, np.broadcast_to(BONE_LENGTHS[1:], lengths.shape), atol=2e-3)
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.6
    assert joints[..., 1].min() > -0.02


def test_a_motion_that_shows_its_action_stays() -> None:
    shown = redrawn(IDLE, LAYOUT, "kneel", FineWish(), 3)
    assert shown is not None
    assert redrawn(shown, LAYOUT, "kneel", FineWish(), 3) is None


@pytest.mark.parametrize("action", ["walk", "dance", "punch", ""])
def test_other_actions_are_left_to_networks_or_drawn_otherwise(action: str) -> None:
    assert redrawn(IDLE, LAYOUT, action, FineWish(), 3) is None


def test_no_action_is_drawn_in_two_ways() -> None:
    assert not set(DRAWINGS) & set(FINE)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("seed", range(4))
def test_the_limb_that_is_named_acts(side: str, seed: int) -> None:
    motion = Motion(joints_of(redrawn(IDLE, LAYOUT, "kick", FineWish(side=side), seed)), LAYOUT.fps)
    other = "right" if side == "left" else "left"
    assert RULES["kick"](motion, side) >= SHOWN > RULES["kick"](motion, other)


@pytest.mark.parametrize(("prompt", "two_hands"), [("fires a shotgun", True), ("shoots a pistol with one hand", False)])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_not_true_of_the_prompt_is_not_drawn(prompt: str, two_hands: bool, seed: int) -> None:
    joints = joints_of(redrawn(IDLE, LAYOUT, "shoot", FineWish(prompt=prompt), seed))
    forward = (joints[:, [20, 21], 2] - joints[:, [16, 17], 2]).max(axis=0) > 0.15
    assert forward.any()
    if two_hands:
        assert forward.all(), "a long gun is held by both hands"


@pytest.mark.parametrize("frames", [60, 100, 180])
def test_a_length_that_is_fixed_is_kept(frames: int) -> None:
    idle = encode_all(LAYOUT, standing_still(frames, random.Random(0)))
    features = redrawn(idle, LAYOUT, "bow", FineWish(fixed=True), 1)
    assert features is not None
    assert len(features) == frames


def test_a_movement_without_room_is_not_drawn() -> None:
    idle = encode_all(LAYOUT, standing_still(20, random.Random(0)))
    assert redrawn(idle, LAYOUT, "sit-ups", FineWish(fixed=True), 1) is None


def test_motions_differ_by_seed_and_are_the_same_for_one() -> None:
    first, again, other = (joints_of(redrawn(IDLE, LAYOUT, "kneel", FineWish(), seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert first.shape != other.shape or np.abs(first - other).max() > 0.05


@pytest.mark.parametrize("seed", range(4))
def test_a_kick_is_drawn_in_the_form_that_is_stated(seed: int) -> None:
    kick = FineWish(prompt="a low kick to the shin")
    low = joints_of(drawn_alone(LAYOUT, "kick", kick, seed, None))
    assert low[:, [10, 11], 1].max() < 0.75
