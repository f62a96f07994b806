"""Blasts, dodge rolls, drops, ways up over an edge, and blows with weight."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.drawing.gesture import Gesture
from marey.generation.dodging import dodged
from marey.generation.fine_wish import FineWish
from marey.generation.hits import stated_hit
from marey.generation.hopping import jumps_away
from marey.generation.stepping_aside import steps_aside
from marey.generation.striking import punched
from marey.generation.whole_body import drawn_in_place, whole_body
from marey.posing.still import standing_still
from marey.selector.motion import Motion
from marey.selector.rules import RULES

FPS = 20.0
STILL = np.zeros((60, 22, 3))
TOES = [7, 8, 10, 11]


def made(action: str, prompt: str, **wish: object) -> np.ndarray:
    joints = whole_body(action)(STILL, FPS, FineWish(prompt=prompt, **wish), np.random.default_rng(0))  # pyright: ignore[reportArgumentType]
    assert joints is not None
    return joints


def shown(gesture: Gesture | None) -> np.ndarray:
    assert gesture is not None
    joints = drawn_in_place(lambda _: gesture, 1, None, random.Random(0))
    assert joints is not None
    return joints


def bend(joints: np.ndarray, a: int, b: int, c: int) -> np.ndarray:
    """Degrees (T,) of the angle at a joint; 180 = straight."""
    first, second = joints[:, a] - joints[:, b], joints[:, c] - joints[:, b]
    cos = (first * second).sum(-1) / np.linalg.norm(first, axis=-1) / np.linalg.norm(second, axis=-1)
    return np.degrees(np.arccos(np.clip(cos, -1, 1)))


@pytest.mark.parametrize("prompt", ["knocked flat by an explosion", "falls backward, thrown by a blast"])
def test_a_blast_throws_a_body_off_its_feet_onto_its_back(prompt: str) -> None:
    joints = made("die", prompt)
    assert joints[-1, 0, 2] - joints[0, 0, 2] < -1.4
    assert (joints[:, TOES, 1].min(axis=1) > 0.1).sum() >= 4
    lies = int(np.flatnonzero(joints[:, 0, 1] < 0.3)[0])
    assert lies / FPS < 1.6


def test_a_dodge_roll_is_quick_and_goes_to_its_side() -> None:
    joints = made("roll", "roll dodge right")
    low = np.flatnonzero(joints[:, 0, 1] < 0.75)
    assert (low[-1] - low[0]) / FPS < 1.2
    assert joints[-1, 0, 0] - joints[0, 0, 0] < -1.3
    assert made("roll", "dodge roll")[-1, 0, 2] > 1.3


def test_a_roll_in_bed_or_of_a_log_is_no_dodge() -> None:
    low = np.flatnonzero(made("roll", "log roll to the right")[:, 0, 1] < 0.6)
    assert len(low) / FPS > 0.8


@pytest.mark.parametrize(("prompt", "high"), [("drop from the roof", 1.5), ("jumps down off a crate", 0.4)])
def test_a_drop_is_one_jump_down(prompt: str, high: float) -> None:
    joints = shown(jumps_away(FineWish(prompt=prompt), random.Random(0), None))
    assert joints[0, TOES, 1].min() > high
    assert joints[-1, TOES, 1].min() < 0.05
    assert joints[-1, 0, 1] == pytest.approx(0.935, abs=0.03)
    assert RULES["jump"](Motion(joints, FPS), "") >= 0.5


@pytest.mark.parametrize(("side", "sign"), [("left", 1.0), ("right", -1.0)])
def test_a_sideways_jump_may_end_in_a_crouch(side: str, sign: float) -> None:
    wish = FineWish(prompt=f"jump sideways to the {side} landing low")
    joints = shown(jumps_away(wish, random.Random(0), None))
    assert sign * (joints[-1, 0, 0] - joints[0, 0, 0]) > 0.3
    assert joints[-1, 0, 1] < 0.6


def test_who_pulls_up_over_an_edge_stands_on_top_unless_more_follows() -> None:
    joints = made("climb-onto", "pulls herself up over the ledge")
    assert joints[-1, TOES, 1].min() > 1.5
    assert joints[-1, 0, 1] - joints[-1, TOES, 1].min() > 0.85
    wish = FineWish(prompt="pulls herself up over the ledge", beside=("", "walks"))
    assert whole_body("climb-onto")(STILL, FPS, wish, np.random.default_rng(0)) is None


@pytest.mark.parametrize("kind", ["hook", "uppercut"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_hooks_and_uppercuts_have_bent_elbows_and_turn_the_hips(kind: str, side: str) -> None:
    joints = punched(STILL, FPS, FineWish(prompt=f"{side} {kind}"), np.random.default_rng(0))
    assert joints is not None
    arm = (16, 18, 20) if side == "left" else (17, 19, 21)
    assert bend(joints, *arm).max() < 150
    hips = np.degrees(np.unwrap(np.arctan2(joints[:, 1, 2] - joints[:, 2, 2], joints[:, 1, 0] - joints[:, 2, 0])))
    assert np.ptp(hips) > 20


def test_a_heavy_blow_takes_longer_to_load_than_a_light_one() -> None:
    heavy, light = (
        punched(STILL, FPS, FineWish(prompt=f"{weight} right uppercut"), np.random.default_rng(0))
        for weight in ("heavy", "light")
    )
    assert heavy is not None
    assert light is not None
    assert len(heavy) > len(light) + 4
    assert np.ptp(heavy[:, 0, 1]) > 1.3 * np.ptp(light[:, 0, 1])


def test_several_dodges_have_room_in_a_short_time_and_a_punch_comes_soon_behind_them() -> None:
    still = standing_still(34, random.Random(0))
    joints = dodged(still, FPS, FineWish(count=2, prompt="dodge, dodge"), np.random.default_rng(0))
    assert joints is not None
    head = joints[:, 15, 0] - joints[0, 15, 0]
    assert head.max() > 0.15
    assert head.min() < -0.15
    alone, behind = (
        punched(STILL, FPS, FineWish(prompt="right hook", beside=beside), np.random.default_rng(0))
        for beside in (("", ""), ("dodge", ""))
    )
    assert alone is not None
    assert behind is not None
    assert len(behind) < len(alone)


def test_a_shove_makes_a_body_step_back() -> None:
    wish = FineWish(prompt="stumbles backwards after a shove")
    joints = shown(stated_hit(wish, random.Random(0), None))
    assert joints[-1, 0, 2] - joints[0, 0, 2] < -0.5


def test_who_edges_along_a_ledge_steps_slowly_to_the_side() -> None:
    wish = FineWish(side="left", prompt="shimmies left along a ledge")
    joints = shown(steps_aside(wish, random.Random(0), None))
    assert joints[-1, 0, 0] - joints[0, 0, 0] > 0.4
    assert abs(joints[-1, 0, 2] - joints[0, 0, 2]) < 0.2
