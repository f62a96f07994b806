"""Verbs that no reader knows, told by those of the vocabulary."""

from __future__ import annotations

import pytest

from marey.text.known_verbs import with_known_verbs


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("backpedals six steps", "walks backward six steps"),
        ("he is backpedaling fast", "he is walking backward fast"),
        ("back-pedals backwards", "walks backward"),
        ("waddles like a penguin", "walks in tiny steps like a penguin"),
        ("a toddler toddles forward", "a toddler walks in tiny steps forward"),
        ("weaves his way forward", "walks forward"),
        ("weaves his way through the crowd", "weaves his way through the crowd"),
        ("power-walks home", "walks quickly home"),
        ("a power-walk", "a power-walk"),
        ("freezes on the spot", "stands still on the spot"),
        ("the man freezes with both arms raised", "the man stands still with both arms raised"),
        ("he freezes in the cold", "he freezes in the cold"),
        ("a freezing man stands", "a freezing man stands"),
        ("plonks himself down on a chair", "sits down on a chair"),
        ("slumps heavily into the armchair", "sits down heavily into the armchair"),
        ("throws a ball onto the chair", "throws a ball onto the chair"),
        ("a drop onto the bench", "a drop onto the bench"),
    ],
)
def test_unknown_verbs_are_told_by_known_ones(prompt: str, read: str) -> None:
    assert with_known_verbs(prompt) == read
