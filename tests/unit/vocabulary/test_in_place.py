"""Gaits that go nowhere, as prompts tell them."""

from __future__ import annotations

import pytest

from marey.vocabulary.courses import stated_course
from marey.vocabulary.in_place import goes_in_place


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("the goalkeeper jogs lightly on the spot", "run"),
        ("A cadet marches in place", "walk"),
        ("running in one place to keep warm", "run"),
        ("in place, she trots", "run"),
        ("stationary jog, nervous", "run"),
        ("a nurse walks on a treadmill", "walk"),
        ("he strides without moving forward", "walk"),
        ("high knees on the spot", "run"),
        ("does high knees for 4 s", "run"),
        ("they sprint in the same spot", "sprint"),
    ],
)
def test_gaits_in_place(prompt: str, action: str) -> None:
    assert goes_in_place(prompt, action)
    assert stated_course(prompt, action) is None


@pytest.mark.parametrize(
    ("prompt", "action"),
    [
        ("walks and turns in place", "walk"),
        ("he runs, stops and stands on the spot", "run"),
        ("walks to the place where the dog sleeps", "walk"),
        ("a hiker walks in a place of beauty", "walk"),
        ("she walks in place of her brother", "walk"),
        ("walks over and puts the vase in place", "walk"),
        ("runs to one spot on the stage", "run"),
        ("dances on the spot", "dance"),
    ],
)
def test_ways_go_somewhere(prompt: str, action: str) -> None:
    assert not goes_in_place(prompt, action)
