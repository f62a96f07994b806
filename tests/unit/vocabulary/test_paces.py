"""The pace at which a prompt asks for its action."""

from __future__ import annotations

import pytest

from marey.reading.texts import manner_texts
from marey.vocabulary.paces import stated_pace


@pytest.mark.parametrize(
    "prompt",
    [
        "she bows slowly",
        "a slow bow",
        "sits down without any haste",
        "taking her own sweet time she sits down",
        "punches in slow motion",
        "a wave at a very leisurely pace",
        "at a leisurely pace she bows",
        "a leisurely walk",
        "waves at half speed",
        "kicks, 25 % of normal",
        "sloooowly he turns",
        "bows at a snail’s pace",
        "not fast: he claps",
    ],
)
def test_slow(prompt: str) -> None:
    assert stated_pace(prompt) == "slow"


@pytest.mark.parametrize(
    "prompt",
    [
        "she bows quickly",
        "a quick, clean kick",
        "turns around in the blink of an eye",
        "claps, rapid-fire tempo",
        "2x speed wave",
        "squats at a dizzying pace",
        "sits down in great haste",
        "Quick as a flash, he turns",
    ],
)
def test_fast(prompt: str) -> None:
    assert stated_pace(prompt) == "fast"


@pytest.mark.parametrize(
    "prompt",
    [
        "she bows",
        "a fast car passes while he waves",
        "after the slow song she claps",
        "waves to the slowly rising sun",
        "presses the fast forward button",
        "a slowpoke waves",
        "first slowly, then quickly, he claps",
        "waves at normal speed",
    ],
)
def test_no_pace_of_the_action(prompt: str) -> None:
    assert stated_pace(prompt) == ""


def test_nine_of_ten_texts_with_a_pace_are_read_and_few_of_those_that_speak_of_other_things() -> None:
    with_pace = [each for each in manner_texts() if each.pace]
    without = [each for each in manner_texts() if not each.pace]
    assert sum(stated_pace(each.text) == each.pace for each in with_pace) >= 0.9 * len(with_pace)
    assert sum(stated_pace(each.text) == "" for each in without) >= 0.85 * len(without)
