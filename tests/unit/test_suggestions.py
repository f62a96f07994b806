"""Known names that a mistyped one means."""

from __future__ import annotations

import pytest

from marey.core.suggestions import LONGEST, did_you_mean, nearest
from marey.items.item import COLUMNS


@pytest.mark.parametrize(
    ("name", "known"),
    [
        ("Prompt", "prompt"),
        ("promt", "prompt"),
        (" PROMPTS ", "prompt"),
        ("secnds", "seconds"),
        ("tag", "tags"),
        ("variatns", "variants"),
    ],
)
def test_a_name_that_differs_by_case_or_a_letter_is_meant(name: str, known: str) -> None:
    assert nearest(name, COLUMNS) == known
    assert did_you_mean(name, COLUMNS) == f" (did you mean {known!r}?)"


@pytest.mark.parametrize("name", ["", "scene", "colour", "duration", "p" * (LONGEST + 1)])
def test_another_name_means_none(name: str) -> None:
    assert nearest(name, COLUMNS) is None
    assert did_you_mean(name, COLUMNS) == ""


def test_swapped_letters_and_the_case_of_the_known_name() -> None:
    assert nearest("fsp", ["seed", "fps"]) == "fps"
    assert nearest("europe/berlin", ["Europe/Berlin"]) == "Europe/Berlin"
