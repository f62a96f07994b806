"""Ways that go where their prompts say."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from marey.generation.steered import steered_features
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import find_contacts, skate
from marey.motion.skeleton import HUMANML3D
from marey.selector.matching import WantedAction, match
from marey.selector.motion import Motion
from marey.vocabulary.courses import ASIDE, CIRCLE, EIGHT, SIZES, STRAIGHT, ZIGZAG, WayCourse
from tests.support.bodies import Body, walker

LAYOUT = HUMANML3D_263
Array = np.ndarray[Any, Any]


def steered(course: WayCourse, seconds: float = 6.0, turn: float = 0.0, seed: int = 0) -> Array:
    features = steered_features(LAYOUT.encode(walker(seconds, turn=turn)), LAYOUT, course, seed)
    assert features is not None
    return LAYOUT.decode(features).astype(float)


def directions(joints: Array) -> Array:
    """Return the direction (T - 20,) of the root within a second, degrees, positive to the left."""
    steps = joints[20:, 0] - joints[:-20, 0]
    return np.degrees(np.unwrap(np.arctan2(steps[:, 0], steps[:, 2])))


@pytest.mark.parametrize("turn", [30.0, -80.0])
def test_ways_are_straight(turn: float) -> None:
    joints = steered(WayCourse(STRAIGHT), turn=turn)
    assert np.ptp(directions(joints)) < 12
    assert abs(joints[-1, 0, 0]) < 0.4
    assert skate(joints, find_contacts(joints, HUMANML3D, 20.0), HUMANML3D, 20.0) < 0.05


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
@pytest.mark.parametrize("turn", [0.0, 70.0])
def test_who_goes_off_to_a_side_turns_at_once(side: str, sign: int, turn: float) -> None:
    joints = steered(WayCourse(ASIDE, side), turn=turn)
    assert directions(joints)[20:] == pytest.approx(90 * sign, abs=10)
    assert joints[:, 0, 2].max() < 1.2, "hardly ahead before it"


@pytest.mark.parametrize("size", ["", "wide"])
def test_circles_close_and_have_their_size(size: str) -> None:
    joints = steered(WayCourse(CIRCLE, "right", SIZES[size]), 9.0 if size else 6.0, turn=90.0)
    assert np.linalg.norm((joints[-1, 0] - joints[0, 0])[[0, 2]]) < 0.3
    low, high = SIZES[size]
    assert 0.8 * low < np.ptp(joints[:, 0, [0, 2]], axis=0).mean() < 1.2 * high
    assert directions(joints)[-1] < -270


@pytest.mark.parametrize(("side", "sign"), [("left", 1), ("right", -1)])
def test_eights_are_two_circles(side: str, sign: int) -> None:
    joints = steered(WayCourse(EIGHT, side), 8.0)
    assert np.linalg.norm((joints[-1, 0] - joints[0, 0])[[0, 2]]) < 0.3
    turns = sign * directions(joints)
    assert turns.max() > 250
    assert abs(turns[-1]) < 60
    half = len(joints) // 2
    sides = [float(np.median(sign * part[:, 0, 0])) for part in (joints[10 : half - 10], joints[half + 10 : -10])]
    assert sides[0] > 0.2 > -0.2 > sides[1]
    assert skate(joints, find_contacts(joints, HUMANML3D, 20.0), HUMANML3D, 20.0) < 0.08


def test_zigzags_go_to_both_sides_in_turn() -> None:
    joints = steered(WayCourse(ZIGZAG))
    found = directions(joints)
    signs = np.sign(found[np.abs(found) > 15])
    assert (np.diff(signs) != 0).sum() >= 2
    assert abs(np.degrees(np.arctan2(joints[-1, 0, 0], joints[-1, 0, 2]))) < 30


def test_who_stands_is_not_steered() -> None:
    assert steered_features(LAYOUT.encode(Body(4.0).joints()), LAYOUT, WayCourse(), 0) is None
    assert steered_features(LAYOUT.encode(walker(6.0)), LAYOUT, WayCourse(), 0) is None


def test_a_way_that_winds_shows_its_gait() -> None:
    joints = steered(WayCourse(CIRCLE, "left", SIZES[""]))
    values = [match(Motion(joints, 20.0), ((WantedAction("walk", winds=winds),),)) for winds in (False, True)]
    assert values[0] < 0.5 <= values[1]
