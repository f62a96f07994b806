"""Prompts whose action the reader is unsure of."""

from __future__ import annotations

import pytest

from marey.text.action_reader import ReadAction
from marey.text.readings import GUESSED, UNSPLIT, likeliest
from marey.vocabulary.bearing_words import as_written


@pytest.mark.parametrize(
    ("prompt", "action", "read"),
    [
        ("praying, palms pressed together", "kneel", "kneel"),
        ("she waves at the crowd", "wave", "wave"),
        ("she waves at the crowd", "kneel", None),  # the words name another one
        ("an old chair falls over", "get-up", None),  # no body acts
    ],
)
def test_an_unsure_action_is_read_where_words_name_no_other_one(prompt: str, action: str, read: str | None) -> None:
    unsure = (GUESSED + UNSPLIT) / 2
    assert likeliest(as_written(prompt), ReadAction(action, unsure)) == read
    assert likeliest(as_written(prompt), ReadAction(action, UNSPLIT)) == action
    assert likeliest(as_written(prompt), ReadAction(action, GUESSED - 0.01)) is None
