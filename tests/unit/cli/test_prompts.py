"""Prompts of the command line: from arguments or from a file, never the name of a file as a prompt."""

from __future__ import annotations

import pytest

from marey.cli.commands.submit import read_prompts
from marey.core.errors import InvalidInput


@pytest.mark.parametrize("name", ["shots.csv", "lists/shots.JSONL", "shots.txt", "shots.csv.gz"])
def test_the_name_of_a_file_is_refused_as_a_prompt(name: str) -> None:
    with pytest.raises(InvalidInput, match="is a file name, not a prompt") as raised:
        read_prompts(["a person walks", name], None, None)
    assert raised.value.where == name
    assert raised.value.hint == f"Give it with -f: `-f {name}`."


def test_words_that_end_like_a_file_are_a_prompt() -> None:
    reader = read_prompts(["a person walks to shots.csv"], None, None)
    assert [item.prompt for item in reader] == ["a person walks to shots.csv"]
