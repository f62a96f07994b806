"""Minimal pairs: what is read off a motion, and when a pair of motions is right."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.motion.skeleton import HUMANML3D
from marey.referee.pairs import (
    PROPERTIES,
    PairPrompt,
    PairReading,
    Property,
    Value,
    is_right,
    pair_prompts,
    pairs_document,
    pairs_markdown,
    property_rates,
    read_property,
)
from marey.referee.properties import ACTING, COUNTS, acting_side, direction, pace, repetitions
from tests.unit.referee.bodies import Joints, arm_to, body, seconds, standing, tipped, walking


def _pulses(length: float, number: int) -> Joints:
    """(T,) `number` smooth movements from 0 to 1 and back, with a rest after each."""
    turn = seconds(length) / length * number % 1.0
    return np.where(turn < 0.7, np.sin(np.pi * turn / 0.7) ** 2, 0.0)


def _turned(joints: Joints, degrees: Joints) -> Joints:
    """Turn each frame to the left about the vertical axis of its pelvis."""
    angle = np.deg2rad(degrees)[:, None]
    moved = joints - joints[:, :1] * [1.0, 0.0, 1.0]
    x, z = moved[..., 0].copy(), moved[..., 2].copy()
    moved[..., 0], moved[..., 2] = x * np.cos(angle) + z * np.sin(angle), z * np.cos(angle) - x * np.sin(angle)
    return moved + joints[:, :1] * [1.0, 0.0, 1.0]


def _waving(side: str, swings: float = 2.0) -> Joints:
    time = seconds(3.0)
    aside = 0.25 * np.sin(2 * np.pi * swings * time)
    hand = np.stack([aside, np.full_like(time, 0.4), np.full_like(time, 0.1)], axis=-1)
    joints = arm_to(standing(3.0), side, hand)
    elbow = HUMANML3D.index(f"{side}_elbow")
    joints[:, elbow] = joints[:, elbow].mean(0)  # the forearm alone waves
    return joints


def _kicking(side: str, number: int) -> Joints:
    joints, out = standing(4.0), _pulses(4.0, number)
    for joint, share in (("knee", 0.6), ("ankle", 1.0), ("foot", 1.0)):
        joints[:, HUMANML3D.index(f"{side}_{joint}")] += out[:, None] * [0.0, 0.7 * share, 0.6 * share]
    return joints


def _lifted(joints: Joints, height: Joints) -> Joints:
    return joints + height[:, None, None] * [0.0, 1.0, 0.0]


def _squatting(number: int) -> Joints:
    joints, down = standing(6.0), _pulses(6.0, number)
    upper = [i for i, name in enumerate(HUMANML3D.joint_names) if name.split("_")[-1] not in ("ankle", "foot")]
    joints[:, upper] -= (0.4 * down)[:, None, None] * [0.0, 1.0, 0.0]
    return joints


def _clapping(number: int) -> Joints:
    time = seconds(3.0)
    ahead = 0.05 + 0.2 * np.abs(np.cos(np.pi * number * time / 3.0))
    joints = standing(3.0)
    middle = joints[:, HUMANML3D.index("spine3")]
    for side, sign in (("L", 1.0), ("R", -1.0)):
        joints[:, HUMANML3D.index(f"{side}_wrist")] = middle + np.stack(
            [sign * ahead, 0 * ahead, 0 * ahead + 0.35], axis=-1
        )
    return joints


def _punching(number: int) -> Joints:
    out = _pulses(0.6 * number, number)
    guard, hit = np.array([0.0, -0.1, 0.2]), np.array([0.0, 0.05, 0.5])
    return arm_to(standing(0.6 * number), "R", guard + out[:, None] * (hit - guard))


def _raising(number: int) -> Joints:
    up = _pulses(6.0, number)[:, None]
    return arm_to(standing(6.0), "L", (1 - up) * [0.08, -0.5, 0.05] + up * [0.15, 0.45, 0.0])


@pytest.mark.parametrize(("side", "name"), [("L", "left"), ("R", "right")])
def test_the_side_is_that_of_the_faster_arm_or_the_higher_foot(side: str, name: str) -> None:
    assert acting_side("wave", body(_waving(side))) == name
    assert acting_side("kick", body(_kicking(side, 1))) == name
    assert acting_side("wave", body(standing(2.0))) == ""
    assert acting_side("kick", body(standing(2.0))) == ""


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_repetitions_are_counted(number: int) -> None:
    made = {
        "jump": _lifted(standing(6.0), 0.25 * _pulses(6.0, number)),
        "bow": tipped(standing(6.0), 40 * _pulses(6.0, number)),
        "squat": _squatting(number),
        "kick": _kicking("R", number),
        "punch": _punching(number),
        "clap": _clapping(number),
        "raise-arm": _raising(number),
    }
    assert {action: repetitions(action, body(joints)) for action, joints in made.items()} == dict.fromkeys(made, number)
    assert {action: repetitions(action, body(standing(3.0))) for action in COUNTS} == dict.fromkeys(COUNTS, 0)


def test_steps_are_counted() -> None:
    short, long = (repetitions("step", body(walking(length, 1.0))) for length in (3.0, 6.0))
    assert (short, long) == (pytest.approx(5, abs=1), pytest.approx(11, abs=1))  # 1.8 a second


@pytest.mark.parametrize(("degrees", "name"), [(0.0, "forward"), (180.0, "backward"), (90.0, "right"), (-90.0, "left")])
def test_the_direction_is_that_of_the_body_itself(degrees: float, name: str) -> None:
    """The body travels along +Z and faces elsewhere."""
    joints = walking(3.0, 0.8)
    assert direction("step", body(_turned(joints, np.full(len(joints), degrees)))) == name
    assert direction("step", body(standing(3.0))) == ""


def test_a_way_out_and_back_has_the_direction_of_the_way_out() -> None:
    joints = standing(2.0)
    joints[..., 0] += (0.5 * np.sin(np.pi * seconds(2.0) / 2.0))[:, None]
    assert direction("dodge", body(joints)) == "left"


def test_a_turn_has_the_direction_of_the_turn() -> None:
    joints = standing(3.0)
    ramp = np.linspace(0.0, 1.0, len(joints))
    found = [direction("turn", body(_turned(joints, degrees * ramp))) for degrees in (120.0, -120.0, 15.0)]
    assert found == ["left", "right", ""]


def test_a_quick_action_has_a_higher_pace() -> None:
    slow, quick = body(_waving("L", 1.0)), body(_waving("L", 2.0))
    assert pace("wave", quick) > 1.6 * pace("wave", slow)
    assert pace("walk", body(walking(4.0, 1.4))) == pytest.approx(1.4, rel=0.1)
    ramp = np.linspace(0.0, 180.0, len(standing(2.0)))
    assert pace("turn-around", body(_turned(standing(2.0), ramp))) == pytest.approx(90.0, rel=0.1)
    assert pace("bow", body(tipped(standing(3.0), 40 * _pulses(3.0, 2)))) > 1.5 * pace(
        "bow", body(tipped(standing(3.0), 40 * _pulses(3.0, 1)))
    )


def _reading(name: Property, expected: Value, value: Value, *, shown: bool = True, pair: int = 0) -> PairReading:
    return PairReading(PairPrompt("a prompt", pair, name, "walk", expected), 0, value, shown)


@pytest.mark.parametrize(
    ("reading", "right"),
    [
        (_reading("side", "left", "left"), True),
        (_reading("side", "left", "right"), False),
        (_reading("side", "left", "left", shown=False), False),
        (_reading("count", 2, 2), True),
        (_reading("count", 2, 3), False),
        (_reading("order", ("walk", "bow"), True), True),
        (_reading("order", ("walk", "bow"), False), False),
        (_reading("duration", 5, 5.9), True),
        (_reading("duration", 5, 6.1), False),
        (_reading("duration", 5, 3.9), False),
    ],
)
def test_a_motion_is_right_if_its_property_is_as_asked(reading: PairReading, right: bool) -> None:
    assert is_right(reading, reading) is right


def test_speed_is_right_between_the_two_motions_of_a_pair() -> None:
    def both(slow: float, fast: float, *, shown: bool = True) -> tuple[bool, bool]:
        first, second = _reading("speed", "slow", slow, shown=shown), _reading("speed", "fast", fast)
        return is_right(first, second), is_right(second, first)

    assert both(1.0, 1.3) == (True, True)
    assert both(1.0, 1.1) == (False, False)
    assert both(1.3, 1.0) == (False, False)
    assert both(1.0, 1.3, shown=False) == (False, True)


def test_a_pair_is_right_if_both_motions_are() -> None:
    readings = [
        *(_reading("count", 2, 2, pair=0), _reading("count", 3, 3, pair=0)),
        *(_reading("count", 1, 1, pair=1), _reading("count", 2, 1, pair=1)),
        *(_reading("side", "left", "left", pair=2), _reading("side", "right", "left", pair=2)),
    ]
    side, count = property_rates(readings)
    assert (side.property, side.pairs, side.motions, side.single, side.pair) == ("side", 1, 2, 0.5, 0.0)
    assert (count.property, count.pairs, count.motions, count.single, count.pair) == ("count", 2, 4, 0.75, 0.5)
    assert count.pair_interval[0] < 0.5 < count.pair_interval[1]
    assert "| count | 50% | 9% to 91% | 75% |" in pairs_markdown("toy@1", [count])
    assert len(pairs_document("toy@1", {}, readings)["motions"]) == 6
    with pytest.raises(InvalidInput, match="pair 2 has 1 motions"):
        property_rates(readings[:-1])


def test_what_a_prompt_names_is_read_off_its_motion() -> None:
    def read(name: Property, action: str, expected: Value, joints: Joints) -> PairReading:
        return read_property(PairPrompt("a prompt", 0, name, action, expected), 3, body(joints))

    waving = read("side", "wave", "left", _waving("L"))
    assert (waving.value, waving.shown, waving.seed) == ("left", True, 3)
    assert not read("side", "wave", "left", standing(3.0)).shown
    assert read("count", "squat", 2, _squatting(2)).value == 2
    assert read("order", "", ("walk", "idle"), walking(3.0, 1.2)).value is False
    assert read("direction", "walk", "forward", walking(3.0, 1.2)).value == "forward"
    assert read("speed", "walk", "slow", walking(4.0, 1.2)).value == pytest.approx(1.2, rel=0.1)
    assert read("duration", "walk", 4, walking(4.0, 1.2)).value == 4.0


def test_every_property_has_pairs_that_can_be_measured() -> None:
    prompts = pair_prompts()
    number = Counter(prompt.property for prompt in prompts)
    assert list(number) == list(PROPERTIES)
    assert min(number.values()) >= 20
    assert len({prompt.text.casefold() for prompt in prompts}) == len(prompts)
    of_pair = Counter(prompt.pair for prompt in prompts)
    assert set(of_pair.values()) == {2}
    for first, second in zip(prompts[::2], prompts[1::2], strict=True):
        assert first.pair == second.pair
        assert first.expected != second.expected
    measured = {"count": set(COUNTS), "speed": {"walk", "run", "turn-around", *ACTING}}
    for name, actions in measured.items():
        assert {prompt.action for prompt in prompts if prompt.property == name} <= actions
