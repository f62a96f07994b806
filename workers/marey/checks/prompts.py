"""Held-out prompts with the expected motion of each, in four sets by four authors.

`prompts.toml` are the 200 that goals are set on. `prompts_blind.toml` is a held-out set by an author without access to
the training captions or the first set; it is never used for selection. `prompts_development.toml`, by a third author,
is the set for choosing settings, weights and data. `prompts_fresh.toml`, by a fourth author, has two actions in two
thirds of its prompts; it is never used for selection either."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from marey.checks.judge import Expectation


@dataclass(frozen=True)
class HeldOutPrompt:
    """A held-out prompt.

    Attributes:
        text: as a user types it.
        group: its row in reports.
        expected: actions in order.
        separate: reported apart from the rest (kick, punch, slash, dance).
    """

    text: str
    group: str
    expected: tuple[Expectation, ...]
    separate: bool

    @property
    def sided(self) -> bool:
        """True if a single action with a side or hand is expected."""
        return len(self.expected) == 1 and self.expected[0].side != ""


PromptSet = Literal["evaluation", "blind", "development", "fresh"]
_FILES = {
    "evaluation": "prompts",
    "blind": "prompts_blind",
    "development": "prompts_development",
    "fresh": "prompts_fresh",
}


@lru_cache(maxsize=4)
def evaluation_prompts(which: PromptSet = "evaluation") -> tuple[HeldOutPrompt, ...]:
    """One of the sets, in the order of its file."""
    name = f"{_FILES[which]}.toml"
    table: dict[str, Any] = tomllib.loads(Path(__file__).with_name(name).read_text("utf-8"))
    return tuple(
        HeldOutPrompt(
            text, group["name"], tuple(Expectation(**row) for row in group["expect"]), group.get("separate", False)
        )
        for group in table["group"]
        for text in group["prompts"]
    )
