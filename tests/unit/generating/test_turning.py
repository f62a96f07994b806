"""Turns on the spot and spins, drawn as far, to the side, as often and at the pace that their prompts name."""

from __future__ import annotations

import numpy as np
import pytest

from marey.generation.fine_wish import FineWish
from marey.generation.stated import stated_features
from marey.motion.features import HUMANML3D_263
from marey.selector.motion import Motion
from marey.selector.rules import RULES

LAYOUT = HUMANML3D_263
FPS = LAYOUT.fps
ANKLES, TOES = [7, 8], [10, 11]
SEEDS = range(4)


def features_of(action: str, prompt: str, *, seed: int = 1, **more: object) -> np.ndarray | None:
    return stated_features(LAYOUT, action, FineWish(prompt=prompt, **more), None, seed)  # type: ignore[arg-type]


def drawn(action: str, prompt: str, *, seed: int = 1, **more: object) -> np.ndarray:
    features = features_of(action, prompt, seed=seed, **more)
    assert features is not None
    return LAYOUT.decode(features).astype(np.float64)


def headings(joints: np.ndarray) -> np.ndarray:
    """Degrees (T,) that the hips have turned to the left."""
    across = joints[:, 1] - joints[:, 2]
    turned = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
    return turned - turned[0]


def on_floor(joints: np.ndarray) -> np.ndarray:
    """Feet (T, 2) that are on the floor, left and right."""
    return joints[:, TOES, 1] < joints[:, TOES, 1].min() + 0.01


