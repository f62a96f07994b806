"""Movements whose prompt states their form."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.raising import stated_action
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.selector.motion import Motion
from marey.selector.repetitions import REPETITIONS
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
WRISTS, SHOULDERS = [20, 21], [16, 17]
SEEDS = range(3)


def drawn(
    action: str, prompt: str, *, side: str = "", count: int | None = None, frames: int | None = None, seed: int = 1
) -> np.ndarray:
    wish = FineWish(count, side, prompt, frames is not None)
    features = stated_features(LAYOUT, action, wish, frames or 60, seed)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


def hands(joints: np.ndarray) -> np.ndarray:
    """Places (T, 2, 3) of the left and the right wrist from their shoulders: outward, up, forward."""
    return (joints[:, WRISTS] - joints[:, SHOULDERS]) * np.array([[1, 1, 1], [-1, 1, 1]])


@pytest.mark.parametrize(
    ("prompt", "low", "high"),
    [
        ("raises his right hand to waist height", -0.45, -0.2),
        ("lifts her right arm to chest level", -0.22, -0.06),
        ("raises the right arm to shoulder height", -0.03, 0.14),
        ("holds the right arm level with his shoulder, then lowers it", -0.03, 0.14),
        ("puts the right hand up to head height", 0.1, 0.4),
        ("raise your right hand above your head", 0.42, 0.6),
        ("the right arm goes straight up and is lowered again", 0.42, 0.6),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_hand_goes_to_the_height_that_is_stated_once_and_comes_down(
    prompt: str, low: float, high: float, seed: int
) -> None:
    own, other = np.moveaxis(hands(drawn("raise-arm", prompt, side="right", seed=seed)), 1, 0)[::-1]
    assert low < own[:, 1].max() < high
    assert other[:, 1].max() < -0.4
    assert own[-1, 1] < -0.4
    up = own[:, 1] > 0.5 * (own[:, 1].max() + own[0, 1])
    assert (np.diff(up.astype(int)) == 1).sum() == 1


@pytest.mark.parametrize(
    ("prompt", "axis"),
    [
        ("extends her left arm out to the side", 0),
        ("raises the left arm sideways to shoulder height", 0),
        ("raises the left arm forward", 2),
        ("lifts the left arm in front of him at shoulder level and lowers it to his side", 2),
    ],
)
def test_an_arm_goes_in_the_direction_that_is_stated(prompt: str, axis: int) -> None:
    for seed in SEEDS:
        left = hands(drawn("raise-arm", prompt, side="left", seed=seed))[:, 0]
        top = left[left[:, 1].argmax()]
        assert top[axis] > 0.4
        assert abs(top[2 - axis]) < 0.2


def test_both_arms_go_up_where_both_are_named() -> None:
    both = hands(drawn("raise-arm", "lifts both arms to the sides at shoulder height"))
    assert both[..., 1].max(axis=0).min() > -0.03
    assert both[..., 1].max() < 0.14


@pytest.mark.parametrize("count", [1, 2, 3])
def test_arms_go_up_as_often_as_asked_for(count: int) -> None:
    joints = drawn("raise-arm", "raises the left arm to the side", side="left", count=count)
    assert len(REPETITIONS["raise-arm"](Motion(joints, FPS))) == count


def test_an_arm_that_is_kept_up_stays_up() -> None:
    prompt = "raises the right arm to shoulder height and keeps it there"
    for frames in (None, 120):
        assert hands(drawn("raise-arm", prompt, side="right", frames=frames))[-1, 1, 1] > -0.03
    held = hands(drawn("raise-arm", "raises the right arm overhead, holds it for three seconds, then lowers it"))[:, 1]
    assert 2.8 * FPS < (held[:, 1] > 0.3).sum() < 4.5 * FPS
    assert held[-1, 1] < -0.4


def test_a_raise_without_height_or_direction_is_left_as_it_is() -> None:
    for prompt in ("raises the right arm", "a man raises his hand to the side of his head"):
        assert stated_features(LAYOUT, "raise-arm", FineWish(prompt=prompt), 60, 1) is None
    assert stated_features(LAYOUT, "walk", FineWish(prompt="walks forward"), 60, 1) is None


@pytest.mark.parametrize(
    ("prompt", "named"),
    [
        ("extends her left arm out to the side", "raise-arm"),
        ("right arm stretched forward", "raise-arm"),
        ("stretches out his arm", ""),
        ("walks with one arm stretched forward", ""),
        ("stretches both arms out to the sides", ""),
    ],
    ids=["side", "forward", "no direction", "walk", "bearing"],
)
def test_arms_that_are_stretched_out_are_raised(prompt: str, named: str) -> None:
    assert stated_action(prompt) == named


@pytest.mark.parametrize("count", [1, 2, 3, 5, 8])
@pytest.mark.parametrize("seed", SEEDS)
def test_hands_clap_as_often_as_asked_for_and_rest(count: int, seed: int) -> None:
    joints = drawn("clap", "claps his hands", count=count, seed=seed)
    assert len(REPETITIONS["clap"](Motion(joints, FPS))) == count
    assert joints[-1, WRISTS, 1].max() < joints[-1, 0, 1] + 0.1
    assert stated_features(LAYOUT, "clap", FineWish(prompt="claps"), 60, seed) is None


def test_hands_clap_over_the_head_where_that_is_said() -> None:
    assert hands(drawn("clap", "claps twice above his head", count=2))[..., 1].max() > 0.35
    assert hands(drawn("clap", "claps twice", count=2))[..., 1].max() < 0.05


@pytest.mark.parametrize(
    ("prompt", "steps"),
    [("sidestep right x3", 3), ("takes 5 steps to the right", 5), ("one quick step to the right", 1)],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_steps_aside_are_as_many_as_asked_for(prompt: str, steps: int, seed: int) -> None:
    joints = drawn("sidestep", prompt, side="right", seed=seed)
    moved = np.abs(np.diff(joints[:, [7, 8], 0], axis=0)) * FPS > 0.5
    swings = (np.diff(moved.astype(int), axis=0) == 1).sum(axis=0)
    assert list(swings) == [steps, steps]
    assert 0.25 < (joints[0, 0, 0] - joints[-1, 0, 0]) / steps < 0.7
    assert np.abs(joints[-5:, [7, 8]] - joints[-1, [7, 8]]).max() < 0.01


@pytest.mark.parametrize(
    ("prompt", "least", "most"),
    [
        ("strafe left fast", 1.5, 2.3),
        ("quickly shuffles to the left", 1.5, 2.3),
        ("steps to the left slowly", 0.2, 0.45),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_steps_aside_have_the_pace_that_is_stated(prompt: str, least: float, most: float, seed: int) -> None:
    joints = drawn("sidestep", prompt, side="left", seed=seed)
    speeds = np.diff(joints[:, 0, 0]) * FPS
    assert least < np.median(speeds[speeds > 0.1]) < most
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < 0.35, "no foot leaps"
    assert joints[..., 1].min() > -0.02
    assert len(drawn("sidestep", prompt, side="left", frames=100, seed=seed)) == 100


def test_steps_aside_without_number_or_pace_and_to_both_sides_are_left_as_they_are() -> None:
    for prompt in ("strafes to the left", "quickly shuffles from side to side"):
        assert stated_features(LAYOUT, "sidestep", FineWish(prompt=prompt), 60, 1) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_a_blow_moves_the_part_that_it_strikes(seed: int) -> None:
    stomach = drawn("flinch", "is hit in the stomach", seed=seed)
    trunk = stomach[:, 12] - stomach[:, 0]
    assert np.degrees(np.arctan2(trunk[:, 2], trunk[:, 1])).max() > 35
    for side, sign in (("left", 1.0), ("right", -1.0)):
        across = drawn("flinch", f"gets hit in the {side} shoulder", seed=seed)[:, SHOULDERS]
        back = np.degrees(np.arctan2(-(across[:, 0] - across[:, 1])[:, 2], np.abs((across[:, 0] - across[:, 1])[:, 0])))
        assert (sign * back).max() > 25
    leg = drawn("flinch", "is shot in the left leg", seed=seed)
    assert leg[:, 0, 1].min() < leg[0, 0, 1] - 0.1


def test_a_blow_that_makes_who_is_hit_stagger_has_a_step() -> None:
    for seed in SEEDS:
        heavy = drawn("flinch", "gets hit in the chest and stumbles back", seed=seed)
        assert np.ptp(heavy[:, [7, 8], 2], axis=0).max() > 0.15
        light = drawn("flinch", "gets lightly hit in the chest", seed=seed)
        assert np.ptp(light[:, [7, 8], 2], axis=0).max() < 0.05


def test_a_blow_to_no_part_is_left_as_it_is() -> None:
    assert stated_features(LAYOUT, "flinch", FineWish(prompt="gets hit and steps back"), 60, 1) is None


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_spin_kick_turns_all_the_way_round_and_strikes(side: str) -> None:
    for seed in SEEDS:
        joints = drawn("kick", "spin kick", side=side, seed=seed)
        turned = np.degrees(np.unwrap(np.arctan2(*(joints[:, 1] - joints[:, 2])[:, [2, 0]].T)))
        assert abs(abs(turned[-1] - turned[0]) - 360) < 10
        foot = joints[:, 7 if side == "left" else 8]
        assert foot[:, 1].max() > 0.55
        assert RULES["kick"](Motion(joints, FPS), side) >= 0.5
    assert stated_features(LAYOUT, "kick", FineWish(prompt="a front kick"), 60, 1) is None


def test_both_arms_wave_over_the_head() -> None:
    joints = drawn("wave", "waves both arms overhead")
    up = hands(joints)[..., 1]
    assert (up[len(up) // 3 : -len(up) // 3] > 0.3).all()
    assert np.ptp(hands(joints)[len(up) // 3 : -len(up) // 3, :, 0], axis=0).min() > 0.2
    assert up[-1].max() < -0.4
    for prompt in ("waves the right hand overhead", "waves both hands", "walks and waves both arms overhead"):
        assert stated_features(LAYOUT, "wave", FineWish(prompt=prompt), 60, 1) is None


def test_who_sits_down_cross_legged_stands_at_first_and_crosses_the_legs() -> None:
    for seed in SEEDS:
        joints = drawn("sit-floor", "sit down cross-legged", seed=seed)
        assert joints[0, 0, 1] > 0.8
        assert joints[-1, 0, 1] < 0.3
        assert joints[-1, 7, 0] < joints[-1, 1, 0] - 0.05  # the left foot on the right
        assert joints[-1, 8, 0] > joints[-1, 2, 0] + 0.05
    assert stated_features(LAYOUT, "sit-floor", FineWish(prompt="sits on the floor"), 60, 1) is None


@pytest.mark.parametrize(
    "prompt", ["sits with one leg over the other", "sits on a chair with his legs crossed", "sits crossing her legs"]
)
@pytest.mark.parametrize("action", ["sit", "sit-down"])
def test_one_leg_lies_over_the_other_on_a_seat(prompt: str, action: str) -> None:
    features = stated_features(LAYOUT, action, FineWish(prompt=prompt), 60, 1)
    assert features is not None
    joints = LAYOUT.decode(features).astype(np.float64)
    knees, ankles = joints[-1, [4, 5]], joints[-1, [7, 8]]
    over = int(ankles[:, 1].argmax())
    sign = 1.0 if over == 0 else -1.0
    assert ankles[over, 1] - ankles[1 - over, 1] > 0.15
    assert sign * (ankles[over, 0] - ankles[1 - over, 0]) < -0.05  # on the other side of the leg that stands
    assert knees[over, 1] > knees[1 - over, 1]
    assert (joints[0, 0, 1] > 0.85) == (action == "sit-down")
    assert joints[-1, 0, 1] < 0.62


def test_who_sits_without_such_words_is_left_as_it_is() -> None:
    assert stated_features(LAYOUT, "sit", FineWish(prompt="sits on a chair"), 60, 1) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_a_high_kick_comes_up_to_the_head(seed: int) -> None:
    for side, foot in (("left", 10), ("right", 11)):
        features = stated_features(LAYOUT, "kick", FineWish(side=side, prompt=f"a high kick, {side} leg"), None, seed)
        assert features is not None
        joints = LAYOUT.decode(features)
        assert joints[:, foot, 1].max() > 1.4
        assert joints[:, 21 - foot, 1].max() < 0.2
    for prompt in ("kicks low", "kicks the ball high", "kicks a high ball"):
        assert stated_features(LAYOUT, "kick", FineWish(prompt=prompt), None, seed) is None


@pytest.mark.parametrize("seed", SEEDS)
def test_who_jumps_for_joy_leaves_the_floor_as_often_as_said_with_raised_fists(seed: int) -> None:
    features = stated_features(LAYOUT, "cheer", FineWish(prompt="jumps for joy three times"), None, seed)
    assert features is not None
    joints = LAYOUT.decode(features)
    flies = joints[:, [10, 11], 1].min(axis=1) > 0.04
    assert np.sum(flies[1:] & ~flies[:-1]) == 3
    assert (joints[flies][:, [20, 21], 1].max(axis=0) > joints[flies][:, 15, 1].max() - 0.05).all()
    assert stated_features(LAYOUT, "cheer", FineWish(prompt="cheers with both fists"), None, seed) is None
