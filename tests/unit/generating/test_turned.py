"""Motions that turn as far as their prompt asks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from marey.generation.turned import STILL_S, ended_turn, turned_features
from marey.motion.courses import natural_course
from marey.motion.features import HUMANML3D_263
from marey.motion.feet import find_contacts, skate
from marey.motion.skeleton import HUMANML3D
from marey.vocabulary.turns import Turn
from tests.support.bodies import Body, steady, walker

LAYOUT = HUMANML3D_263


def degrees(features: np.ndarray[Any, Any]) -> float:
    headings = natural_course(LAYOUT.decode(features).astype(float), HUMANML3D, 20.0).headings
    return float(np.degrees(headings[-1] - headings[0]))


@pytest.mark.parametrize(
    ("made", "turn", "side", "shown"),
    [
        (150.0, Turn(90, 90), "", 90),
        (-150.0, Turn(60, 120), "", -120),
        (60.0, Turn(90, 90), "", 90),
        (40.0, Turn(0, 15), "", 15),
        (0.0, Turn(90, 90), "right", -90),
        (0.0, Turn(90, 90), "", 90),
        (200.0, Turn(360, 360, even=True), "", 360),
    ],
)
def test_walks_turn_as_far_as_asked(made: float, turn: Turn, side: str, shown: float) -> None:
    features = LAYOUT.encode(walker(6.0, turn=made))
    result = turned_features(features, LAYOUT, turn, side)
    assert result is not None
    changed, before = result
    assert before == pytest.approx(made, abs=5)
    assert degrees(changed) == pytest.approx(shown, abs=5)
    assert len(changed) == len(features)


def test_standing_feet_stay_and_the_way_is_as_long() -> None:
    features = LAYOUT.encode(walker(6.0, turn=180.0))
    result = turned_features(features, LAYOUT, Turn(90, 90), "")
    assert result is not None
    before, after = (LAYOUT.decode(each).astype(float) for each in (features, result[0]))
    slides = [skate(each, find_contacts(each, HUMANML3D, 20.0), HUMANML3D, 20.0) for each in (before, after)]
    assert slides[1] <= slides[0] + 0.02
    ways = [float(np.linalg.norm(np.diff(each[:, 0, [0, 2]], axis=0), axis=-1).sum()) for each in (before, after)]
    assert ways[1] == pytest.approx(ways[0], rel=0.05)


def test_a_circle_comes_back_to_its_beginning() -> None:
    features = LAYOUT.encode(walker(8.0))
    result = turned_features(features, LAYOUT, Turn(360, 360, even=True), "left")
    assert result is not None
    joints = LAYOUT.decode(result[0])
    assert np.linalg.norm(joints[-1, 0, [0, 2]] - joints[0, 0, [0, 2]]) < 0.6
    assert np.ptp(joints[:, 0, 0]) > 1.5


@pytest.mark.parametrize(("made", "turn"), [(92.0, Turn(90, 90)), (100.0, Turn(60, 120)), (10.0, Turn(0, 15))])
def test_what_turns_so_far_by_itself_stays(made: float, turn: Turn) -> None:
    assert turned_features(LAYOUT.encode(walker(6.0, turn=made)), LAYOUT, turn, "") is None


def test_there_is_no_time_for_a_large_turn() -> None:
    assert turned_features(LAYOUT.encode(walker(1.0)), LAYOUT, Turn(360, 360), "") is None


def turner(degrees: float, seconds: float) -> np.ndarray[Any, Any]:
    """Return features of a body that turns on the spot at an even pace, step by step."""
    return LAYOUT.encode(Body(seconds, speed=steady(0.05), turn=degrees).joints())


def test_a_turn_on_the_spot_ends_when_it_is_large_enough_and_rests() -> None:
    features = turner(200.0, 9.5)
    ends = ended_turn(features, LAYOUT, Turn(90, 90))
    assert ends is not None
    assert len(ends) < 0.75 * len(features)
    assert degrees(ends) == pytest.approx(90, abs=30)
    joints = LAYOUT.decode(ends)
    assert np.abs(np.diff(joints[-round(STILL_S * 20) :], axis=0)).max() < 1e-3
    speed = np.linalg.norm(np.diff(joints[:, :6], axis=0), axis=-1).max(axis=1) * 20
    assert np.abs(np.diff(speed))[-30:].max() < 1.0


@pytest.mark.parametrize("turn", [Turn(360, 360), Turn(whole=True), Turn(0, 15), Turn(90, 90, even=True)])
def test_other_turns_do_not_end_sooner(turn: Turn) -> None:
    assert ended_turn(turner(300.0, 6.0), LAYOUT, turn) is None
