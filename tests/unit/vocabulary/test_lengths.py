"""Lengths that prompts state in words."""

import pytest

from marey.vocabulary.lengths import StatedLength, is_length, only_length, stated_length, without_length
from marey.vocabulary.report import ScopeReport
from marey.vocabulary.scope import ActionLists, match_scope

LISTS = ActionLists(("walk", "wave"))


@pytest.mark.parametrize(
    ("prompt", "seconds"),
    [
        ("a person walks for six seconds", 6.0),
        ("A 3-second idle", 3.0),
        ("2s of waving", 2.0),
        ("she runs, 4 sec", 4.0),
        ("For 2.5 seconds she waves", 2.5),
        ("he waves for one and a half seconds", 1.5),
        ("half a second of jumping", 0.5),
        ("dances for half a minute", 30.0),
        ("dances for a minute", 60.0),
        ("waves for three whole seconds", 3.0),
        ("bows, waves, then sits - keep it to 5 seconds", 5.0),
        ("bows, then waves; make it four seconds long", 4.0),
        ("bows and sits, keep the whole thing under 10 s", 9.0),
        ("kneels, nods and stands up (6 seconds in total)", 6.0),
        ("waves. Length: 4 seconds.", 4.0),
        ("walks for 2 seconds, then waves for 3 seconds", 5.0),
        ("walks and waves for five seconds", 5.0),
        ("sits for eight seconds, back straight", 8.0),
        ("walks for 3 seconds and waves for 2 seconds", 5.0),
        ("walks for 6 seconds, slowly, like a zombie", 6.0),
        ("walks 6 seconds, slowly", 6.0),
        ("wave 2 s, bow 3 s", 5.0),
        ("for six seconds, a person walks and waves", 6.0),
        ("a dance from the 1980s", None),
        ("80s disco", None),
        ("after two seconds he waves", None),
        ("waits, and two seconds later he falls", None),
        ("the first three seconds are idle", None),
        ("the second dancer waves", None),
        ("takes 3 steps", None),
    ],
)
def test_the_stated_length_is_that_of_the_whole_motion(prompt: str, seconds: float | None) -> None:
    assert stated_length(prompt) == StatedLength(seconds)


@pytest.mark.parametrize(
    "prompt",
    [
        "walks, then waves for 3 seconds",
        "he waits for a second before he jumps",
        "stand still for two seconds, answer the phone and hang up",
        "walks for two seconds, waves and sits down",
        "hops on the left foot, stands on it 3 s, jumps",
        "dribble 2 secs, full spin, jump shot",
        "crouch - wait 2 seconds - sprint",
        "idle -> wave 2 s -> bow",
    ],
)
def test_the_length_of_a_part_is_not_that_of_the_motion(prompt: str) -> None:
    assert stated_length(prompt) == StatedLength(is_partial=True)
    assert "length" in match_scope(prompt, LISTS).flags


def test_a_length_out_of_the_range_is_warned_of() -> None:
    report = ScopeReport()
    scope = report.judge("a person walks for twenty seconds", "tiny", LISTS, lengths=(1.0, 9.8))
    assert scope is not None
    assert scope.flags == ("length",)
    assert report.warnings() == [
        "'a person walks for twenty seconds': a stated length is not used: it is out of the model's range"
    ]
    within = report.judge("a person walks for six seconds", "tiny", LISTS, lengths=(1.0, 9.8))
    assert within is not None
    assert within.flags == ()


def test_a_warning_tells_the_length_of_a_part_from_one_out_of_the_range() -> None:
    report = ScopeReport()
    for prompt in ("walks for twenty seconds", "walks, then waves for 3 seconds", "waves for a minute"):
        report.judge(prompt, "tiny", LISTS, lengths=(1.0, 9.8))
    assert [said for said in report.warnings() if "length" in said] == [
        "1 of 3 prompts, index 1 (from 0), 'walks, then waves for 3 seconds': a stated length is that of a part "
        "of the motion: it is used only if the parts are made one by one",
        "2 of 3 prompts, indexes 0, 2 (from 0), first 'walks for twenty seconds': a stated length is not used: it is "
        "out of the model's range",
    ]
    found = report.as_json()
    assert found["flags"]["length"] == 3
    assert [each["index"] for each in found["examples"] if each["kind"] == "length"] == [0, 2, 1]
    row = ScopeReport()
    row.judge("0-5 …", "tiny", LISTS, rows=[("row 1 (0-5)", "walks, then waves for 3 seconds")])
    assert row.warnings()[-1].endswith("it is used only if the parts are made one by one")


def test_the_length_of_a_first_clause_is_that_of_a_part() -> None:
    assert stated_length("After clapping for two seconds, the clown bows.") == StatedLength(is_partial=True)
    assert stated_length("After a bow, he claps for two seconds, then kneels").is_partial
    assert stated_length("after two seconds, he claps") == StatedLength()


@pytest.mark.parametrize(
    ("prompt", "left"),
    [
        ("walk away for 4 seconds", "walk away"),
        ("limp forward, wounded left leg, 5 seconds", "limp forward, wounded left leg"),
        ("jogs back, about 4 seconds", "jogs back"),
        ("2s of waving", "waving"),
        ("For 2.5 seconds she waves", "she waves"),
        ("he walks (5 s)", "he walks"),
        ("3 seconds", "3 seconds"),
        ("waits, and two seconds later he falls", "waits, and two seconds later he falls"),
    ],
)
def test_models_read_no_lengths(prompt: str, left: str) -> None:
    assert without_length(prompt) == left


def test_the_only_length_of_one_movement_is_its_own() -> None:
    assert only_length("sprint start then full speed, 3 seconds") == 3.0
    assert only_length("walks for 2 seconds, then runs for 3 seconds") is None
    assert only_length("walks home") is None


@pytest.mark.parametrize(
    ("text", "alone"),
    [
        ("for 4 seconds", True),
        ("for about two seconds.", True),
        ("waves for 4 seconds", False),
        ("waves", False),
        ("", False),
    ],
)
def test_a_length_may_stand_alone(text: str, alone: bool) -> None:
    assert is_length(text) is alone
