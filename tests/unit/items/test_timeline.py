"""Timelines of prompts: their two forms, and what is refused."""

from __future__ import annotations

import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.items.item import read_item
from marey.items.timeline import MIN_ROW_SECONDS, read_timeline, timeline_text

WALK = {"start": 0, "end": 3, "prompt": "a person walks"}
WAVE = {"start": 3, "end": 5, "prompt": "a person waves"}


@st.composite
def timelines(draw: st.DrawFn) -> list[dict[str, Any]]:
    """Rows in any order, some with gaps between."""
    at, rows = 0, list[dict[str, Any]]()
    for _ in range(draw(st.integers(1, 6))):
        end = at + draw(st.integers(round(MIN_ROW_SECONDS * 1000), 8000))
        words = draw(
            st.text(st.characters(codec="ascii", exclude_characters=";", categories=("L", "P", "N")), max_size=20)
        )
        first = draw(st.sampled_from(("walk", "s", "S", "3", "-", "s-walk a", "5 s. walk")))
        prompt = f"{first} {words}".strip()
        rows.append({"start": at / 1000, "end": end / 1000, "prompt": prompt if prompt[0] == "w" else f"{prompt} it"})
        at = end + draw(st.sampled_from((0, 0, 500, 1234)))
    return draw(st.permutations(rows))


@given(timelines())
def test_the_text_form_reads_as_the_rows_that_it_was_made_from(rows: list[dict[str, Any]]) -> None:
    read = read_timeline(rows)
    assert read == sorted(rows, key=lambda row: row["start"])
    assert read_timeline(timeline_text(read)) == read
    assert timeline_text(read_timeline(timeline_text(read))) == timeline_text(read)


@given(st.text(max_size=60) | st.recursive(st.none() | st.floats() | st.text(max_size=5), st.lists) | st.integers())
def test_anything_else_is_refused_in_words(value: object) -> None:
    try:
        read_timeline(value)
    except InvalidInput:
        return
    assert isinstance(value, str)


@pytest.mark.parametrize(
    "text",
    [
        "0-3 a person walks; 3-5 a person waves",
        " 0 - 3s: a person walks ;3.0–5.000, a  person waves;",
        "3-5 a person waves; 0-3 a person walks",
        "0:00-0:03 a person walks; 0:03-0:05 a person waves",
        "0:00 – 00:03.000: a person walks; 3-0:05: a person waves",
    ],
)
def test_times_are_read_in_any_way_that_they_are_written(text: str) -> None:
    assert read_timeline(text) == [WALK, WAVE]
    assert timeline_text(read_timeline(text)) == "0-3 a person walks; 3-5 a person waves"


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("a person walks", "row 1, 'a person walks', has no times"),
        ("0-3 walk; then wave", "row 2, 'then wave', has no times"),
        ("", "is empty"),
        ([], "has no rows"),
        ("0-3 walk; 2-5 wave", "row 1 (0-3) overlaps row 2 (2-5)"),
        ("2-5 wave; 0-3 walk", "row 2 (0-3) overlaps row 1 (2-5)"),
        ("0-3 walk; 3-3.5 wave", "row 2 (3-3.5) is shorter than 1 s"),
        ("0-3 walk; 5-4 wave", "row 2 (5-4) ends before it begins"),
        ("1-3 walk", "row 1 (1-3) is the first and begins at 1; begin at 0"),
        ("0-61 walk", "row 1 (0-61) ends after 60 s"),
        ("0:00-1:01 walk", "row 1 (0-61) ends after 60 s"),
        ("0:00-0:63 walk", "row 1, '0:00-0:63 walk', has no times"),
        ("0:00:00-0:00:03 walk", "row 1, '0:00:00-0:00:03 walk', has no times"),
        ("0-3", "row 1 has no prompt"),
        ("0-3 走る", "row 1: the prompt has no English words"),
        ([{"start": 0, "end": 3, "prompt": "walk; wave"}], "row 1: the prompt holds ';'"),
        ([{"start": 0, "end": 3, "prompt": "walk\u037e 3-5 wave"}], "row 1: the prompt holds ';'"),
        ([{"start": 0, "end": 3, "prompt": " :, "}], "row 1 has no prompt"),
        ("0-" + "9" * 400 + " walk", "row 1 ends after 60 s"),
        ([{"start": 0, "end": "3", "prompt": "walk"}], "row 1: end is not a number"),
        ([{"start": 0, "end": True, "prompt": "walk"}], "row 1: end is not a number"),
        ([{"start": -1, "end": 3, "prompt": "walk"}], "row 1 begins at -1"),
        ([{**WALK, "seed": 3}], "row 1: 'seed' is not a known field"),
        ([WALK, {"start": 3, "end": 5}], "row 2: prompt is not a text"),
        ([WALK, "wave"], "row 2 is not an object"),
        ([WALK] * 61, "has 61 rows"),
        (7, "is not a timeline"),
    ],
)
def test_problems_name_the_row(value: object, message: str) -> None:
    with pytest.raises(InvalidInput) as error:
        read_timeline(value)
    assert error.value.message.startswith(message)


def test_times_of_minutes_go_up_to_the_longest_timeline() -> None:
    (row,) = read_timeline("0:00-1:00 a person walks")
    assert (row["start"], row["end"]) == (0, 60)
    (row,) = read_timeline("0-3: 30 steps are walked")
    assert (row["end"], row["prompt"]) == (3, "30 steps are walked")


def test_what_stands_between_times_and_prompt_is_no_part_of_it() -> None:
    assert read_timeline([{"start": 0, "end": 3, "prompt": ", : a person walks"}]) == [WALK]


@pytest.mark.parametrize("text", ["0" + " " * 19_000, "0-3" + " " * 19_000 + "-", "0 s" + " " * 19_000, "1" * 19_000])
def test_a_long_text_is_read_in_time_that_grows_with_its_length(text: str) -> None:
    """Spaces that two parts of the pattern share made it grow with the square: ten seconds for this."""
    started = time.process_time()
    with pytest.raises(InvalidInput):
        read_timeline(text)
    assert time.process_time() - started < 1


def test_an_item_with_a_timeline_has_its_text_as_the_prompt() -> None:
    item, problems = read_item({"timeline": [WALK, WAVE], "seed": 3})
    assert problems == []
    assert item is not None
    assert (item.prompt, item.seconds) == ("0-3 a person walks; 3-5 a person waves", None)
    assert item.as_json() == {"timeline": [WALK, WAVE], "seed": 3, "variants": 1}
    assert read_item(item.as_json()) == (item, [])


@pytest.mark.parametrize(
    ("more", "field", "message"),
    [
        ({"prompt": "a person walks"}, "prompt", "stands beside a timeline: give one of the two"),
        ({"seconds": 4}, "seconds", "4 is not the end of the timeline, 5: leave it out"),
        ({"timeline": "walk"}, "timeline", "row 1, 'walk', has no times"),
    ],
)
def test_what_does_not_go_with_a_timeline_is_refused(more: dict[str, object], field: str, message: str) -> None:
    item, (problem,) = read_item({"timeline": [WALK, WAVE], **more}, 4)
    assert item is None
    assert (problem.line, problem.field) == (4, field)
    assert problem.message.startswith(message)


def test_the_seconds_of_a_timeline_may_be_said_again() -> None:
    item, _ = read_item({"timeline": [WALK, WAVE], "seconds": 5})
    assert item is not None
    assert item.seconds is None


def test_an_item_needs_a_prompt_or_a_timeline() -> None:
    item, (problem,) = read_item({"seed": 3})
    assert (item, problem.field) == (None, "prompt")
