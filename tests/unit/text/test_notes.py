"""Notes of animators, told as what is done."""

from __future__ import annotations

import pytest

from marey.text.notes import with_notes_told


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("prone to crouch to stand", "lies prone, then crouches, then stands up"),
        ("Prone to stand", "lies prone, then gets up"),
        ("stand to crouch to prone", "stands, then crouches, then lies down prone"),
        ("standing to kneeling", "kneels down"),
        ("sit -> stand", "sits, then stands up"),
        ("lying to sitting to standing", "lies, then sits upright, then stands up"),
        ("crouching into prone", "crouches, then lies down prone"),
    ],
)
def test_postures_that_lead_to_each_other_are_in_their_order(prompt: str, read: str) -> None:
    assert with_notes_told(prompt) == read


@pytest.mark.parametrize(
    ("prompt", "read"),
    [
        ("walks to the door, turns and returns", "walks to the door, turns around and walks back"),
        ("walks off, turns around, comes back", "walks off, turns around, walks back"),
        ("a model walks in, poses, turns and returns", "a model walks in, then stops, turns around and walks back"),
        ("strut forward, strike a pose", "strut forward, then stop"),
        ("rolls out of bed and stretches", "gets out of bed and stretches"),
        ("shades his eyes to follow the ball", "shades his eyes"),
        ("salutes to greet the general, then sits down", "salutes, then sits down"),
        ("sprint then slide to a halt", "sprint and slide to a halt"),
        ("runs, then skids to a stop", "runs and slides to a stop"),
        ("pulls out a gun and fires", "draws a gun and fires"),
    ],
)
def test_notes_are_told_as_what_is_done(prompt: str, read: str) -> None:
    assert with_notes_told(prompt) == read


@pytest.mark.parametrize(
    "prompt",
    [
        "goes from the chair to the door",
        "sits next to a man",
        "turns and returns the ball",
        "poses as a statue",
        "rolls out of the way",
        "raises his hand to catch the ball",
        "jogs in, skids to a stop, looks up",
        "takes out the trash",
        "walks to work",
    ],
)
def test_other_prompts_stay(prompt: str) -> None:
    assert with_notes_told(prompt) == prompt
