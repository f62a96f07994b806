"""Held-out prompts for single actions, by two authors who saw the definitions of the vocabulary and nothing else.

The supported actions of a bundle are published by these prompts: nothing is trained on them or chosen by them.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

AUTHORS = (1, 2)


@dataclass(frozen=True)
class ActionPrompt:
    """A held-out prompt.

    Attributes:
        text: as a user types it.
        actions: ids of the vocabulary, in the order in which a motion shows them.
        side: left, right or both where the prompt names a side; else empty.
        author: number of its author.
    """

    text: str
    actions: tuple[str, ...]
    side: str
    author: int


@lru_cache(maxsize=1)
def action_prompts() -> tuple[ActionPrompt, ...]:
    """Return the prompts of all authors."""
    return tuple(
        ActionPrompt(text, tuple(group["actions"]), group.get("side", ""), author)
        for author in AUTHORS
        for group in tomllib.loads(Path(__file__).with_name(f"prompts_{author}.toml").read_text("utf-8"))["group"]
        for text in group["prompts"]
    )
