"""Sentences that tell first what is done last."""

from __future__ import annotations

import pytest

from marey.text.time_order import in_time_order


@pytest.mark.parametrize(
    ("prompt", "told"),
    [
        ("A thief stabs and retreats after sneaking up.", "A thief sneaks up, then stabs and retreats."),
        ("The maid kneels when she has finished waving.", "The maid waves, then kneels."),
        ("He bows, but first he waves.", "he waves, then he bows."),
        ("sit-ups, but push-ups first", "push-ups, then sit-ups"),
        ("The sit-ups follow the push-ups.", "the push-ups, then the sit-ups."),
        ("the laugh comes after the jump", "the jump, then the laugh"),
        ("She claps before standing up.", "She claps, then stands up."),
        (
            "Before kicking the ball he runs up, and afterwards he cheers.",
            "he runs up, then kicks the ball, then he cheers.",
        ),
        ("He waves as soon as he has jumped.", "He waves once he has jumped."),
        ("She sits down on the bench to drink.", "She sits down on the bench, then drinks."),
        ("steps to the right before bowing", "steps to the right, then bows"),
        ("sit down to read", "sit down, then read"),
    ],
)
def test_what_is_done_first_is_told_first(prompt: str, told: str) -> None:
    assert in_time_order(prompt) == told


@pytest.mark.parametrize(
    "prompt",
    [
        "a dog follows the man",
        "he follows the path",
        "he looks back",
        "she walks but never turns first",
        "he walks before the king",
        "she waves after him",
        "sits down to the left",
        "she almost falls, but catches herself",
        "leaps and turns to the right before landing",
    ],
)
def test_other_sentences_stay(prompt: str) -> None:
    assert in_time_order(prompt) == prompt
