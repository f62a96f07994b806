"""Prompts for measuring which actions are read in them: a development half, and one that is read as a total only."""

from __future__ import annotations

import tomllib
from collections.abc import Set
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

ReadingSet = Literal["development", "held_out"]


@dataclass(frozen=True)
class ReadingPrompt:
    """A prompt with the actions that a person would say it asks for.

    Attributes:
        asked: ids, for each action those of which one must be read.
        beside: ids that may be read as well.
    """

    text: str
    asked: tuple[frozenset[str], ...]
    beside: frozenset[str]

    def is_right(self, read: Set[str]) -> bool:
        """Return True if these are the actions asked for."""
        return all(each & read for each in self.asked) and read <= self.beside.union(*self.asked)


def reading_prompts(which: ReadingSet) -> tuple[ReadingPrompt, ...]:
    """Read one of the sets, in the order of its file."""
    table = tomllib.loads(Path(__file__).with_name("reading_prompts.toml").read_text("utf-8"))
    return tuple(
        ReadingPrompt(text, tuple(frozenset(each.split("/")) for each in asked.split()), frozenset(beside.split()))
        for text, asked, beside in table[which]
    )
