"""Falls, rolls, flips, crawls and ways to the floor and back, drawn as their prompt asks."""

from __future__ import annotations

import random
from functools import partial

import numpy as np
import pytest

from marey.generation.fine import FINE, drawn_features
from marey.generation.fine_wish import FineWish
from marey.generation.whole_body import CHOICES, QUICKER, half_turns, is_drawn, lies_and_rolls
from marey.motion.features import HUMANML3D_263
from marey.posing.still import standing_still
from marey.quality.measure import range_degrees
from marey.selector.motion import Motion
from marey.selector.rules import RULES
from tests.support.bodies import Body, steady
from tests.support.drawn_motions import drawn_on

FPS = HUMANML3D_263.fps
STANDS = Body(5.0).joints()
PELVIS, HEAD, CHEST, HIPS, NECK = 0, 15, 9, [1, 2], 12
FEET = [7, 8, 10, 11]
SEEDS = range(6)
SAID = {"climb-onto": "vaults over a wall"}
"""Words of actions that are drawn for these alone."""

drawn = partial(drawn_on, STANDS)


def front_of(joints: np.ndarray) -> np.ndarray:
    """Unit vectors (T, 3) that the chest faces."""
    across, up = joints[:, 16] - joints[:, 17], joints[:, NECK] - joints[:, PELVIS]
    front = np.cross(across, up)
    return front / np.linalg.norm(front, axis=-1, keepdims=True)


@pytest.mark.parametrize("action", CHOICES)
@pytest.mark.parametrize("seed", SEEDS)
def test_each_shows_its_action_on_the_floor_without_breaks(action: str, seed: int) -> None:
    joints = drawn(action, SAID.get(action, ""), seed=seed)
    assert RULES[action](Motion(joints, FPS), "") >= 0.5
    assert joints[..., 1].min() > -0.03
    assert np.linalg.norm(np.diff(joints, axis=0), axis=-1).max() < (
        0.75 if action in ("flip", "cartwheel", "leap") else 0.5
    ), "no joint leaps"
    assert len(joints) > 2 * FPS


