"""Postures that are handed from one movement of a sequence to the next."""

from __future__ import annotations

import pytest

from marey.drawing.low_deeds import LowDeed
from marey.generation.posture import RowPosture
from marey.generation.row_postures import is_as_alone, row_postures


def postures(*rows: tuple[str, str]) -> list[tuple[str, str, str]]:
    return [(held.begin, held.own, held.end) for held in row_postures(rows, 1)]


def test_gestures_are_done_where_the_body_is() -> None:
    sits = ("walk", "walks to a seat"), ("sit-down", "sits down")
    rows = row_postures([*sits, ("wave", "waves"), ("", "reads a book")], 1)
    assert [(each.begin, each.own, each.end) for each in rows] == [
        ("", "", ""),
        ("", "seat", "seat"),
        ("seat", "seat", "seat"),
        ("seat", "seat", "seat"),
    ]
    assert [each.gesture for each in rows] == [False, False, True, True]
    assert [each.is_drawn for each in rows] == [False, True, False, False]


def test_who_peeks_does_so_in_the_posture_in_which_the_body_is() -> None:
    rows = row_postures([("kneel", "kneels"), ("idle", "peeks to the right"), ("idle", "waits")], 1)
    assert [each.own for each in rows] == ["knees"] * 3
    assert [each.gesture for each in rows] == [False, True, False]


@pytest.mark.parametrize(
    ("row", "posture"),
    [
        (("sit-down", "sits down"), "seat"),
        (("sit-floor", "sits down on the floor"), "floor"),
        (("kneel", "kneels"), "knees"),
        (("kneel", "kneels on one knee"), "knee"),
        (("kneel", "kneels on his left knee"), "knee"),
        (("kneel", "goes down on the right knee"), "right-knee"),
        (("kneel", "kneels with the left knee up"), "right-knee"),
        (("crouch", "crouches"), "crouch"),
        (("squat", "squats"), "crouch"),
        (("lie-down", "lies down"), "back"),
        (("lie-down", "lies down on his belly"), "front"),
        (("die", "trips and falls"), "front"),
    ],
)
@pytest.mark.parametrize(
    "rises", [("get-up", "gets up"), ("stand-up", "stands up"), ("idle", "stands up"), ("", "scrambles up")]
)
def test_who_stands_up_does_so_from_there(row: tuple[str, str], posture: str, rises: tuple[str, str]) -> None:
    down, up, walk = row_postures([row, rises, ("walk", "walks off")], 1)
    assert (down.begin, down.own, down.end) == ("", posture, posture)
    assert (up.begin, up.own, up.end, up.is_drawn) == (posture, "", "", True)
    assert walk == RowPosture(seed=1)


def test_who_stands_has_not_to_stand_up() -> None:
    assert postures(("wave", "waves"), ("idle", "stands up")) == [("", "", "")] * 2


def test_who_goes_on_without_a_word_stands_up_first() -> None:
    assert postures(("sit-down", "sits down"), ("run", "runs away")) == [("", "seat", ""), ("", "", "")]
    assert postures(("kneel", "kneels"), ("wave", "waves"), ("", "leaves the room"))[1] == ("knees", "knees", "")


def test_who_lies_sits_up_once_and_stays() -> None:
    rows = postures(("lie", "lies on his back"), ("sit-ups", "sits up"), ("idle", "yawns"), ("get-up", "gets up"))
    assert rows == [
        ("back", "back", "back"),
        ("back", "upright", "upright"),
        ("upright", "upright", "upright"),
        ("upright", "", ""),
    ]
    assert postures(("walk", "walks"), ("sit-ups", "does sit-ups")) == [("", "", ""), ("", "", "back")]


def test_who_walks_backward_falls_on_the_back() -> None:
    assert postures(("walk-backward", "walks backwards"), ("die", "trips and falls"))[1] == ("", "back", "back")


def test_a_slide_behind_the_feet_is_no_lying_body() -> None:
    rows = postures(("run", "runs"), ("get-up", "slides feet first, gets up"), ("run", "runs on"))
    assert rows == [("", "", ""), ("", "slide", ""), ("", "", "")]


def test_falls_come_to_their_posture_by_themselves() -> None:
    fall = row_postures([("die", "dies"), ("get-up", "gets up")], 1)[0]
    assert fall.falls
    assert not fall.is_drawn
    seated = row_postures([("sit-down", "sits down"), ("die", "dies")], 1)[1]
    assert seated.is_drawn


