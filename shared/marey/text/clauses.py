"""A run of a prompt's words, and the word lists that separate actions."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

_FILE: dict[str, Any] = tomllib.loads(Path(__file__).with_name("actions.toml").read_text("utf-8"))
DOING = {noun: verb for verb, nouns in _FILE.pop("doing").items() for noun in nouns}
"""How what a noun says is done: "walk" is what one takes."""
LISTS: dict[str, list[str]] = _FILE
SUBJECTS, SIDES = frozenset(LISTS["subjects"]), frozenset(LISTS["sides"])
LIMBS = frozenset({"hand", "hands", "arm", "arms"})
STOPS = ",;:."


@dataclass(frozen=True)
class Clause:
    """A run of the prompt's words, the verbs among them by number."""

    words: tuple[str, ...]
    verbs: frozenset[int]

    def __len__(self) -> int:
        return len(self.words)

    def bare(self, index: int) -> str:
        return self.bares[index] if 0 <= index < len(self.words) else ""

    def stopped(self, index: int, stops: str = STOPS) -> bool:
        """Return True if a stop follows the word, or the word is the first."""
        return index < 0 or self.words[index][-1:] in stops

    def cut(self, start: int, stop: int | None = None) -> Clause:
        stop = len(self) if stop is None else stop
        return Clause(self.words[start:stop], frozenset(v - start for v in self.verbs if start <= v < stop))

    def is_verb(self, index: int) -> bool:
        return index in self.verbs

    @cached_property
    def bares(self) -> list[str]:
        """Each word in lower case without punctuation; cached, since every connective needs it."""
        return [word.strip(".,;:!?\"'()").lower() for word in self.words]
