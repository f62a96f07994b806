"""Climbs, hangs and drivers, drawn as their prompt asks: hands that hold stay, and so does the seat."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from marey.generation.fine import drawn_features
from marey.generation.fine_wish import FineWish
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import Body
from tests.support.drawn_motions import drawn_on

FPS = HUMANML3D_263.fps
STANDS = Body(5.0).joints()
PELVIS, CHEST, HEAD = 0, 9, 15
FEET, TOES, SHOULDERS, WRISTS = [7, 8, 10, 11], [10, 11], [16, 17], [20, 21]
SEEDS = range(4)

drawn = partial(drawn_on, STANDS)


def held(joints: np.ndarray, joint: int, metres: float = 0.01) -> list[np.ndarray]:
    """Places (3,) at which a joint stays for a third of a second or more."""
    few = round(FPS / 3)
    places = list[np.ndarray]()
    for begin in range(len(joints) - few):
        within = joints[begin : begin + few, joint]
        if np.ptp(within, axis=0).max() < metres and not (
            places and np.linalg.norm(within.mean(axis=0) - places[-1]) < 0.05
        ):
            places.append(within.mean(axis=0))
    return places


def yaw(joints: np.ndarray) -> np.ndarray:
    across = joints[:, 1] - joints[:, 2]
    return np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))


@pytest.mark.parametrize("seed", SEEDS)
def test_hands_and_feet_go_from_rung_to_rung(seed: int) -> None:
    joints = drawn("climb-ladder", "climbs a ladder", seed=seed)
    on = joints[round(2.0 * FPS) :]
    rungs = np.array([place for wrist in WRISTS for place in held(on, wrist)])
    assert len(rungs) >= 3
    spacing = np.diff(np.unique(np.round(rungs[:, 1], 2)))
    between = spacing[spacing > 0.1]
    assert between.min() > 0.24
    assert np.ptp(rungs[:, 2]) < 0.02, "on one ladder"
    assert rungs[:, 2].min() > on[:, PELVIS, 2].max() + 0.15, "before the body"
    for toe in TOES:
        assert any(place[1] > 0.2 for place in held(joints, toe))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_hips_rise_evenly_and_stay_up(seed: int) -> None:
    height = drawn("climb-ladder", "climbs a ladder", seed=seed)[:, PELVIS, 1]
    assert height[-1] - height[0] > 0.4
    assert np.diff(height).min() > -0.01
    assert height[-1] == pytest.approx(height.max(), abs=0.02)


@pytest.mark.parametrize("prompt", ["climbs down the ladder", "descends a ladder"])
def test_a_climb_down_ends_on_the_floor(prompt: str) -> None:
    for seed in SEEDS:
        joints = drawn("climb-ladder", prompt, seed=seed)
        assert joints[0, FEET, 1].min() > 0.4
        assert joints[-1, FEET, 1].max() < 0.12
        assert joints[-1, WRISTS, 1].max() < joints[-1, CHEST, 1]


def test_rungs_are_as_many_as_asked_for() -> None:
    for seed in SEEDS:
        rises = [
            np.ptp(drawn("climb-ladder", f"climbs {count} rungs of a ladder", seed=seed)[:, PELVIS, 1])
            for count in ("two", "four", "6")
        ]
        assert np.diff(rises) == pytest.approx(2 * 0.285, abs=0.12)
    one_by_one = drawn("climb-ladder", "climbs down a ladder, one rung at a time")
    assert np.ptp(one_by_one[:, PELVIS, 1]) > 0.4


def test_a_rope_is_held_before_the_middle() -> None:
    wide = [
        np.median(np.abs(np.diff(drawn("climb-ladder", prompt)[:, WRISTS, 0], axis=1)))
        for prompt in ("climbs a rope", "climbs a ladder", "climbs a cliff")
    ]
    assert wide[0] < 0.12 < 0.25 < min(wide[1:])


def test_before_another_movement_few_rungs_are_climbed() -> None:
    features = drawn_features(
        HUMANML3D_263.encode(STANDS),
        HUMANML3D_263,
        "climb-ladder",
        FineWish(prompt="climbs a ladder", beside=("", "waves")),
        1,
    )
    assert features is not None
    assert HUMANML3D_263.decode(features)[-1, FEET, 1].min() < 1.1


@pytest.mark.parametrize("prompt", ["hangs from a bar", "dangles from a ledge", "hangs from a bar, swaying gently"])
@pytest.mark.parametrize("seed", SEEDS)
def test_who_hangs_hardly_moves_and_holds_on(prompt: str, seed: int) -> None:
    joints = drawn("hang", prompt, seed=seed)
    assert joints[:, FEET, 1].min() > 0.5, "off the floor"
    assert np.ptp(joints[:, WRISTS], axis=0).max() < 0.02
    assert joints[:, WRISTS, 1].min() > joints[:, HEAD, 1].max()
    assert np.ptp(joints[:, PELVIS, 2]) < 0.25


@pytest.mark.parametrize("seed", SEEDS)
def test_who_swings_swings_below_hands_that_stay(seed: int) -> None:
    joints = drawn("hang", "swings from a bar", seed=seed)
    assert np.ptp(joints[:, WRISTS], axis=0).max() < 0.02
    assert np.ptp(joints[:, PELVIS, 2]) > 0.25


@pytest.mark.parametrize(
    ("words", "count"), [("does a pull-up", None), ("does three pull-ups", 3), ("two chin-ups", 2)]
)
def test_pulls_lift_the_body_to_the_bar_as_often_as_asked_for(words: str, count: int | None) -> None:
    joints = drawn("hang", f"hangs from a bar and {words}")
    near = joints[:, WRISTS, 1].min(axis=1) - joints[:, PELVIS, 1] < 0.72
    pulls = int(np.sum(np.diff(near.astype(int)) == 1))
    assert pulls == count if count else pulls >= 1


@pytest.mark.parametrize(("side", "way"), [("left", 1), ("right", -1)])
def test_a_shimmy_goes_hand_over_hand_to_its_side(side: str, way: int) -> None:
    joints = drawn("hang", f"hangs from a ledge and shimmies to the {side}")
    assert way * (joints[-1, PELVIS, 0] - joints[0, PELVIS, 0]) > 0.4
    moving = np.linalg.norm(np.diff(joints[:, WRISTS], axis=0), axis=-1) > 0.01
    assert not moving.all(axis=1).any(), "one hand holds"
    assert moving.any(axis=0).all()


def test_one_hand_lets_go_and_the_named_one_holds() -> None:
    joints = drawn("hang", "hangs by his right hand")
    assert np.ptp(joints[:, WRISTS[1]], axis=0).max() < 0.03
    assert joints[-1, WRISTS[0], 1] < joints[-1, SHOULDERS[0], 1]
    assert joints[: round(FPS), WRISTS, 1].min() > joints[0, HEAD, 1], "by both hands at first"


@pytest.mark.parametrize("prompt", ["drives a car", "a trucker steers his truck", "races a kart, swerving"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_driver_stays_on_the_seat_and_holds_the_wheel(prompt: str, seed: int) -> None:
    joints = drawn("drive", prompt, seed=seed)
    assert np.ptp(yaw(joints)) < 2
    assert np.ptp(joints[:, PELVIS], axis=0).max() < 0.02
    line = joints[:, WRISTS[0]] - joints[:, WRISTS[1]]
    apart = np.linalg.norm(line, axis=-1)
    assert apart.min() > 0.2
    assert np.ptp(apart) < 0.08
    assert np.ptp(joints[:, WRISTS].mean(axis=1), axis=0).max() < 0.15, "the wheel stays"
    assert joints[:, TOES, 1].min(axis=1).max() < 0.05, "the floor is found below the toes"


def test_a_sharp_turn_turns_the_wheel_far_to_its_side() -> None:
    for seed in SEEDS:
        turned = []
        for prompt in ("drives, sharp turn left", "drives calmly"):
            joints = drawn("drive", prompt, seed=seed)
            line = joints[:, WRISTS[0]] - joints[:, WRISTS[1]]
            turned.append(np.degrees(np.arctan2(line[:, 1], line[:, 0])))
        assert turned[0].min() < -45, "the left hand goes down"
        assert turned[0].max() < 20
        assert np.abs(turned[1]).max() < 40


@pytest.mark.parametrize("prompt", ["drives with one hand", "drives and shifts gears"])
def test_a_hand_leaves_the_wheel_and_comes_back(prompt: str) -> None:
    joints = drawn("drive", prompt)
    over = joints[:, WRISTS[1], 1] - joints[0, PELVIS, 1]
    assert over.min() < 0.22 < over[0]
    assert over[-1] > over.min() + 0.08