def test_rules_of_actions_describe_rows_from_standing_alone() -> None:
    down, wave, up = row_postures([("sit-down", "sits down"), ("wave", "waves"), ("stand-up", "stands up")], 1)
    assert is_as_alone(down, "sit-down")
    assert is_as_alone(wave, "wave")
    assert is_as_alone(up, "stand-up")
    kneel, rises, _ = row_postures([("kneel", "kneels"), ("get-up", "stands up"), ("walk", "walks")], 1)
    assert is_as_alone(kneel, "kneel")
    assert not is_as_alone(rises, "get-up")


def test_who_is_in_a_posture_at_first_does_not_come_to_it() -> None:
    assert postures(("kneel", "a man kneeling"), ("wave", "waves"))[0] == ("knees", "knees", "knees")
    assert postures(("kneel", "a man kneels"), ("wave", "waves"))[0] == ("", "knees", "knees")
    assert postures(("walk", "walks"), ("kneel", "kneeling"))[1] == ("", "knees", "knees")


def test_who_crawled_lies_there() -> None:
    crawl, lie, rises = row_postures([("crawl", "crawls"), ("lie", "stays lying flat"), ("get-up", "gets up")], 1)
    assert crawl == RowPosture(end="fours", leaves="fours", seed=1)
    assert (lie.begin, lie.own, lie.end, lie.meets) == ("fours", "front", "front", True)
    assert rises.meets


@pytest.mark.parametrize(("action", "said", "fires"), [("aim", "takes aim", False), ("shoot", "shoots", True)])
@pytest.mark.parametrize("lies", [("lie-down", "lies down on his belly"), ("lie", "lies prone")])
def test_who_lies_on_the_front_aims_from_there(action: str, said: str, *, fires: bool, lies: tuple[str, str]) -> None:
    _, aims, rises = row_postures([lies, (action, said), ("get-up", "gets up")], 1)
    assert (aims.begin, aims.own, aims.end, aims.is_drawn, aims.fires) == ("front", "prone", "prone", True, fires)
    assert (rises.begin, rises.own) == ("prone", "")


def test_who_crawled_on_the_belly_aims_from_there() -> None:
    _, aims = row_postures([("crawl", "crawls on his belly"), ("aim", "takes aim")], 1)
    assert (aims.begin, aims.own, aims.apart) == ("prone", "prone", True)
    assert postures(("crawl", "crawls on hands and knees"), ("aim", "takes aim"))[1] == ("", "", "")
    assert postures(("lie-down", "lies down"), ("aim", "takes aim"))[1] == ("", "", "")


@pytest.mark.parametrize(
    ("row", "entry"),
    [
        (("crawl", "crawls away"), "fours"),
        (("crawl", "crawls on his belly"), "front"),
        (("sit-ups", "does crunches"), "back"),
    ],
)
@pytest.mark.parametrize(
    "low", [("crouch", "crouches"), ("kneel", "kneels"), ("sit-down", "sits down"), ("lie-down", "lies down")]
)
def test_who_is_low_goes_on_from_there(row: tuple[str, str], entry: str, low: tuple[str, str]) -> None:
    before, after = row_postures([low, row], 1)
    assert before.end == entry
    assert after.meets
    assert not after.is_drawn
    assert not row_postures([("walk", "walks"), row], 1)[1].meets


@pytest.mark.parametrize("row", [("reach-up", "reaches up"), ("raise-arm", "raises a hand"), ("nod", "nods")])
def test_arms_and_head_are_moved_on_the_back(row: tuple[str, str]) -> None:
    assert postures(("lie", "lies on his back"), row) == [("back", "back", "back")] * 2


@pytest.mark.parametrize(
    ("low", "posture"),
    [
        (("push-ups", "does push-ups"), "plank"),
        (("crawl", "crawls"), "fours"),
        (("crawl", "crawls on his belly"), "front"),
        (("sit-ups", "does crunches"), "back"),
    ],
)
def test_who_ends_low_goes_on_from_there(low: tuple[str, str], posture: str) -> None:
    ends, up = row_postures([low, ("get-up", "gets up")], 1)
    assert (ends.leaves, ends.end, ends.goes_on, ends.is_drawn) == (posture, posture, False, False)
    assert (up.begin, up.own, up.meets, up.is_drawn) == (posture, "", True, True)
    walks = row_postures([low, ("walk", "walks away")], 1)
    assert (walks[0].goes_on, walks[0].end, walks[1].begin) == (True, "", "")
    again = row_postures([low, ("push-ups", "does push-ups")], 1)
    assert (again[0].end, again[1].meets) == ("plank", True)


def test_a_fall_goes_on_to_what_follows() -> None:
    falls, crawls = row_postures([("die", "trips and falls"), ("crawl", "crawls away")], 1)
    assert (falls.own, falls.end, falls.goes_on, crawls.meets) == ("front", "fours", True, True)
    assert not row_postures([("die", "trips and falls"), ("get-up", "gets up")], 1)[0].goes_on


