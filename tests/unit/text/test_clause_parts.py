"""Clauses whose words name several actions, one after the other."""

from __future__ import annotations

import pytest

from marey.text.clause_parts import only_named, parts_in_time


@pytest.mark.parametrize(
    ("text", "actions"),
    [
        ("kneel, aim", ["kneel", "aim"]),
        ("he squats; then he jumps", ["squat", "jump"]),
        ("jogs along, slows to a walk", ["run", "walk"]),
        ("hangs from a pipe, drops down and rolls ahead", ["hang", "roll"]),
        ("cartwheels to the right and waves an arm", ["cartwheel", "wave"]),
        ("two steps to the right, cartwheel", ["sidestep", "cartwheel"]),
        ("kneels, nods and stands up", ["kneel", "nod", "stand-up"]),
    ],
)
def test_parts_that_name_one_action_each_come_one_after_the_other(text: str, actions: list[str]) -> None:
    assert [action for _, action in parts_in_time(text)] == actions


@pytest.mark.parametrize(
    "text",
    [
        "walks and waves",
        "walks ahead, waving",
        "sits, arms crossed",
        "claps, claps",
        "practises karate, kicks and punches",
        "arabesque, ballet",
        "cartwheels nice and clean",
        "jumps and turns around",
        "walks ahead, hums a song",
    ],
)
def test_what_is_done_at_once_or_is_no_action_is_one_part(text: str) -> None:
    assert len(parts_in_time(text)) < 2


def test_and_separates_what_comes_behind_other_parts() -> None:
    assert len(parts_in_time("turns left and runs")) < 2
    assert parts_in_time("turns left and runs", listed=True) == [("turns left", "turn"), ("runs", "run")]
    assert len(parts_in_time("turns left and carries on", listed=True)) < 2
    assert len(parts_in_time("runs ahead and cheers", listed=True)) < 2


def test_the_only_action_that_words_name() -> None:
    assert only_named("he kneels") == "kneel"
    assert only_named("he kneels and bows") is None
    assert only_named("he hums") is None
