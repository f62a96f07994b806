"""Gestures in a posture that is told beside them."""

from __future__ import annotations

import pytest

from marey.text.beside_postures import with_posture_first


@pytest.mark.parametrize(
    ("prompt", "told"),
    [
        ("a knight bows while kneeling", "a knight is kneeling, then bows"),
        ("bows, sitting on a chair.", "is sitting on a chair, then bows."),
        ("she bows twice as she is sitting", "she is sitting, then bows twice"),
        ("a crouched archer looses an arrow", "an archer is crouched, then looses an arrow"),
        ("The seated old man waves", "The old man is seated, then waves"),
        ("a crouching soldier fires his rifle", "a soldier is crouching, then fires his rifle"),
        ("sits and points ahead", "sits, then points ahead"),
        ("fires a pistol from one knee", "is kneeling on one knee, then fires a pistol"),
        ("throws a grenade from a crouch", "is crouching, then throws a grenade"),
        ("stands up from a kneeling position", "is kneeling, then stands up"),
    ],
)
def test_the_posture_comes_first(prompt: str, told: str) -> None:
    assert with_posture_first(prompt) == told


@pytest.mark.parametrize(
    "prompt",
    [
        "walks while crouching",
        "a seated man stands up",
        "stands up from a sitting position",
        "a kneeling knight stands up and bows",
        "waves while sitting",  # drawn on the seat as a bearing
        "a soldier aims a rifle while kneeling",
        "sits and stands up again",
        "kneels and lies down",
        "bows and waves while sitting, then leaves",
    ],
)
def test_other_prompts_stay(prompt: str) -> None:
    assert with_posture_first(prompt) == prompt
