"""How often a prompt asks for its action."""

from __future__ import annotations

import pytest

from marey.reading.texts import manner_texts
from marey.vocabulary.counts import MOST, stated_count, stated_things


@pytest.mark.parametrize(
    ("prompt", "action", "count"),
    [
        ("A man squats twice.", "squat", 2),
        ("jump three times", "jump", 3),
        ("Two squats, nice and deep", "squat", 2),
        ("five quick push-ups", "push-ups", 5),
        ("claps his hands once to get attention", "clap", 1),
        ("bows exactly once", "bow", 1),
        ("squat x5", "squat", 5),
        ("3x jump", "jump", 3),
        ("reps: five, squat", "squat", 5),
        ("a couple of kicks", "kick", 2),
        ("a pair of bows", "bow", 2),
        ("half a dozen kicks", "kick", 6),
        ("a single jab", "punch", 1),
        ("triple punch", "punch", 3),
        ("two arm circles", "arm-circles", 2),
        ("clap clap clap", "clap", 3),
        ("puts his hand up on two occasions", "raise-arm", 2),
    ],
)
def test_numbers_of_the_action_are_read(prompt: str, action: str, count: int) -> None:
    assert stated_count(prompt, action) == count


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("jumps", "jump"),
        ("jumps several times", "jump"),
        ("waves with two hands", "clap"),
        ("jumps for three seconds", "jump"),
        ("bows, once the king has passed", "bow"),
        ("bows at once", "bow"),
        ("jumps twice as high", "jump"),
        ("kicks at the man in the number 9 jersey", "kick"),
        ("claps two or three times", "clap"),
        ("two to four squats", "squat"),
        ("squats at 2x speed", "squat"),
        (f"jumps {MOST + 1} times", "jump"),
        ("jumps 0 times", "jump"),
    ],
)
def test_other_numbers_are_not(prompt: str, action: str) -> None:
    assert stated_count(prompt, action) is None


def test_nineteen_of_twenty_texts_are_read_as_their_author_meant_them() -> None:
    texts = manner_texts()
    right = sum(stated_count(each.text, each.action) == each.count for each in texts)
    assert right >= 0.95 * len(texts)


@pytest.mark.parametrize(
    ("prompt", "count"),
    [
        ("goes up three steps", 3),
        ("climbs 12 steep stairs", 12),
        ("descends a dozen steps", 12),
        ("climbs the stairs", None),
        ("two men go up the stairs", None),
        ("three steps up, four steps down", None),
    ],
)
def test_numbers_of_things_are_read(prompt: str, count: int | None) -> None:
    assert stated_things(prompt, {"steps", "stairs"}) == count


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("two-handed axe swing", "slash"),
        ("a two handed sword slash", "slash"),
        ("one-armed push-ups", "push-ups"),
        ("a two-footed jump", "jump"),
        ("double-edged sword slash", "slash"),
    ],
)
def test_a_number_of_an_adjective_is_none_of_the_action(prompt: str, action: str) -> None:
    assert stated_count(prompt, action) is None
