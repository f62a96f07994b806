"""The checker on synthetic bodies: what is done passes, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from marey.checks.judge import Expectation, judge, straightness
from marey.checks.rates import ALL_EXPECTATIONS, LabelledClip, name_of, rates
from tests.support.bodies import FPS, Body, bower, lift, raiser, runner, steady, walker, waver

MOTIONS = {
    "walk": walker,
    "run": runner,
    "walk_back": lambda: Body(4.0, speed=steady(-0.8)).joints(),
    "turn left": lambda: walker(5.0, turn=90),
    "turn right": lambda: walker(5.0, turn=-90),
    "wave left": lambda: waver("left"),
    "wave right": lambda: waver("right"),
    "wave both": lambda: waver("both"),
    "raise left": lambda: raiser("left"),
    "raise right": lambda: raiser("right"),
    "raise both": lambda: raiser("both"),
    "bow": bower,
}


def passing(joints) -> set[str]:
    return {name_of([e]) for e in ALL_EXPECTATIONS if judge(joints, FPS, [e]).passed}


@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_passes_its_own_check_and_no_other(name):
    found = passing(MOTIONS[name]())
    assert found == {name}


def test_standing_still_passes_nothing():
    assert passing(Body(4.0).joints()) == set()


@pytest.mark.parametrize("turn", [0.0, 1.0, 2.5])
def test_verdicts_do_not_depend_on_where_the_body_stands_and_faces(turn):
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    for name in ("walk", "turn left", "wave left", "bow"):
        assert name in passing(MOTIONS[name]() @ rotation + [5.0, 0.0, -3.0])


@pytest.mark.parametrize("name", ["turn left", "wave left", "raise right"])
def test_a_mirrored_motion_fails_and_passes_the_other_side(name):
    mirror = [0, 2, 1, 3, 5, 4, 6, 8, 7, 9, 11, 10, 12, 14, 13, 15, 17, 16, 19, 18, 21, 20]
    mirrored = MOTIONS[name]()[:, mirror] * [-1.0, 1.0, 1.0]
    act, side = name.split()
    other = "right" if side == "left" else "left"
    assert judge(mirrored, FPS, [Expectation(act, other)]).passed
    verdict = judge(mirrored, FPS, [Expectation(act, side)])
    assert not verdict.passed
    assert side in verdict.reason


@pytest.mark.parametrize("fps", [20.0, 30.0, 60.0])
def test_the_frame_rate_does_not_matter(fps):
    time = np.arange(0, 3.9, 1 / fps) * FPS
    low = np.floor(time).astype(int)
    for name in ("walk", "run", "wave left", "raise both", "bow"):
        joints = MOTIONS[name]()[: round(3.9 * FPS) + 1]
        at = np.minimum(low, len(joints) - 2)
        mixed = joints[at] + (time - at)[:, None, None] * (joints[at + 1] - joints[at])
        mixed = mixed[time <= len(joints) - 1]
        expected = next(e for e in ALL_EXPECTATIONS if name_of([e]) == name)
        assert judge(mixed, fps, [expected]).passed, name


# -- sequences -------------------------------------------------------------------------------------------------------

WALK, WAVE, BOW = Expectation("walk"), Expectation("wave", "right"), Expectation("bow")


def walk_then_wave():
    return Body(8.0, speed=lambda t: 1.1 * (t < 4), right=lift(4.4, 7.6), wave=2.0).joints()


def test_two_acts_pass_in_their_order_and_fail_in_the_other():
    assert judge(walk_then_wave(), FPS, [WALK, WAVE]).passed
    assert not judge(walk_then_wave(), FPS, [WAVE, WALK]).passed


def test_a_sequence_with_the_wrong_hand_or_without_one_act_fails():
    assert not judge(walk_then_wave(), FPS, [WALK, Expectation("wave", "left")]).passed
    assert not judge(walker(8.0), FPS, [WALK, WAVE]).passed
    assert not judge(waver("right", 8.0), FPS, [WALK, WAVE]).passed


def test_waving_all_along_a_walk_is_no_walk_and_then_a_wave():
    together = Body(8.0, speed=steady(1.1), right=lift(0.0, 8.0), wave=2.0).joints()
    verdict = judge(together, FPS, [WALK, WAVE])
    assert not verdict.passed
    assert "before or together" in verdict.reason


def test_three_acts_pass_in_their_order_alone():
    joints = Body(
        11.0, speed=lambda t: 1.1 * (t < 3.5), right=lift(4.0, 7.0), wave=2.0, lean=lambda t: 45 * lift(7.8, 10.6)(t)
    ).joints()
    assert judge(joints, FPS, [WALK, WAVE, BOW]).passed
    assert not judge(joints, FPS, [BOW, WAVE, WALK]).passed
    assert not judge(joints, FPS, [WALK, BOW, WAVE]).passed


def test_a_clip_too_short_for_its_acts_fails_and_says_so():
    assert "too short" in judge(walker(1.2), FPS, [WALK, WAVE]).reason


# -- straight ways ---------------------------------------------------------------------------------------------------


def test_a_straight_walk_is_straight_and_a_bent_one_is_not():
    assert straightness(walker(6.0), FPS).straight
    bent = straightness(walker(6.0, turn=40), FPS)
    assert not bent.straight
    assert not judge(walker(6.0, turn=40), FPS, [Expectation("walk", straight=True)]).passed
    assert judge(walker(6.0, turn=40), FPS, [Expectation("walk")]).passed


def test_straightness_measures_the_largest_distance_from_the_line():
    joints = np.zeros((101, 22, 3))
    joints[:, :, 2] = np.linspace(0, 4, 101)[:, None]
    joints[:, :, 0] = 0.5 * np.sin(np.pi * np.linspace(0, 1, 101))[:, None]
    way = straightness(joints, FPS)
    assert way.length == pytest.approx(4, rel=0.08)  # smoothed ends
    assert way.deviation == pytest.approx(0.5, rel=0.15)


# -- the checker's own rates -----------------------------------------------------------------------------------------


def test_rates_count_own_passes_wrong_passes_and_reasons():
    clips = [
        LabelledClip("a", ("walk",), ("",), walker),
        LabelledClip("b", ("dash",), ("",), runner),
        LabelledClip("c", ("wave",), ("left",), lambda: waver("left")),
        LabelledClip("d", ("wave",), ("left",), lambda: waver("right")),
        LabelledClip("e", ("walk", "wave"), ("", "right"), walk_then_wave),
        LabelledClip("f", ("guide",), ("left",), lambda: waver("left")),
    ]
    found = rates(clips, FPS)
    assert (found.own["walk"].share, found.own["run"].share, found.own["wave left"].share) == (1.0, 1.0, 0.5)
    assert found.own["walk then wave right"].passed == 1
    assert [name for name, _ in found.failures] == ["d"]
    assert found.wrong_by["guide", "wave left"].share == 1.0
    assert found.wrong["walk"].passed == 0
    assert (found.overall.clips, found.overall.passed) == (5, 4)
