"""Words of ways that end in a stop."""

from __future__ import annotations

import pytest

from marey.vocabulary.stops import comes_to_a_stop, only_stops, stated_skid, way_to_a_stop


@pytest.mark.parametrize(
    ("clause", "comes", "only"),
    [
        ("comes to a halt", True, True),
        ("slows down to a stop", True, False),
        ("skids to a sudden stop", True, True),
        ("slides into a stop", True, False),
        ("stops dead", False, True),
        ("he then halts in front of the gate for a moment", False, True),
        ("freezes", False, True),
        ("stops the ball", False, False),
        ("walks to a halt", False, False),
        ("comes to the door", False, False),
    ],
)
def test_clauses_of_a_stop(clause: str, comes: bool, only: bool) -> None:
    assert comes_to_a_stop(clause) is comes
    assert only_stops(clause) is only


def test_what_comes_to_a_stop_need_not_skid() -> None:
    assert stated_skid("he slows to a stop", "run") == ""
    assert stated_skid("he slides to a stop", "run") == "skid"
    assert stated_skid("He STOPS abruptly", "sprint") == "stop"
    assert stated_skid("he slides to a stop", "walk") == ""
    assert stated_skid("he slides into the base and skids to a stop", "run") == ""


@pytest.mark.parametrize(
    ("prompt", "way"),
    [
        ("he walks up to the door and stops", "he walks up to the door"),
        ("jog to a stop", "jog"),
        ("She sprints, then comes to a sudden halt.", "She sprints"),
        ("a man walks on, stops dead", "a man walks on"),
        ("walk until she stands still", "walk"),
        ("he walks to the bus stop", ""),
        ("walks on without stopping", ""),
        ("he stops and waves", ""),
    ],
)
def test_the_way_to_a_stop(prompt: str, way: str) -> None:
    assert way_to_a_stop(prompt) == way


def test_a_way_to_idle_ends_with_a_stop() -> None:
    assert way_to_a_stop("run to idle") == "run"
    assert way_to_a_stop("walk forward to idle") == "walk forward"
    assert not way_to_a_stop("stands idle")


@pytest.mark.parametrize(
    ("said", "action", "how"),
    [
        ("a thug sprints in, skids to a stop", "sprint", "skid"),
        ("runs fast and comes to a screeching halt", "run", "skid"),
        ("dashes forward and slides", "sprint", "skid"),
        ("a sprinter stops abruptly", "run", "stop"),
        ("runs to the bus stop", "run", ""),
        ("runs and slides on his knees", "run", ""),
        ("skids to a stop", "walk", ""),
    ],
)
def test_the_words_say_how_a_run_ends(said: str, action: str, how: str) -> None:
    assert stated_skid(said, action) == how
