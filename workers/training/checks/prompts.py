"""The evaluation prompts and what each motion must do: `prompts.toml`, and `prompts_blind.toml` by another author."""

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


@lru_cache(maxsize=2)
def evaluation_prompts(*, blind: bool = False) -> tuple[EvaluationPrompt, ...]:
    """The 200 that the bars are set on, in the order of their file.

    Args:
        blind: those of an author who knew neither the training captions nor the 200, by which nothing was ever chosen.
    """
    name = "prompts_blind.toml" if blind else "prompts.toml"
    table: dict[str, Any] = tomllib.loads(Path(__file__).with_name(name).read_text("utf-8"))
    return tuple(
        EvaluationPrompt(
            text, group["name"], tuple(Expectation(**row) for row in group["expect"]), group.get("separate", False)
        )
        for group in table["group"]
        for text in group["prompts"]
    )
