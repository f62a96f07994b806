"""Punches that are drawn on a motion."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from marey.generation.fine import drawn_features
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263
from marey.motion.skeleton import HUMANML3D
from marey.referee import Body as Measured
from marey.referee import shows
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import RULES
from tests.support.bodies import Body
from tests.support.drawn_motions import drawn_on

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
BEFORE = LAYOUT.decode(LAYOUT.encode(Body(6.0).joints())).astype(np.float64)
LEGS = [HUMANML3D.index(f"{side}_{joint}") for side in "LR" for joint in ("ankle", "foot")]
TOES = [10, 11]
SHOULDERS, WRISTS = [16, 17], [20, 21]


drawn = partial(drawn_on, BEFORE)


def hands(joints: np.ndarray) -> np.ndarray:
    """Places (T, 2, 3) of left and right wrist from the middle of the shoulders, of a body that faces +Z."""
    return joints[:, WRISTS] - joints[:, SHOULDERS].mean(1, keepdims=True)


def struck(joints: np.ndarray) -> list[int]:
    """The hand (0 = left) of each blow in its order: one that is far out ahead."""
    out = hands(joints)[..., 2] > 0.34
    begun = [(frame, k) for k in (0, 1) for frame in np.flatnonzero(out[1:, k] & ~out[:-1, k])]
    return [k for _, k in sorted(begun)]


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_punches_are_as_many_as_asked_for(count: int) -> None:
    joints = drawn("punch", "throws punches", count=count)
    assert len(REPETITIONS["punch"](Motion(joints, FPS))) == count
    assert struck(joints) == [k % 2 for k in range(count)]


@pytest.mark.parametrize("kind", ["punches", "jab", "cross", "hook", "uppercut"])
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_hand_that_is_named_strikes_and_the_other_guards(kind: str, side: str) -> None:
    joints = drawn("punch", f"throws a {side} {kind}", side=side)
    motion = Motion(joints, FPS)
    assert RULES["punch"](motion, side) >= 0.5
    assert RULES["punch"](motion, "left" if side == "right" else "right") < 0.5
    guard = hands(joints)[:, 1 if side == "left" else 0]
    assert guard[:, 1].min() > -0.2
    assert guard[:, 2].max() < 0.38


def test_a_row_is_in_the_order_of_the_prompt() -> None:
    assert struck(drawn("punch", "throws a jab, a cross and a left hook")) == [0, 1, 0]
    assert struck(drawn("punch", "a right hook, then a hook")) == [1, 0]
    assert struck(drawn("punch", "throws a single punch")) == [0]
    assert struck(drawn("punch", "boxing: jab, jab, cross", count=2)) == [0, 0, 1]
    assert struck(drawn("punch", "left, right, left")) == [0, 1, 0]
    assert struck(drawn("punch", "right hook")) == [1]
    assert len(struck(drawn("punch", "punches the bag"))) >= 4


def test_a_hook_swings_across_and_an_uppercut_comes_from_below() -> None:
    hook = hands(drawn("punch", "a right hook", side="right"))[:, 1]
    assert np.ptp(hook[:, 0]) > 0.5
    assert hook[:, 1].max() > 0.12, "at the height of the head"
    elbow = drawn("punch", "a right hook", side="right")[:, [17, 19, 21]]
    bent = np.linalg.norm(elbow[:, 2] - elbow[:, 0], axis=-1)
    assert bent[hook[:, 1] > 0.12].max() < 0.49, "the arm stays bent"
    uppercut = hands(drawn("punch", "a right uppercut", side="right"))[:, 1]
    assert uppercut[:, 1].min() < -0.2
    assert uppercut[:, 1].max() > 0.05


@pytest.mark.parametrize("side", ["left", "right"])
def test_blows_go_ways_of_their_own(side: str) -> None:
    outward = -1.0 if side == "right" else 1.0

    def way(kind: str) -> np.ndarray:
        return hands(drawn("punch", f"a {side} {kind}", side=side))[:, int(side == "right")] * [outward, 1.0, 1.0]

    overhand, hammer, backfist, haymaker, hook = map(way, ("overhand", "hammer fist", "backfist", "haymaker", "hook"))
    assert overhand[: overhand[:, 2].argmax(), 1].max() > 0.22, "over the shoulder, then down"
    assert hammer[: hammer[:, 2].argmax(), 1].max() > 0.32, "from over the head"
    assert hammer[hammer[:, 2].argmax() :, 1].min() < 0.0
    first = int(backfist[:, 0].argmin())
    assert backfist[first, 0] < -0.05, "from the other shoulder"
    assert backfist[first:, 0].max() > backfist[first, 0] + 0.25
    assert haymaker[:, 0].max() > hook[:, 0].max() + 0.04, "wider than a hook"


@pytest.mark.parametrize(
    "prompt",
    [
        *("{} uppercut", "uppercut, {}, heavy", "quick {} uppercut", "{} hook", "{} hand jab", "an overhand {}"),
        *("a wild {} haymaker", "{} backfist", "a {} hammer fist", "{} palm strike", "a straight {}"),
    ],
)
@pytest.mark.parametrize("side", ["left", "right"])
def test_the_referee_passes_blows_of_either_hand(prompt: str, side: str) -> None:
    blows = [drawn("punch", prompt.format(side), side=side, seed=seed) for seed in range(4)]
    assert all(shows("punch", Measured(each, FPS).on_own_floor()) for each in blows)
    assert all(shows("punch", Measured(LAYOUT.mirror_joints(each), FPS).on_own_floor()) for each in blows)


def test_the_feet_of_a_body_that_punches_on_and_on_stay() -> None:
    made = drawn("punch")
    assert np.abs(made - made[0])[:, LEGS].max() < 0.01
    assert abs(len(made) - len(BEFORE)) <= 1


@pytest.mark.parametrize("seed", range(3))
def test_a_stated_row_is_punched_from_a_stance_and_ends_soon(seed: int) -> None:
    turning = drawn_on(BEFORE, "punch", "boxing combo: left jab, right cross, left hook", seed=seed)
    assert np.abs(turning - turning[0])[:, TOES].max() < 0.01, "feet pivot on their toes"
    assert turning[0, LEGS[0], 2] - turning[0, LEGS[2], 2] > 0.12, "the left foot is ahead"
    last = np.flatnonzero(hands(turning)[..., 2].max(axis=1) > 0.34)[-1]
    assert 0.5 < (len(turning) - last) / FPS < 1.6
    fixed = drawn_features(LAYOUT.encode(BEFORE), LAYOUT, "punch", FineWish(None, "", "a jab and a cross", True), seed)
    assert fixed is not None
    assert len(fixed) == len(LAYOUT.encode(BEFORE))


@pytest.mark.parametrize(("prompt", "foot", "hand"), [("a left hook", 7, 20), ("a hard right hook", 8, 21)])
def test_hips_and_heel_turn_into_a_hook(prompt: str, foot: int, hand: int) -> None:
    hooked = drawn_on(BEFORE, "punch", prompt, seed=2)
    across = hooked[:, 1] - hooked[:, 2]
    assert np.ptp(np.degrees(np.arctan2(-across[:, 2], across[:, 0]))) > 20
    assert np.ptp(hooked[:, foot, 1]) > 0.02
    assert np.linalg.norm(np.diff(hooked[:, hand], axis=0), axis=-1).max() * FPS > 5.2
    jabbed = drawn_on(BEFORE, "punch", "a jab and a cross", seed=2)
    assert np.abs(jabbed - jabbed[0])[:, LEGS].max() < 0.01


def test_feet_that_are_to_move_are_those_of_the_network() -> None:
    made = drawn("punch", "steps forward with a jab and a cross")
    assert np.abs(made - BEFORE[: len(made)])[:, LEGS].max() < 0.03


def test_there_is_no_punch_without_time_for_it() -> None:
    short = LAYOUT.encode(Body(1.3).joints())
    assert drawn_features(short, LAYOUT, "punch", FineWish(None, "", "an uppercut", fixed=True), 1) is None
