"""Negations that tell an order of movements."""

from __future__ import annotations

import pytest

from marey.text.negated_order import without_negated_order


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("runs off, but not before waving at us", "runs off, but only after waving at us"),
        ("Not until he bows does he sit", "Only after he bows does he sit"),
        ("he won't take his seat until he has bowed", "he takes his seat only after he has bowed"),
        ("he refuses to pass till she nods", "he passes only after she nods"),
        ("push-ups until he can't any more", "push-ups until he is tired"),
    ],
)
def test_an_order_is_told_without_a_negation(prompt: str, read: str) -> None:
    assert without_negated_order(prompt) == read


@pytest.mark.parametrize(
    "prompt",
    [
        "she won't stop clapping until she sits down",
        "he doesn't run but walks",
        "the dog is not before the house",
        "he runs until he can see the gate",
    ],
)
def test_other_prompts_stay_as_they_are(prompt: str) -> None:
    assert without_negated_order(prompt) == prompt