@pytest.mark.parametrize(
    ("prompt", "faces"),
    [
        ("a man slips on ice and falls", 1),
        ("falls backward", 1),
        ("she trips and falls forward", -1),
        ("dies, falling face down", -1),
        ("drops to his knees and falls dead", -1),
        ("death from the front", 1),
        ("shot from behind", -1),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_fall_ends_as_its_words_say_and_stays(prompt: str, faces: int, seed: int) -> None:
    joints = drawn("die", prompt, seed=seed)
    front = front_of(joints)[-1, 1]
    assert front * faces > 0.6
    late = joints[-round(0.3 * FPS) :]
    assert np.abs(late - late[-1]).max() < 0.05
    assert late[:, [PELVIS, CHEST, HEAD], 1].max() < 0.35


@pytest.mark.parametrize("prompt", ["a cook slips on some grease", "slips in the mud and lands on her bottom"])
@pytest.mark.parametrize("seed", SEEDS)
def test_feet_that_slip_shoot_away_ahead_before_the_body_falls_on_its_back(prompt: str, seed: int) -> None:
    joints = drawn("die", prompt, seed=seed)
    assert front_of(joints)[-1, 1] > 0.6
    lands = int((joints[:, PELVIS, 1] < 0.3).argmax())
    front = front_of(joints)[0]
    ahead = (joints[:, [7, 8]] - joints[:, [PELVIS]]) @ front
    assert ahead[:lands].max(0).min() > 0.35
    assert np.abs(joints[: round(0.4 * FPS), :, 1] - joints[0, :, 1]).max() < 0.1, "it stands first"


def test_a_fall_over_the_knees_kneels_first() -> None:
    for seed in SEEDS:
        joints = drawn("die", "falls to his knees and dies", seed=seed)
        kneels = (joints[:, [4, 5], 1].max(axis=1) < 0.2) & (joints[:, NECK, 1] > 0.75)
        assert kneels.sum() >= 4


@pytest.mark.parametrize(
    ("prompt", "way"), [("falls to the left", 1), ("falls over to the right side", -1), ("death from the left", -1)]
)
def test_a_fall_goes_to_the_side_that_is_named(prompt: str, way: int) -> None:
    for seed in SEEDS:
        joints = drawn("die", prompt, seed=seed)
        assert way * (joints[-1, PELVIS, 0] - joints[0, PELVIS, 0]) > 0.3


def test_the_wounded_are_hit_before_they_fall() -> None:
    def hand_at_trunk(prompt: str, seed: int) -> float:
        joints = drawn("die", prompt, seed=seed)
        upright = joints[:, NECK, 1] > 1.2
        return float(np.linalg.norm(joints[:, [20, 21]] - joints[:, [CHEST]], axis=-1).min(1)[upright].min())

    shot = [hand_at_trunk("is shot and falls backward", seed) for seed in SEEDS]
    faint = [hand_at_trunk("faints and falls backward", seed) for seed in SEEDS]
    assert np.median(shot) < np.median(faint) - 0.1


@pytest.mark.parametrize(
    ("prompt", "forward"),
    [("a forward roll", 1), ("rolls backwards", -1), ("rolls over his left shoulder", 1), ("a dive roll", 1)],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_roll_goes_where_its_words_say_and_ends_on_the_feet(prompt: str, forward: int, seed: int) -> None:
    joints = drawn("roll", prompt, seed=seed)
    assert forward * (joints[-1, PELVIS, 2] - joints[0, PELVIS, 2]) > 1.0
    assert joints[-1, HEAD, 1] > 1.3
    assert joints[:, HEAD, 1].min() < 0.35


@pytest.mark.parametrize(
    ("prompt", "way"),
    [
        ("rolls to the left", 1),
        ("a sideways roll to the right", -1),
        ("dodge roll to the left", 1),
        ("combat roll, right", -1),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_roll_goes_to_the_side_that_is_named(prompt: str, way: int, seed: int) -> None:
    joints = drawn("roll", prompt, seed=seed)
    assert way * (joints[-1, PELVIS, 0] - joints[0, PELVIS, 0]) > 0.8


def test_a_roll_that_ends_low_stays_low() -> None:
    assert drawn("roll", "rolls into a crouch")[-1, PELVIS, 1] < 0.7


@pytest.mark.parametrize(("prompt", "way"), [("a cartwheel to the left", 1), ("cartwheel, right hand first", -1)])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_cartwheel_goes_to_the_side_that_is_named_over_one_straight_limb_after_another(
    prompt: str, way: int, seed: int
) -> None:
    joints = drawn("cartwheel", prompt, seed=seed)
    moved = joints[-1, PELVIS] - joints[0, PELVIS]
    assert way * moved[0] > 1.5
    assert abs(moved[2]) < 0.15
    wrists, ankles = ((20, 21), (7, 8)) if way > 0 else ((21, 20), (8, 7))
    down = [np.flatnonzero(joints[:, wrist, 1] < 0.1)[[0, -1]] for wrist in wrists]
    assert down[0][0] < down[1][0] < down[0][1] < down[1][1]
    top = [int(joints[:, ankle, 1].argmax()) for ankle in ankles]
    assert top[1] < top[0]  # the other leg goes over first
    over = joints[:, PELVIS, 1] > joints[:, HEAD, 1] + 0.3
    legs = np.linalg.norm(joints[:, [7, 8]] - joints[:, [1, 2]], axis=-1)[over]
    assert np.median(legs, axis=0).min() > 0.77
    assert range_degrees(joints) < 15  # no knee bends backward
    assert front_of(joints)[-1, 2] > 0.9
    assert joints[-1, HEAD, 1] > 1.3


def test_cartwheels_are_as_many_as_asked_for() -> None:
    for count in (1, 2, 3):
        joints = drawn("cartwheel", "does cartwheels", count=count)
        over = joints[:, PELVIS, 1] > joints[:, HEAD, 1] + 0.2
        assert (np.diff(over.astype(int)) == 1).sum() == count


@pytest.mark.parametrize("prompt", ["leaps over a puddle", "a ballerina does a grand jete", "leaps far"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_leap_goes_off_one_foot_in_a_split_and_onto_the_other_one(prompt: str, seed: int) -> None:
    joints = drawn("leap", prompt, seed=seed)
    high = int(joints[:, PELVIS, 1].argmax())
    low = joints[:, [10, 11], 1] < 0.04
    before, after = (np.flatnonzero(low[:high].any(1))[-1], high + int(low[high:].any(1).argmax()))
    assert low[before].sum() == 1 == low[after].sum()
    off, onto = 10 + int(low[before].argmax()), 10 + int(low[after].argmax())
    assert off != onto
    assert 1.3 < np.linalg.norm((joints[after, onto] - joints[before, off])[[0, 2]]) < 2.5
    apart = np.linalg.norm(joints[high, 7] - joints[high, 8])
    assert apart > (1.3 if "jete" in prompt else 1.0)
    level = np.abs(joints[high, [20, 21], 1] - joints[high, [16, 17], 1]).max()
    assert (level < 0.16) == ("ballerina" in prompt)
    assert joints[-1, PELVIS, 1] > 0.9


def test_a_leap_out_of_a_run_is_left_to_networks() -> None:
    draws = is_drawn("leap")
    assert draws(FineWish(prompt="leaps over a puddle"))
    assert not draws(FineWish(prompt="runs and leaps over a puddle"))
    assert not draws(FineWish(prompt="leaps over a puddle", beside=("runs", "")))


@pytest.mark.parametrize(("prompt", "forward"), [("a front flip", 1), ("a backflip", -1), ("flips backwards", -1)])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_flip_turns_over_in_the_direction_that_is_named(prompt: str, forward: int, seed: int) -> None:
    joints = drawn("flip", prompt, seed=seed)
    trunk = joints[:, NECK] - joints[:, PELVIS]
    angle = np.unwrap(np.arctan2(trunk[:, 2], trunk[:, 1]))
    assert np.degrees(forward * (angle[-1] - angle[0])) == pytest.approx(360, abs=30)
    assert joints[:, [7, 8, 10, 11], 1].min(axis=1).max() > 0.3


@pytest.mark.parametrize("count", [1, 2, 3])
def test_flips_are_as_many_as_asked_for(count: int) -> None:
    joints = drawn("flip", "backflips", count=count)
    trunk = joints[:, NECK] - joints[:, PELVIS]
    angle = np.unwrap(np.arctan2(trunk[:, 2], trunk[:, 1]))
    assert abs(np.degrees(angle[-1] - angle[0])) == pytest.approx(360 * count, abs=30)


@pytest.mark.parametrize(("prompt", "forward"), [("crawls forward", 1), ("crawls backward", -1)])
def test_a_crawl_travels(prompt: str, forward: int) -> None:
    for seed in SEEDS:
        joints = drawn("crawl", prompt, seed=seed)
        assert forward * (joints[-1, PELVIS, 2] - joints[0, PELVIS, 2]) > 0.4
        assert joints[:, HEAD, 1].max() < 0.8


@pytest.mark.parametrize(
    ("prompt", "forward"),
    [
        ("prone crawl under barbed wire", 1),
        ("army crawl forward", 1),
        ("commando crawl", 1),
        ("a soldier crawls along on his elbows", 1),
        ("belly crawl backwards", -1),
    ],
)
@pytest.mark.parametrize("seed", SEEDS[:3])
def test_a_crawl_on_the_belly_stays_on_the_floor_and_travels(prompt: str, forward: int, seed: int) -> None:
    joints = drawn("crawl", prompt, seed=seed)
    assert forward * (joints[-1, PELVIS, 2] - joints[0, PELVIS, 2]) > 0.5
    assert joints[:, PELVIS, 1].max() < 0.2
    assert joints[:, CHEST, 1].max() < 0.3
    assert joints[:, FEET, 1].max() < 0.12, "feet drag"
    for limbs in ([4, 5], [20, 21]):
        ahead = joints[:, limbs, 2] - joints[:, [PELVIS], 2]
        assert np.ptp(ahead, axis=0).min() > 0.12
        assert np.corrcoef(ahead.T)[0, 1] < -0.5, "left and right by turns"


def test_a_crawl_on_hands_and_knees_stays_one() -> None:
    for prompt in ("crawls forward", "a soldier crawls on his hands and knees"):
        assert np.median(drawn("crawl", prompt)[:, PELVIS, 1]) > 0.4


@pytest.mark.parametrize(("prompt", "faces"), [("lies down", 1), ("lies down on his stomach", -1)])
def test_who_lies_down_lies_as_the_words_say(prompt: str, faces: int) -> None:
    for action in ("lie-down", "lie"):
        assert faces * front_of(drawn(action, prompt))[-1, 1] > 0.8


@pytest.mark.parametrize(
    ("before", "prompt", "faces"),
    [
        ("", "gets up", 1),
        ("trips and falls forward", "gets up", -1),
        ("slips and falls on his back", "gets up", 1),
        ("lies face down", "stands up", -1),
        ("", "gets up from his stomach", -1),
        ("crawls forward", "stands up", -1),
        ("army crawl", "stands up", -1),
    ],
)
def test_who_gets_up_begins_as_the_movement_before_ends(before: str, prompt: str, faces: int) -> None:
    wish = FineWish(prompt=prompt, beside=(before, ""))
    features = drawn_features(HUMANML3D_263.encode(STANDS), HUMANML3D_263, "get-up", wish, 3)
    assert features is not None
    joints = HUMANML3D_263.decode(features).astype(np.float64)
    assert faces * front_of(joints)[0, 1] > 0.6
    assert joints[-1, HEAD, 1] > 1.4
    assert (joints[0, PELVIS, 1] > 0.35) == (before == "crawls forward")


def test_who_falls_and_then_rises_falls_so_that_it_can_be_gone_on_from() -> None:
    for seed in SEEDS:
        wish = FineWish(prompt="falls down", beside=("", "gets up again"))
        features = drawn_features(HUMANML3D_263.encode(STANDS), HUMANML3D_263, "die", wish, seed)
        assert features is not None
        assert front_of(HUMANML3D_263.decode(features).astype(np.float64))[-1, 1] > 0.6


@pytest.mark.parametrize("action", CHOICES)
@pytest.mark.parametrize("frames", [70, 120, 190])
def test_a_length_that_is_fixed_is_kept(action: str, frames: int) -> None:
    still = standing_still(frames + 1, random.Random(0))
    wish = FineWish(prompt=SAID.get(action, ""), fixed=True)
    features = drawn_features(HUMANML3D_263.encode(still), HUMANML3D_263, action, wish, 1)
    if features is not None:
        assert len(features) == frames
    else:
        assert frames < 120, "there is time for each in six seconds"


def test_what_does_not_fit_is_not_drawn() -> None:
    still = standing_still(24, random.Random(0))
    features = HUMANML3D_263.encode(still)
    assert drawn_features(features, HUMANML3D_263, "get-up", FineWish(fixed=True), 1) is None
    assert 0.5 < QUICKER < 1.0


@pytest.mark.parametrize(
    ("action", "prompt"), [("roll", "rolls over in his sleep"), ("lie", "lies on his side"), ("lie-down", "curls up")]
)
def test_kinds_that_are_not_drawn_stay_as_the_network_makes_them(action: str, prompt: str) -> None:
    wish = FineWish(prompt=prompt)
    assert FINE[action].draw(STANDS, FPS, wish, np.random.default_rng(0)) is None


def test_motions_differ_from_seed_to_seed_and_are_the_same_for_one() -> None:
    first, again, other = (drawn("die", "dies", seed=seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert first.shape != other.shape or np.abs(first - other).max() > 0.1


@pytest.mark.parametrize(
    ("prompt", "degrees"),
    [("a 180 degree jump to the left", 180), ("jumps and turns 360 degrees to the right", -360), ("jump turn", None)],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_jump_turns_in_the_air_as_far_as_it_says(prompt: str, degrees: int | None, seed: int) -> None:
    joints = drawn("jump-turn", prompt, seed=seed)
    across = joints[:, 1] - joints[:, 2]
    yaw = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    turned = yaw[-1] - yaw[0]
    assert turned == pytest.approx(degrees, abs=8) if degrees else abs(turned) > 90
    lowest = joints[:, [7, 8, 10, 11], 1].min(axis=1)
    flies = lowest > 0.05
    assert abs(yaw[flies][-1] - yaw[flies][0]) > 0.5 * abs(turned)
    still = joints[-5:, [7, 8, 10, 11]]
    assert np.abs(still - still[-1]).max() < 0.01


def test_a_leap_between_runs_is_drawn_where_a_network_stops() -> None:
    wish = FineWish(prompt="leaps over a puddle", beside=("runs", "runs on"))
    leaps, stands = FINE["leap"], Body(4.0).joints()
    runs = Body(4.0, speed=steady(3.0)).joints()
    assert leaps.is_well(runs, 20.0, wish)
    assert not leaps.is_well(stands, 20.0, wish)
    made = leaps.draw(stands, 20.0, wish, np.random.default_rng(1))
    assert made is not None
    assert made[-1, 0, 2] - made[0, 0, 2] > 2.0


@pytest.mark.parametrize("seed", SEEDS)
def test_a_plain_jump_out_of_a_run_is_no_split(seed: int) -> None:
    joints = drawn("leap", "running jump forward", seed=seed)
    high = int(joints[:, PELVIS, 1].argmax())
    assert np.linalg.norm(joints[high, 7] - joints[high, 8]) < 0.85


@pytest.mark.parametrize(("text", "halves"), [("rolls over on the floor", 1), ("rolls over twice on the grass", 2)])
def test_who_rolls_over_on_the_floor_lies_there(text: str, halves: int) -> None:
    assert (lies_and_rolls(text), half_turns(text)) == (True, halves)
    features = drawn_features(
        HUMANML3D_263.encode(standing_still(80, random.Random(1))), HUMANML3D_263, "roll", FineWish(prompt=text), 1
    )
    assert features is not None
    assert HUMANML3D_263.decode(features)[:, 0, 1].max() < 0.5, "it never stands"


@pytest.mark.parametrize("text", ["rolls over his shoulder", "does a forward roll", "rolls over to his feet"])
def test_other_rolls_are_those_of_who_stands(text: str) -> None:
    assert not lies_and_rolls(text)
