"""Movements that are drawn on a body that stands, by what their prompt says of them."""

from __future__ import annotations

import random
import re

import numpy as np
import pytest

from marey.drawing.forms import load_forms
from marey.drawing.kinds import DRAWINGS
from marey.generation.drawn_whole import drawn_whole
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263
from marey.motion.support import clearance
from marey.posing.limbs import BONE_LENGTHS, GRAVITY, PARENTS
from marey.quality.record import SHOWN
from marey.selector.motion import Motion
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263


def drawn(action: str, seed: int, prompt: str = "", side: str = "", frames: int | None = None) -> np.ndarray:
    whole = drawn_whole(LAYOUT, action, FineWish(None, side, prompt, frames is not None), seed, frames)
    assert whole is not None
    return LAYOUT.decode(whole.features).astype(np.float64)


@pytest.mark.parametrize("action", DRAWINGS)
def test_a_movement_shows_its_action_on_a_body_of_fixed_bones(action: str) -> None:
    joints = drawn(action, 3)
    assert RULES[action](Motion(joints, LAYOUT.fps), "") >= SHOWN - 0.1
    lengths = np.linalg.norm(joints - joints[:, PARENTS], axis=-1)[:, 1:]
    np.testing.assert_allclose(lengths, np.broadcast_to(BONE_LENGTHS[1:], lengths.shape), atol=2e-3)
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.6
    assert joints[..., 1].min() > -0.02


@pytest.mark.parametrize("action", ["throw", "slash"])
@pytest.mark.parametrize("seed", range(4))
def test_no_elbow_whips_around_a_wrist_that_hardly_moves(action: str, seed: int) -> None:
    joints = drawn(action, seed)
    for shoulder, elbow, wrist in ((16, 18, 20), (17, 19, 21)):
        limb = joints[:, [elbow, wrist]] - joints[:, [shoulder]]
        elbows, wrists = np.linalg.norm(np.diff(limb, axis=0), axis=-1).T
        assert (elbows - wrists).max() < 0.12


@pytest.mark.parametrize("action", ["jump", "jump-forward"])
@pytest.mark.parametrize("seed", range(4))
def test_the_arms_of_a_jump_swing_up_past_the_hips(action: str, seed: int) -> None:
    joints = drawn(action, seed)
    elbows = joints[:, [18, 19]] - joints[:, [16, 17]]
    assert np.linalg.norm(np.diff(elbows, axis=0), axis=-1).max() < 0.2


@pytest.mark.parametrize("action", ["squat", "pick-up"])
@pytest.mark.parametrize("seed", range(4))
def test_legs_carry_the_hips_no_faster_than_they_can(action: str, seed: int) -> None:
    hips = drawn(action, seed)[:, 0, 1]
    assert np.abs(np.diff(hips)).max() * LAYOUT.fps < 1.3
    assert np.diff(hips, 2).min() * LAYOUT.fps**2 > -GRAVITY, "feet that stand do not pull"


@pytest.mark.parametrize("seed", range(4))
def test_a_crawl_goes_on_its_knees_not_through_the_floor(seed: int) -> None:
    joints = drawn("crawl", seed)
    assert joints[:, [4, 5], 1].min() > 0.04
    assert clearance(joints).min() > -0.02
    way = np.linalg.norm(np.diff(joints[:, 0, [0, 2]], axis=0), axis=-1)
    assert way.mean() * LAYOUT.fps > 0.2


@pytest.mark.parametrize("prompt", ["someone aims a rifle", "takes aim"])
@pytest.mark.parametrize("seed", range(3))
def test_a_gun_is_raised_before_it_is_aimed(prompt: str, seed: int) -> None:
    wrists = drawn("aim", seed, prompt)[:, [20, 21], 1]
    assert wrists[0].max() < 1.0
    assert np.ptp(wrists, axis=0).max() > 0.3


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("seed", range(4))
def test_the_limb_that_is_named_acts(side: str, seed: int) -> None:
    motion = Motion(drawn("kick", seed, side=side), LAYOUT.fps)
    other = "right" if side == "left" else "left"
    assert RULES["kick"](motion, side) >= SHOWN > RULES["kick"](motion, other)


