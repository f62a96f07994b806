"""Blows by their own nouns."""

from __future__ import annotations

import pytest

from marey.text.named_blows import with_blows_named


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("throws an overhand right", "throws a right punch"),
        ("a straight left to the body", "a left punch to the body"),
        ("throws a backfist", "throws a punch"),
        ("two hammer fists", "two punches"),
        ("a palm heel strike to the chin", "a punch to the chin"),
        ("throws a body shot", "throws a punch"),
        ("jab, cross, elbow", "jab, cross, elbow strike"),
        ("left hook, right elbow and a knee", "left hook, right elbow strike and a knee strike"),
    ],
)
def test_they_are_told_as_punches(text: str, told: str) -> None:
    assert with_blows_named(text) == told


@pytest.mark.parametrize(
    "text",
    [
        "walks straight right",
        "turns straight left and runs",
        "throws the ball overhand",
        "a spinning backfist",
        "bends the right elbow",
        "walks, elbow bent, and waves",
        "raises the left knee",
    ],
)
def test_other_words_stay(text: str) -> None:
    assert with_blows_named(text) == text
