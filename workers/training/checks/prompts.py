"""The evaluation prompts and what each motion must do (`prompts.toml`)."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from workers.training.checks.judge import Expectation


@dataclass(frozen=True)
class EvaluationPrompt:
    """A prompt that training never saw.

    Attributes:
        text: as a user types it.
        group: what it is counted under.
        expected: acts in order.
        separate: reported apart from the rest (kick, punch, slash, dance).
    """

    text: str
    group: str
    expected: tuple[Expectation, ...]
    separate: bool

    @property
    def sided(self) -> bool:
        """Whether a side or hand is asked for, in one act."""
        return len(self.expected) == 1 and self.expected[0].side != ""


@lru_cache(maxsize=1)
def evaluation_prompts() -> tuple[EvaluationPrompt, ...]:
    """All 200, in the order of the file."""
    table: dict[str, Any] = tomllib.loads(Path(__file__).with_name("prompts.toml").read_text("utf-8"))
    return tuple(
        EvaluationPrompt(
            text, group["name"], tuple(Expectation(**row) for row in group["expect"]), group.get("separate", False)
        )
        for group in table["group"]
        for text in group["prompts"]
    )