@pytest.mark.parametrize(("prompt", "two_hands"), [("fires a shotgun", True), ("shoots a pistol with one hand", False)])
@pytest.mark.parametrize("seed", range(3))
def test_what_is_not_true_of_the_prompt_is_not_drawn(prompt: str, two_hands: bool, seed: int) -> None:
    joints = drawn("shoot", seed, prompt)
    forward = (joints[:, [20, 21], 2] - joints[:, [16, 17], 2]).max(axis=0) > 0.15
    assert forward.any()
    if two_hands:
        assert forward.all(), "a long gun is held by both hands"


@pytest.mark.parametrize("frames", [60, 100, 180])
def test_a_length_that_is_fixed_is_kept(frames: int) -> None:
    assert len(drawn("bow", 1, frames=frames)) == frames


def test_a_movement_without_room_is_not_drawn() -> None:
    assert drawn_whole(LAYOUT, "sit-ups", FineWish(fixed=True), 1, 20) is None


def test_motions_differ_by_seed_and_are_the_same_for_one() -> None:
    first, again, other = (drawn("kneel", seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert first.shape != other.shape or np.abs(first - other).max() > 0.05


@pytest.mark.parametrize("seed", range(4))
def test_a_kick_is_drawn_in_the_form_that_is_stated(seed: int) -> None:
    low = drawn("kick", seed, "a low kick to the shin")
    assert low[:, [10, 11], 1].max() < 0.75


@pytest.mark.parametrize("seed", range(4))
def test_a_body_that_kneels_stays_down_unless_it_is_to_rise(seed: int) -> None:
    stays, rises = (drawn("kneel", seed, prompt)[:, 0, 1] for prompt in ("he kneels down", "he kneels and gets up"))
    assert stays[0] > 0.85
    assert stays[-1] < 0.65
    assert rises.min() < 0.65
    assert rises[-1] > 0.85


@pytest.mark.parametrize("seed", range(4))
def test_both_hands_or_one_are_as_the_prompt_says(seed: int) -> None:
    for prompt, most in (("waves with both hands", 2), ("waves", 1), ("waves an arm", 1)):
        joints = drawn("wave", seed, prompt)
        up = (joints[:, [20, 21], 1] > joints[:, [16, 17], 1]).any(axis=0)
        assert up.sum() == most, prompt


@pytest.mark.parametrize("seed", range(4))
def test_a_jump_is_done_once_unless_it_is_repeated(seed: int) -> None:
    once, often = (
        np.diff((drawn("jump", seed, prompt)[:, [10, 11], 1].min(axis=1) > 0.08).astype(int), prepend=0)
        for prompt in ("she jumps", "she jumps up and down again and again")
    )
    assert (once > 0).sum() == 1
    assert (often > 0).sum() > 1


@pytest.mark.parametrize("action", load_forms())
def test_forms_are_kinds_of_their_drawings(action: str) -> None:
    forms = load_forms()[action]
    kinds = {kind for seed in range(400) for kind in DRAWINGS[action](random.Random(seed)).kinds}
    assert set(forms.named) | forms.only | forms.usual <= kinds
    assert all(isinstance(words, re.Pattern) for words in forms.named.values())


@pytest.mark.parametrize("seed", range(4))
def test_who_points_ahead_with_the_right_arm_does_not_point_to_the_right(seed: int) -> None:
    joints = drawn("guide", seed, "points ahead with his right arm", "right")
    way = joints[:, 21] - joints[:, 17]
    out = way[int(np.linalg.norm(way[:, [0, 2]], axis=-1).argmax())]
    assert out[2] > abs(out[0])
