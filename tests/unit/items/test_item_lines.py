"""Lines of prompts as JSON, and those that hold no item."""

from __future__ import annotations

import pytest

from marey.items.item import Unreadable, read_item, read_json


@pytest.mark.parametrize(
    ("line", "key"),
    [
        ('{"prompt": "walk", "prompt": "run"}', "prompt"),
        ('{"prompt": "walk", "seed": 1, "name": "a", "seed": 1}', "seed"),
        ('{"prompt": "walk", "settings": {"steps": 1, "steps": 2}}', "steps"),
    ],
)
def test_a_key_that_is_given_twice_is_refused(line: str, key: str) -> None:
    raw = read_json(line)
    assert raw == Unreadable(f"gives {key!r} twice")
    item, (problem,) = read_item(raw, 7)
    assert (item, problem.line, key in problem.message) == (None, 7, True)


def test_a_key_of_several_objects_is_no_repetition() -> None:
    line = '{"prompt": "walk", "settings": {"prompt": 1}, "tags": [{"a": 1}, {"a": 2}]}'
    assert read_json(line) == {"prompt": "walk", "settings": {"prompt": 1}, "tags": [{"a": 1}, {"a": 2}]}
