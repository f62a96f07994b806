"""Fists that punch the air for joy."""

from __future__ import annotations

import pytest

from marey.text.punched_air import with_pumped_fists


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("she punches the air in triumph", "she pumps a fist in the air in triumph"),
        ("leaping up and punching the air", "leaping up and pumping a fist in the air"),
        ("they punch the sky with both fists", "they pump both fists in the air"),
        ("The striker punched the air with his left hand.", "The striker pumped a left fist in the air."),
        ("punches at the air after the goal", "pumps a fist in the air after the goal"),
    ],
)
def test_a_fist_is_pumped(text: str, told: str) -> None:
    assert with_pumped_fists(text) == told


@pytest.mark.parametrize(
    "text",
    [
        "a boxer punches the air",
        "she punches the air",
        "punches the air in front of her",
        "punches the air with jabs and hooks",
        "punches the airbag",
        "shadow boxing, she punches the air",
        "punches the air repeatedly",
        "punches the wall",
    ],
)
def test_a_blow_stays(text: str) -> None:
    assert with_pumped_fists(text) == text