@pytest.mark.parametrize(
    ("action", "prompt", "degrees"),
    [
        ("turn-around", "turn in place 90 left", 90),
        ("turn-around", "she pivots 45 degrees to her right", -45),
        ("turn-around", "a quarter turn to the right, standing", -90),
        ("turn-around", "rotates 270 degrees counterclockwise", 270),
        ("turn-around", "does a half turn clockwise", -180),
        ("turn-around", "turns slightly to the left", 60),
        ("turn-around", "turns around to the left", 180),
        ("turn", "turns left", 90),
        ("turn", "a woman makes a sharp right turn where she stands", -90),
        ("spin", "makes three quarters of a turn to the left", 270),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_turn_is_as_far_as_the_words_say(action: str, prompt: str, degrees: float, seed: int) -> None:
    joints = drawn(action, prompt, seed=seed)
    turned = headings(joints)
    assert turned[-1] == pytest.approx(degrees, abs=3)
    assert np.abs(turned).max() < abs(degrees) + 5
    assert np.ptp(joints[:, 0, [0, 2]], axis=0).max() < 0.12, "the hips stay"


@pytest.mark.parametrize("prompt", ["turns around", "an about-face", "turns to face the opposite direction"])
def test_a_turn_around_is_half_a_turn_to_either_side(prompt: str) -> None:
    turned = [headings(drawn("turn-around", prompt, seed=seed))[-1] for seed in range(12)]
    assert np.abs(turned) == pytest.approx(180, abs=3)
    assert min(turned) < 0 < max(turned)


@pytest.mark.parametrize("prompt", ["turns around", "turns left", "turns right slowly", "quickly turns around"])
@pytest.mark.parametrize("seed", SEEDS)
def test_feet_stand_between_their_steps(prompt: str, seed: int) -> None:
    joints = drawn("turn-around", prompt, seed=seed)
    stands = on_floor(joints)
    both = stands[1:] & stands[:-1]
    slides = np.linalg.norm(np.diff(joints[:, TOES][..., [0, 2]], axis=0), axis=-1)
    assert np.where(both, slides, 0.0).max() < 0.012
    assert stands.any(axis=1).all(), "nobody floats"
    assert stands[-6:].all(), "both feet stand at the end"
    shoulders = joints[:, 16] - joints[:, 17]
    ahead = np.degrees(np.unwrap(np.arctan2(-shoulders[:, 2], shoulders[:, 0])))
    twist = np.sign(headings(joints)[-1]) * (ahead - ahead[0] - headings(joints))
    assert twist.max() > 8, "the shoulders lead"


def test_turns_take_as_long_as_their_words_say() -> None:
    def seconds(prompt: str) -> float:
        turned = np.abs(headings(drawn("turn-around", prompt)))
        return float((turned > turned[-1] - 3).argmax() - (turned > 3).argmax()) / FPS

    quarter, half = seconds("turns left 90 degrees"), seconds("turns around")
    assert 0.7 < quarter < 1.4
    assert 1.4 < half < 2.2
    assert seconds("slowly turns around") > 1.4 * half
    assert seconds("turns around fast") < 0.75 * half


def test_a_turn_beside_others_is_brief() -> None:
    alone = len(drawn("turn-around", "turns around"))
    beside = drawn("turn-around", "turns around", beside=("walks", "waves"))
    assert len(beside) <= alone - 7
    assert abs(headings(beside)[-1]) == pytest.approx(180, abs=3), "the next movement begins where it ends"
    waits = headings(drawn("turn-around", "a man stands still, then turns around"))
    assert (np.abs(waits) > 5).argmax() >= 0.9 * FPS


@pytest.mark.parametrize(
    ("action", "prompt"),
    [
        ("turn", "walks and turns a corner"),
        ("turn", "a man turns right while walking"),
        ("turn", "jogs in a circle"),
        ("turn", "he veers left"),
        ("turn", "comes down the street and rounds the corner"),
        ("turn-around", "turns around while he is walking"),
    ],
)
def test_turns_of_ways_are_left_to_networks(action: str, prompt: str) -> None:
    assert features_of(action, prompt) is None


def test_a_turn_behind_a_way_goes_on_from_it() -> None:
    assert features_of("turn", "turns left", beside=("walks forward", "")) is not None
    assert features_of("turn", "walks and turns left") is None
    assert features_of("turn", "turns left", beside=("sits down", "")) is not None
    assert features_of("turn", "turns left on the spot", beside=("kneels", "walks away")) is not None


@pytest.mark.parametrize(
    ("prompt", "count", "turns"),
    [
        ("a person spins once", 1, 1),
        ("she twirls", None, 1),
        ("turns on his heel and spins around", None, 1),
        ("spins twice clockwise", 2, -2),
        ("spins 1080 degrees to the left", None, 3),
        ("one full pirouette", 1, 1),
        ("a ballerina does four pirouettes", 4, 4),
        ("a skater spins eight times", 8, 8),
    ],
)
@pytest.mark.parametrize("seed", SEEDS)
def test_spins_are_as_many_as_asked_for(prompt: str, count: int | None, turns: int, seed: int) -> None:
    joints = drawn("spin", prompt, count=count, seed=seed)
    turned = headings(joints)
    assert abs(turned[-1]) == pytest.approx(360 * abs(turns), abs=4)
    assert turns > 0 or turned[-1] < 0, "clockwise is to the right"
    assert RULES["spin"](Motion(joints, FPS), "") >= 0.5
    assert len(joints) <= 9.8 * FPS


def test_who_spins_on_and_on_does_so_more_than_once() -> None:
    for seed in SEEDS:
        assert abs(headings(drawn("spin", "spins round and round", seed=seed))[-1]) > 700
        beside = drawn("spin", "spins round and round", seed=seed, beside=("", "bows"))
        assert abs(headings(beside)[-1]) < 370


@pytest.mark.parametrize("prompt", ["a pirouette", "spins on one foot", "a figure skater spins to the right"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_pirouette_is_on_the_ball_of_one_foot(prompt: str, seed: int) -> None:
    joints = drawn("spin", prompt, seed=seed)
    turned = headings(joints)
    fast = np.abs(np.gradient(turned)) * FPS > 150
    foot = 0 if turned[-1] > 0 else 1
    assert (joints[fast, TOES[1 - foot], 1] > 0.1).all()
    stood = joints[fast, TOES[foot]]
    assert np.ptp(stood, axis=0).max() < 0.03, "the ball of the foot stays"
    assert (joints[fast, ANKLES[foot], 1] > joints[0, ANKLES[foot], 1] + 0.02).mean() > 0.9


@pytest.mark.parametrize("after", ["runs", "sprints away", "dashes off"])
def test_a_turn_before_a_run_is_quick(after: str) -> None:
    quick, usual = (len(drawn("turn-around", "turns around", beside=("", each))) for each in (after, "walks"))
    assert quick <= usual - 5


@pytest.mark.parametrize(
    ("prompt", "foot", "turn"),
    [
        ("pirouettes on her left leg, clockwise", 0, -360),
        ("a pirouette on the right foot, counterclockwise", 1, 360),
        ("spins once to the right on the ball of his left foot", 0, -360),
        ("spins on his right heel", 1, -360),
        ("pirouette clockwise", 1, -360),
    ],
)
def test_the_foot_of_a_pirouette_is_not_the_side_of_its_turn(prompt: str, foot: int, turn: float) -> None:
    joints = drawn("spin", prompt)
    assert on_floor(joints)[:, foot].all()
    assert not on_floor(joints)[:, 1 - foot].all()
    assert headings(joints)[-1] == pytest.approx(turn, abs=15)
