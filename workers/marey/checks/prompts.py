"""Prompts that training never saw and what each motion must do, in four sets by four authors.

`prompts.toml` are the 200 that bars are set on; `prompts_blind.toml` was written by somebody who knew neither the
training captions nor those, and nothing is ever chosen by it; `prompts_development.toml` by a third one in the same
way: settings, weights and data are chosen by it. `prompts_fresh.toml`, by a fourth, asks for two actions in two thirds
    of
its prompts; nothing is chosen by it either."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

from marey.checks.judge import Expectation


@dataclass(frozen=True)
class EvaluationPrompt:
    """A prompt that training never saw.

    Attributes:
        text: as a user types it.
        group: what it is counted under.
        expected: actions in order.
        separate: reported apart from the rest (kick, punch, slash, dance).
    """

    text: str
    group: str
    expected: tuple[Expectation, ...]
    separate: bool

    @property
    def sided(self) -> bool:
        """Whether a side or hand is asked for, in one action."""
        return len(self.expected) == 1 and self.expected[0].side != ""


PromptSet = Literal["evaluation", "blind", "development", "fresh"]
_FILES = {
    "evaluation": "prompts",
    "blind": "prompts_blind",
    "development": "prompts_development",
    "fresh": "prompts_fresh",
}


@lru_cache(maxsize=4)
def evaluation_prompts(which: PromptSet = "evaluation") -> tuple[EvaluationPrompt, ...]:
    """One of the sets, in the order of its file."""
    name = f"{_FILES[which]}.toml"
    table: dict[str, Any] = tomllib.loads(Path(__file__).with_name(name).read_text("utf-8"))
    return tuple(
        EvaluationPrompt(
            text, group["name"], tuple(Expectation(**row) for row in group["expect"]), group.get("separate", False)
        )
        for group in table["group"]
        for text in group["prompts"]
    )
