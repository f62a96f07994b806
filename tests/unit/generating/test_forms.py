"""Forms of drawn movements, by what their prompt says."""

from __future__ import annotations

import random

import numpy as np
import pytest

from marey.drawing.forms import BRIEF_S, StatedForm, misfit
from marey.drawing.gesture import BOTH, Gesture
from marey.drawing.kinds import DRAWINGS
from marey.generation.drawn_whole import drawn_whole
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263

BESIDE = ("walks", "sits down")


def best(action: str, asked: StatedForm) -> list[Gesture]:
    rng = random.Random(1)
    drawn = [DRAWINGS[action](rng) for _ in range(60)]
    return sorted(drawn, key=lambda each: misfit(each, action, asked))[:4]


def test_a_movement_beside_others_is_short_and_done_once() -> None:
    for action in ("bow", "cheer", "aim", "squat"):
        found = best(action, StatedForm("", brief=True))
        assert {each.times for each in found} == {1}
        assert max(each.seconds for each in found) <= BRIEF_S + 0.6


def test_a_number_that_is_asked_for_is_kept() -> None:
    for brief in (False, True):
        assert {each.times for each in best("bow", StatedForm("bows twice", 2, brief=brief))} <= {1, 2}


@pytest.mark.parametrize(
    ("text", "side", "acts"),
    [("raises both hands", "", BOTH), ("raises his right arm", "right", "right"), ("raises one hand", "left", "left")],
)
def test_the_arms_that_are_named_act(text: str, side: str, acts: str) -> None:
    found = [each for each in best("raise-arm", StatedForm(text, side=side)) if not side or each.side in (side, BOTH)]
    assert {each.side for each in found} == {acts}


@pytest.mark.parametrize(
    ("action", "text", "kind"),
    [
        ("kick", "a roundhouse kick to the head", "kick-round"),
        ("throw", "throws grenade underarm", "throw-under"),
        ("shoot", "fires twice", "shoot-many"),
        ("sit", "sits on a bench, leans forward with elbows on knees", "sit-lean"),
        ("balance", "holds the tree pose", "balance-tree"),
        ("drink", "bites into an apple", "drink-eat"),
        ("stab", "thrusts the spear", "stab-spear"),
        ("sit-floor", "sits down with crossed legs", "floor-crossed"),
        ("push-ups", "push-ups on the knees", "push-ups-knees"),
    ],
)
def test_a_form_that_is_named_is_drawn(action: str, text: str, kind: str) -> None:
    assert all(kind in each.kinds for each in best(action, StatedForm(text)))


@pytest.mark.parametrize(("action", "kind"), [("push-ups", "push-ups-knees"), ("balance", "balance-plane")])
def test_a_form_that_has_to_be_named_is_not_drawn_otherwise(action: str, kind: str) -> None:
    assert not any(kind in each.kinds for each in best(action, StatedForm("does that")))


def test_nods_and_falls_beside_others_are_shorter() -> None:
    for action in ("nod", "die"):
        alone, beside = (
            sum(
                len(whole.features)
                for seed in range(4)
                if (whole := drawn_whole(HUMANML3D_263, action, FineWish(beside=each), seed, None)) is not None
            )
            for each in (("", ""), BESIDE)
        )
        assert beside < alone


@pytest.mark.parametrize(
    "beside", ["throws a jab", "punches the bag", "blocks the blow", "kicks high", "a boxer waits"]
)
def test_a_guard_is_kept_between_blows(beside: str) -> None:
    assert all(
        "kick-guard" in each.kinds for each in best("kick", StatedForm("a front kick", brief=True, beside=beside))
    )


@pytest.mark.parametrize("beside", ["", "walks ahead", "crosses the street", "opens a box"])
def test_who_does_not_fight_needs_no_guard(beside: str) -> None:
    found = best("kick", StatedForm("a front kick", beside=beside))
    assert not all("kick-guard" in each.kinds for each in found)


@pytest.mark.parametrize("text", ["combat idle, fists up", "stands in guard", "a boxer on guard"])
@pytest.mark.parametrize("seed", range(3))
def test_guards_are_at_the_height_of_the_chin_and_bounce(text: str, seed: int) -> None:
    drawn = drawn_whole(HUMANML3D_263, "fight-stance", FineWish(prompt=text), seed, None)
    assert drawn is not None
    joints = HUMANML3D_263.decode(drawn.features)
    middle = slice(len(joints) // 2, len(joints) // 2 + 20)
    over = joints[middle, [[20], [21]], 1] - joints[middle, [16, 17], 1].mean(1)
    assert over.mean() > -0.02
    assert np.ptp(joints[middle, 0, 1]) > 0.008


@pytest.mark.parametrize("seed", range(4))
def test_a_deep_bow_is_deep_and_takes_its_time(seed: int) -> None:
    drawn = drawn_whole(HUMANML3D_263, "bow", FineWish(prompt="bows deeply"), seed, None)
    assert drawn is not None
    joints = HUMANML3D_263.decode(drawn.features)
    trunk = joints[:, 12] - joints[:, 0]
    lean = np.degrees(np.arctan2(np.hypot(trunk[:, 0], trunk[:, 2]), trunk[:, 1]))
    assert lean.max() > 56
    assert (lean > 30).sum() > 25  # frames


@pytest.mark.parametrize("text", ["crouches, arms over the head", "crouches and covers his head"])
def test_who_covers_the_head_has_both_hands_over_it(text: str) -> None:
    drawn = drawn_whole(HUMANML3D_263, "crouch", FineWish(prompt=text), 1, None)
    assert drawn is not None
    joints = HUMANML3D_263.decode(drawn.features)
    low = joints[int(joints[:, 0, 1].argmin())]
    assert np.linalg.norm(low[[20, 21]] - low[15], axis=-1).max() < 0.3
