"""Prompts of evaluations and what they expect."""

from __future__ import annotations

from typing import get_args

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.checks.judge import Act, Side
from marey.core.errors import InvalidInput, TooLarge
from marey.items.evaluation_prompts import MAX_PROMPTS, EvaluationPrompt, prompts_of, prompts_sha256, read_prompts
from marey.items.expected import ACTIONS, SIDED, TRAVELS, ExpectedAction, read_expected
from marey.items.problems import InvalidItems

actions = st.one_of(
    st.builds(ExpectedAction, st.sampled_from(TRAVELS), st.just(""), st.booleans()),
    st.sampled_from([ExpectedAction("turn", side) for side in SIDED["turn"]]),
    st.builds(ExpectedAction, st.sampled_from(["wave", "raise"]), st.sampled_from(["", *SIDED["wave"]])),
    st.builds(ExpectedAction, st.sampled_from(["bow", "kick", "dance"])),
)


def test_the_acts_and_sides_are_those_that_can_be_judged() -> None:
    assert set(ACTIONS) == set(get_args(Act))
    assert {side for sides in SIDED.values() for side in sides} | {""} == set(get_args(Side))


@given(st.lists(actions, min_size=1, max_size=4).map(tuple))
def test_what_is_expected_is_read_back_as_it_was_written(expected: tuple[ExpectedAction, ...]) -> None:
    words = (" ".join(filter(None, (a.action, a.side, "straight" if a.straight else ""))) for a in expected)
    assert read_expected(" then ".join(words)) == expected


def test_capitals_and_blanks_do_not_matter() -> None:
    assert read_expected("  Walk STRAIGHT then  wave left ") == (
        ExpectedAction("walk", straight=True),
        ExpectedAction("wave", "left"),
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "missing"),
        ("walk then", "missing"),
        ("then walk", "missing"),
        ("fly", "'fly' is not an action; known: walk"),
        ("walk, wave", "'walk,' is not an act"),
        ("walk left", "'left' does not belong to 'walk'; it may have straight"),
        ("walk straight straight", "'straight' does not belong"),
        ("wave left right", "'right' does not belong to 'wave'"),
        ("turn both", "'both' does not belong to 'turn'; it may have left or right"),
        ("turn", "needs its side"),
        ("bow twice", "'twice' does not belong"),
        ("walk then walk then walk then walk then walk", "over the limit of 4"),
    ],
)
def test_what_cannot_be_judged_is_refused_in_words(text: str, said: str) -> None:
    with pytest.raises(InvalidInput, match=said):
        read_expected(text)


def test_every_bad_line_is_told_with_its_number() -> None:
    raws = [
        (2, {"prompt": "a person walks", "expected": "fly"}),
        (3, {"prompt": "a person runs", "seed": 3}),
        (4, {"prompt": "", "seconds": 100}),
        (5, {"prompt": "a person waves"}),
    ]
    with pytest.raises(InvalidItems) as caught:
        read_prompts(raws)
    assert [(p.line, p.field) for p in caught.value.problems] == [
        (2, "expected"), (3, "seed"), (4, "prompt"), (4, "seconds"),
    ]  # fmt: skip
    assert "known: prompt, seconds, expected" in caught.value.problems[1].message


def test_one_prompt_is_too_few_and_ten_thousand_and_one_too_many() -> None:
    with pytest.raises(InvalidInput, match="more than one prompt"):
        read_prompts([(1, {"prompt": "a person walks"})])
    with pytest.raises(InvalidInput, match="no prompt"):
        read_prompts([])
    many = [(n, {"prompt": "a person walks"}) for n in range(MAX_PROMPTS + 1)]
    assert len(read_prompts(many[1:])) == MAX_PROMPTS
    with pytest.raises(TooLarge, match="more than 10,000 prompts"):
        read_prompts(many)


TIMELINE = "0-3 a person walks; 3-5 a person waves"
PATH = [{"type": "root_path", "times": [0, 3], "positions_xz": [[0, 0], [0, 3]]}]


def test_timelines_and_constraints_are_read_as_those_of_items_and_back() -> None:
    raws = [(1, {"timeline": TIMELINE, "seconds": 5}), (2, {"prompt": "a person walks", "constraints": PATH})]
    first, second = read_prompts(raws)
    assert (first.prompt, first.seconds, len(first.timeline or ())) == (TIMELINE, None, 2)
    assert second.constraints is not None
    assert second.constraints[0]["positions_xz"] == [[0.0, 0.0], [0.0, 3.0]]
    rows = [first.as_json(), second.as_json()]
    assert [set(row) for row in rows] == [{"timeline"}, {"prompt", "constraints"}]
    assert prompts_of(rows) == (first, second) == read_prompts(enumerate(rows, 1))
    plain = EvaluationPrompt("a person walks")
    assert prompts_sha256([second]) != prompts_sha256([plain])


def test_problems_of_timelines_and_constraints_name_their_field() -> None:
    pose = [{"type": "pose_keyframe", "frame": 3, "motion": {"id": "0" * 32, "frame": 0}}]
    raws = [
        (1, {"timeline": TIMELINE, "expected": "walk"}),
        (2, {"timeline": TIMELINE, "prompt": "a person walks"}),
        (3, {"timeline": "0-3 a person walks; 2-5 a person waves"}),
        (4, {"prompt": "a person walks", "constraints": [{"type": "fly"}]}),
        (5, {"prompt": "a person walks", "constraints": pose}),
        (6, {"seconds": 3}),
    ]
    with pytest.raises(InvalidItems) as caught:
        read_prompts(raws)
    assert [(p.line, p.field) for p in caught.value.problems] == [
        (1, "expected"), (2, "prompt"), (3, "timeline"), (4, "constraints.0.type"), (5, "constraints.0.motion"),
        (6, "prompt"),
    ]  # fmt: skip
    assert "whose rows are judged by their prompts" in caught.value.problems[0].message


def test_the_digest_is_that_of_prompts_lengths_expectations_and_order() -> None:
    one, other = EvaluationPrompt("walk", 2.0, "walk"), EvaluationPrompt("run")
    same = prompts_of([one.as_json(), other.as_json()])
    assert same == (one, other)
    assert prompts_sha256(same) == prompts_sha256([one, other])
    different = [
        [other, one],
        [one],
        [EvaluationPrompt("walk", 3.0, "walk"), other],
        [EvaluationPrompt("walk", 2.0), other],
        [EvaluationPrompt("walk on", 2.0, "walk"), other],
    ]
    assert len({prompts_sha256(prompts) for prompts in [same, *different]}) == 6