@pytest.mark.parametrize("said", ["wakes up", "she wakes", "awakens", "slowly wakes up", "opens her eyes"])
def test_who_wakes_stays_where_the_body_lies(said: str) -> None:
    lies, wakes, up = row_postures([("lie", "lies asleep"), ("get-up", said), ("sit-ups", "sits up")], 1)
    assert (lies.own, wakes.begin, wakes.own, wakes.is_drawn) == ("back", "back", "back", True)
    assert (up.begin, up.own) == ("back", "upright")
    assert postures(("get-up", said), ("sit-ups", "sits up"))[0] == ("back", "back", "back")


def test_who_wakes_and_gets_up_rises() -> None:
    assert postures(("lie", "lies asleep"), ("get-up", "wakes and gets up"))[1] == ("back", "", "")


@pytest.mark.parametrize("said", ["gets up in a crouch", "rises into a low crouch", "gets up crouching"])
@pytest.mark.parametrize("low", [("crawl", "crawls"), ("lie-down", "lies down"), ("push-ups", "does push-ups")])
def test_who_rises_to_a_crouch_stays_in_it_to_creep(low: tuple[str, str], said: str) -> None:
    assert postures(low, ("get-up", said), ("sneak", "creeps on"))[1][1:] == ("crouch", "crouch")


@pytest.mark.parametrize("low", [("crawl", "crawls"), ("push-ups", "does push-ups")])
def test_who_is_on_the_hands_stands_up_to_use_them(low: tuple[str, str]) -> None:
    assert postures(low, ("wave", "waves")) == [("", "", ""), ("", "", "")]
    assert postures(low, ("idle", "pauses"))[1][0] != ""


@pytest.mark.parametrize(
    ("down", "posture"),
    [
        (("kneel", "kneels on one knee"), "knee"),
        (("crouch", "crouches"), "crouch"),
        (("sit-floor", "sits down on the floor"), "floor"),
        (("sit", "sits on a chair"), "seat"),
    ],
)
def test_things_are_picked_up_where_the_body_is(down: tuple[str, str], posture: str) -> None:
    rows = row_postures([down, ("pick-up", "picks up a key from the floor"), ("get-up", "stands back up")], 1)
    assert [each.own for each in rows] == [posture, posture, ""]
    assert rows[1].is_drawn
    assert rows[1].deed == LowDeed("picks")
    assert rows[2].begin == posture


def test_what_lies_on_a_table_is_picked_up_from_there() -> None:
    rows = row_postures([("sit", "sits at a desk"), ("pick-up", "picks up a pen with her left hand")], 1)
    assert rows[1].deed == LowDeed("picks", "left", high=True)


def test_legs_are_crossed_on_the_seat() -> None:
    rows = postures(("sit", "sits on a chair"), ("", "crosses her legs"), ("nod", "nods"), ("", "uncrosses her legs"))
    assert [own for _, own, _ in rows] == ["seat", "crossed", "crossed", "seat"]


def test_fists_beat_the_floor_on_the_knees() -> None:
    rows = row_postures([("kneel", "kneels down"), ("", "pounds the ground with both fists"), ("", "gets up")], 1)
    assert [each.own for each in rows] == ["knees", "knees", ""]
    assert rows[1].deed is not None
    assert row_postures([("walk", "walks"), ("idle", "beats the floor with his fists")], 1)[1].own == "knees"


def test_who_lies_rolls_over() -> None:
    rows = row_postures([("lie", "lies on his back"), ("roll", "rolls over twice"), ("roll", "rolls over")], 1)
    assert [(each.own, each.halves) for each in rows] == [("back", 0), ("back", 2), ("front", 1)]
    assert row_postures([("lie", "lies on his back"), ("roll", "does a forward roll")], 1)[1].own == ""


@pytest.mark.parametrize(
    ("dives", "posture"),
    [("dives to the left", "left-side"), ("dives to his right", "right-side"), ("dives for cover", "front")],
)
def test_who_dives_gets_up_from_where_the_dive_ends(dives: str, posture: str) -> None:
    rows = row_postures([("idle", dives), ("idle", "gets up"), ("clap", "claps")], 1)
    assert (rows[0].leaves, rows[0].end) == (posture, posture)
    assert (rows[1].begin, rows[1].is_drawn) == (posture, True)


def test_a_run_begins_in_the_crouch() -> None:
    rows = row_postures([("crouch", "crouches"), ("idle", "peeks to the left"), ("run", "runs off")], 1)
    assert [each.end for each in rows] == ["crouch", "crouch", ""]
