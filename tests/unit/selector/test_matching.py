"""The selector: synthetic motions match their own prompts and no others, in order, wherever the body stands."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.motion.resample import frame_times, interpolate
from marey.quality.record import SHOWN
from marey.selector import RULES, Motion, WantedAction, match, wanted_of
from marey.selector.matching import side_of
from marey.selector.rules import is_shown
from marey.vocabulary.entries import load_vocabulary
from tests.support.bodies import FPS, Array, Body, bower, raiser, runner, steady, walker, waver

SINGLE = {
    "a person walks": walker,
    "he runs forward": runner,
    "she walks backward": lambda: Body(4.0, speed=steady(-0.8)).joints(),
    "someone turns left": lambda: walker(turn=90.0),
    "a man waves with his left hand": lambda: waver("left"),
    "a woman raises both arms": lambda: raiser("both"),
    "a person bows": bower,
    "a person stands still": lambda: Body(4.0).joints(),
    "a person jumps up": lambda: jumper(0.25, 0.0),
    "a person jumps forward": lambda: jumper(0.25, 1.0),
    "a person squats": lambda: lowered([0.92, 0.45, 0.92]),
    "a person crouches": lambda: lowered([0.92, 0.55, 0.55, 0.55, 0.55, 0.92]),
}


def jumper(height: float, distance: float) -> Array:
    joints = Body(3.0).joints()
    phase = np.clip((np.arange(len(joints)) - 25) / 10, 0, 1)
    joints[..., 1] += (4 * height * phase * (1 - phase))[:, None]
    joints[..., 2] += (distance * phase)[:, None]
    return joints


def lowered(heights: list[float]) -> Array:
    """A standing body of which the hips go through these heights, the feet in place."""
    from marey.posing.bones import two_bones
    from tests.support.bodies import LENGTH

    joints = Body(3.0).joints()
    times = np.linspace(0, len(joints) - 1, len(heights))
    drop = joints[:, 0, 1] - np.interp(np.arange(len(joints)), times, heights)
    legs = (1, 2, 4, 5, 7, 8, 10, 11)
    upper = [j for j in range(22) if j not in legs] + [1, 2]
    joints[:, upper, 1] -= drop[:, None]
    forward = np.broadcast_to([0.0, 0.0, 1.0], (len(joints), 3))
    for hip, knee, ankle in ((1, 4, 7), (2, 5, 8)):
        lengths = LENGTH[knee], LENGTH[ankle]
        joints[:, knee], joints[:, ankle] = two_bones(joints[:, hip], joints[:, ankle].copy(), forward, lengths)
    return joints


def matched(joints: Array, prompt: str, fps: float = FPS) -> float:
    steps = wanted_of([prompt])
    assert steps is not None, prompt
    return match(Motion(joints, fps), steps)


def test_an_action_is_shown_by_its_rule_with_the_side_that_is_asked_for() -> None:
    waves, stands = (Motion(each, FPS) for each in (waver("left"), Body(4.0).joints()))
    assert is_shown(waves, "wave")
    assert is_shown(waves, "wave", "left")
    assert not is_shown(waves, "wave", "right")
    assert not is_shown(stands, "wave")
    assert is_shown(stands, "idle")


@pytest.mark.parametrize("prompt", SINGLE)
def test_a_motion_matches_its_own_prompt(prompt: str) -> None:
    assert matched(SINGLE[prompt](), prompt) >= SHOWN


@pytest.mark.parametrize(
    ("prompt", "other"),
    [
        ("a person walks", "he runs forward"),
        ("he runs forward", "a person walks"),
        ("a person walks", "she walks backward"),
        ("someone turns left", "a person walks"),
        ("a person bows", "a person walks"),
        ("a man waves with his left hand", "a woman raises both arms"),
        ("a person stands still", "a person bows"),
        ("a person jumps up", "a person stands still"),
        ("a person jumps forward", "a person jumps up"),
        ("a person squats", "a person stands still"),
    ],
)
def test_another_motion_does_not_match(prompt: str, other: str) -> None:
    assert matched(SINGLE[other](), prompt) < SHOWN


def test_a_side_counts_where_the_prompt_names_one() -> None:
    left = waver("left")
    assert matched(left, "a person waves") >= SHOWN
    assert matched(left, "a person waves with the right hand") < SHOWN
    assert matched(walker(turn=90.0), "someone turns right") < SHOWN


def in_order(first: Array, then: Array) -> Array:
    """One motion after the other, from where the first one ends."""
    then = then + (first[-1, 0] - then[0, 0]) * [1, 0, 1]
    return np.concatenate([first, then])


def test_actions_count_in_their_order() -> None:
    both = in_order(walker(), waver("left"))
    forward, backward = wanted_of(["a person walks", "he waves"]), wanted_of(["a person waves", "he walks"])
    assert forward is not None
    assert backward is not None
    assert match(Motion(both, FPS), forward) >= SHOWN
    assert match(Motion(both, FPS), backward) < SHOWN
    assert match(Motion(walker(), FPS), forward) < SHOWN


def test_a_step_of_two_actions_is_met_at_once_or_in_order() -> None:
    both = wanted_of(["a person walks and waves"])
    assert both is not None
    assert len(both) == 1
    assert match(Motion(in_order(walker(), waver("left")), FPS), both) >= SHOWN


@pytest.mark.parametrize(
    "prompt",
    ["the dog barks", "a person juggles", "a person knits", "asdf qwer zxcv"],
)
def test_a_prompt_without_rules_has_no_match(prompt: str) -> None:
    assert wanted_of([prompt]) is None
    assert wanted_of(["a person walks", prompt]) is None


def test_what_is_not_done_is_not_asked_for() -> None:
    assert wanted_of(["a person walks without waving"]) == ((WantedAction("walk"),),)
    assert wanted_of(["a person walks", "he does not wave"]) == ((WantedAction("walk"),),)
    assert wanted_of(["he does not wave"]) is None


def test_a_turn_whose_words_speak_of_no_way_may_be_on_the_spot() -> None:
    standing, turned = Body(3.0).joints(), np.radians(np.clip((np.arange(60) - 10) * 4.0, 0.0, 90.0))
    cos, sin, zero = np.cos(turned), np.sin(turned), np.zeros(60)
    rows = np.stack([cos, zero, sin, zero, zero + 1, zero, -sin, zero, cos], axis=-1).reshape(60, 3, 3)
    middle = standing[:1, :1] * [1.0, 0.0, 1.0]
    joints = np.einsum("tij,tkj->tki", rows, standing[:60] - middle) + middle
    for prompt in ("someone turns left", "turns left by 90 degrees", "a woman takes a left turn"):
        assert matched(joints, prompt) >= SHOWN
    for prompt in ("someone turns right", "a person walks and turns left", "turns the corner to the left"):
        assert matched(joints, prompt) < SHOWN
    assert matched(walker(turn=90.0), "someone turns left") >= SHOWN


def test_a_gait_with_a_turn_need_not_go_straight() -> None:
    assert matched(walker(turn=90.0), "a person walks and turns left") >= SHOWN
    assert matched(walker(), "a person walks and turns left") < SHOWN
    assert matched(walker(turn=90.0), "a person walks") < SHOWN


@pytest.mark.parametrize(
    "prompt", ["a person walks in a circle", "she jogs in a full circle", "he circles to the left"]
)
def test_a_circle_goes_all_the_way_round(prompt: str) -> None:
    assert matched(walker(turn=360.0), prompt) >= SHOWN
    assert matched(walker(turn=180.0), prompt) < SHOWN


def test_a_turn_and_half_a_circle_stay_within_their_definition() -> None:
    for prompt in ("a person walks in a half circle", "someone turns left", "she walks in a semicircle"):
        assert matched(walker(turn=180.0), prompt) >= SHOWN
        assert matched(walker(turn=360.0), prompt) < SHOWN
    assert matched(walker(turn=360.0), "a person walks in a circle to the right") < SHOWN


def test_words_of_other_meanings_beside_an_action_do_not_count() -> None:
    assert wanted_of(["a man is running to catch the bus"]) == ((WantedAction("run"),),)


def test_an_action_that_another_one_implies_is_not_asked_for_twice() -> None:
    assert wanted_of(["a man walks and carries a box"]) == ((WantedAction("carry"),),)


def test_a_side_is_read_only_for_actions_that_have_one() -> None:
    assert wanted_of(["she waves with her right hand"]) == ((WantedAction("wave", "right"),),)
    assert wanted_of(["a person squats on the left"]) == ((WantedAction("squat"),),)


def test_every_rule_is_of_an_action_and_gives_a_grade() -> None:
    assert set(RULES) == set(load_vocabulary().actions)
    for make in SINGLE.values():
        motion = Motion(make(), FPS)
        for name, rule in RULES.items():
            for side in ("", "left", "right", "both"):
                assert 0 <= rule(motion, side) <= 1, name


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(sorted(SINGLE)),
    st.floats(-180, 180),
    st.floats(-5, 5),
    st.floats(0.8, 1.25),
    st.sampled_from([20.0, 30.0, 60.0]),
)
def test_place_heading_size_and_rate_hardly_change_a_match(
    prompt: str, degrees: float, metres: float, size: float, fps: float
) -> None:
    joints = SINGLE[prompt]()
    turned = np.radians(degrees)
    rotation = np.array([[np.cos(turned), 0, np.sin(turned)], [0, 1, 0], [-np.sin(turned), 0, np.cos(turned)]])
    moved = size * (joints @ rotation.T + [metres, 0, -metres])
    moved = np.asarray(interpolate(moved, frame_times(len(moved), FPS, fps)))
    assert matched(moved, prompt, fps) == pytest.approx(matched(joints, prompt), abs=0.35)
    assert matched(moved, prompt, fps) >= SHOWN


@settings(max_examples=20, deadline=None)
@given(st.integers(8, 60), st.integers(0, 2**31))
def test_any_finite_motion_has_a_grade_for_every_rule(frames: int, seed: int) -> None:
    motion = Motion(np.random.default_rng(seed).normal(0.5, 1, (frames, 22, 3)), 20.0)
    assert all(0 <= rule(motion, side) <= 1 for rule in RULES.values() for side in ("", "left", "both"))


def test_other_shapes_and_numbers_are_refused() -> None:
    for bad in (np.zeros((7, 22, 3)), np.zeros((20, 21, 3)), np.full((20, 22, 3), np.nan)):
        with pytest.raises(InvalidInput, match="joints"):
            Motion(bad, 20.0)


def test_a_fall_that_is_told_twice_is_one() -> None:
    falls, jumps = wanted_of(["he slips on ice and dies", "a person falls"]), wanted_of(["he jumps", "he jumps"])
    assert falls is not None
    assert [[each.action for each in step] for step in falls] == [["die"]]
    assert jumps is not None
    assert len(jumps) == 2


def test_the_turn_of_a_jump_is_part_of_it() -> None:
    steps = wanted_of(["a person turns in the air, he jumps", "a person turns 180 degrees"])
    assert steps is not None
    assert [[each.action for each in step] for step in steps] == [["jump-turn"]]
    two = wanted_of(["a person turns around", "he jumps and turns in the air"])
    assert two is not None
    assert len(two) == 2


@pytest.mark.parametrize(
    ("sentence", "side"),
    [
        ("hops on his right foot because the left one hurts", "right"),
        ("hops on the left foot as the right one is hurt", "left"),
        ("hops on the left leg to spare the right", "left"),
        ("hops on the left foot, then on the right", ""),
    ],
)
def test_a_side_in_a_reason_is_not_the_side_of_the_movement(sentence: str, side: str) -> None:
    assert side_of(sentence) == side


@pytest.mark.parametrize(
    ("sentence", "side"),
    [
        ("a person kicks with the right foot while standing on the left", "right"),
        ("a person stands on one leg, a man balances on one leg, left knee raised", "right"),
        ("a person does an arabesque on the right leg, left leg stretched behind", "left"),
    ],
)
def test_the_leg_that_stands_is_not_the_one_that_acts(sentence: str, side: str) -> None:
    steps = wanted_of([sentence])
    assert steps is not None
    assert [each.side for step in steps for each in step] == [side]


@pytest.mark.parametrize(
    ("sentence", "actions"),
    [
        ("a person walks backward six steps", ["walk-backward"]),
        ("a person walks sideways four steps", ["sidestep"]),
        ("a person walks ahead and walks backward six steps", ["walk", "walk-backward"]),
    ],
)
def test_the_steps_of_a_way_back_or_aside_are_no_walk(sentence: str, actions: list[str]) -> None:
    steps = wanted_of([sentence])
    assert steps is not None
    assert [each.action for step in steps for each in step] == actions


def kneeling_bower() -> Array:
    """A body on its knees that bows: its hips are low and stay where they are."""
    joints = bower().copy()
    joints[..., 1] -= 0.42
    return joints


def test_who_kneels_or_sits_bows_too() -> None:
    assert matched(kneeling_bower(), "a person bows") >= SHOWN
    sinking = kneeling_bower()
    sinking[..., 1] += np.interp(np.arange(len(sinking)), [0, 10], [0.42, 0.0])[:, None]
    assert matched(sinking, "a person bows") < SHOWN, "who goes down meanwhile does not"


def test_an_aim_and_the_shot_behind_it_are_part_of_the_draw_of_a_bow() -> None:
    told = wanted_of(("a person draws a bow", "a person aims", "a person shoots an arrow"))
    assert told == wanted_of(("a person draws a bow",))
    again = wanted_of(("a person draws a bow", "a person waves", "a person draws a bow"))
    assert again is not None
    assert len(again) == 3
