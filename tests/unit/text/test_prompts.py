"""Validation of prompts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.items.prompts import MAX_WORDS, check_prompt


@pytest.mark.parametrize(
    ("prompt", "expected"),
    [
        ("  a person\twalks \n forward ", "a person walks forward"),
        ("A PERSON WALKS", "A PERSON WALKS"),
        ("cafe\u0301 walk", "café walk"),
        ("a person waves 👋🏽 happily", "a person waves 👋🏽 happily"),
        ("une personne marche", "une personne marche"),
    ],
)
def test_a_usable_prompt_is_normalised(prompt: str, expected: str) -> None:
    assert check_prompt(prompt) == expected


@pytest.mark.parametrize(
    ("prompt", "says"),
    [
        ("", "empty"),
        (" \t\n\u3000", "empty"),
        ("a person\x00walks", "NUL"),
        ("a person\x1bwalks", "U+001B"),
        ("walk \ud83d", "surrogate"),
        ("👋🏽 🕺", "no English words"),
        ("12 345", "no English words"),
        ("一个人向前走", "no English words"),
        ("человек идёт вперёд", "no English words"),
        ("walk " * 10_000, "10,000 words"),
        ("x" * 101, "101 characters"),
        ("ab " * 199 + "c" * 90 + " " + "walking " * 200, "words"),
        ("walk" * 1_000_000, "characters"),
    ],
)
def test_an_unusable_prompt_says_why_and_what_to_do(prompt: str, says: str) -> None:
    with pytest.raises(InvalidInput, match=r"prompt|word") as caught:
        check_prompt(prompt, where="line 7")
    assert says in caught.value.message
    assert caught.value.where == "line 7"
    assert caught.value.hint
    assert len(str(caught.value)) < 400, "the message does not repeat the prompt"


def test_the_limit_of_words_is_exact() -> None:
    check_prompt("walk " * MAX_WORDS)
    with pytest.raises(InvalidInput):
        check_prompt("walk " * (MAX_WORDS + 1))


@given(st.text(max_size=300))
def test_any_text_is_normalised_once_or_refused(prompt: str) -> None:
    try:
        checked = check_prompt(prompt)
    except InvalidInput:
        return
    assert checked == check_prompt(checked)
    assert checked.encode("utf-8")
    assert checked.split() == checked.split(" ")


@pytest.mark.parametrize("control", ["\u202e", "\u2066", "\x9b", "\x1c"])
def test_a_prompt_that_an_earlier_release_accepted_is_still_read(control: str) -> None:
    prompt = f"a person{control} walks"
    with pytest.raises(InvalidInput, match=f"U\\+{ord(control):04X}"):
        check_prompt(prompt)
    assert check_prompt(prompt, stored=True).replace(control, "") == "a person walks"
