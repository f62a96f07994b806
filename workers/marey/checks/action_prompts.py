"""Prompts for measuring what is read in them: development halves, and halves that are read as totals only."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from marey.vocabulary.flags import Flag

ReadingSet = Literal["development", "held_out"]
_UNJUDGED = frozenset(["length", "several-people"])
"""Flags that say nothing about how the actions were read."""


@dataclass(frozen=True)
class ReadingPrompt:
    """A prompt with what a person would say it asks for.

    Attributes:
        asked: ids in their order, for each action those of which one must be read.
        beside: ids that may be read as well.
        sides: for each action asked for its side: `left`, `right`, `both`; empty where any may be read.
        flags: flags that it must have, each.
        may_flags: flags that it may have as well.
    """

    text: str
    asked: tuple[frozenset[str], ...]
    beside: frozenset[str]
    sides: tuple[str, ...] = ()
    flags: frozenset[str] = frozenset()
    may_flags: frozenset[str] = frozenset()

    def is_right(self, read: Set[str]) -> bool:
        """Return True if these are the actions asked for."""
        return all(each & read for each in self.asked) and read <= self.beside.union(*self.asked)

    def is_ordered(self, read: Sequence[str]) -> bool:
        """Return True if the actions asked for are read in their order."""
        places = [min((read.index(name) for name in each if name in read), default=-1) for each in self.asked]
        return -1 not in places and places == sorted(places)

    def has_sides(self, read: Mapping[str, str]) -> bool:
        """Return True if each action asked for on a side is read with it: `read` maps ids to sides."""
        asked = zip(self.asked, self.sides, strict=False)
        return all(not side or side in {read.get(name) for name in names} for names, side in asked)

    def is_flagged(self, flags: Set[Flag]) -> bool:
        """Return True if the prompt has the flags that it must have, and no others that count."""
        return self.flags <= flags and flags <= self.flags | self.may_flags | _UNJUDGED


def reading_prompts(which: ReadingSet) -> tuple[ReadingPrompt, ...]:
    """Read one of the sets in ordinary phrasing, in the order of its file."""
    return tuple(_prompt(text, asked, beside) for text, asked, beside in _table()[which])


def kind_prompts(which: ReadingSet) -> dict[str, tuple[ReadingPrompt, ...]]:
    """Read one half of the prompts as people of a studio write them, by kind, in the order of its file."""
    return {kind: tuple(_prompt(*row) for row in rows) for kind, rows in _table()["kinds"][which].items()}


def _table() -> dict[str, Any]:
    return tomllib.loads(Path(__file__).with_name("reading_prompts.toml").read_text("utf-8"))


def _prompt(text: str, asked: str, beside: str, flags: str = "") -> ReadingPrompt:
    actions = [each.partition(":") for each in asked.split()]
    may = frozenset(flag.removesuffix("?") for flag in flags.split() if flag.endswith("?"))
    return ReadingPrompt(
        text,
        tuple(frozenset(names.split("/")) for names, _, _ in actions),
        frozenset(beside.split()),
        tuple(side for _, _, side in actions),
        frozenset(flag for flag in flags.split() if not flag.endswith("?")),
        may,
    )
