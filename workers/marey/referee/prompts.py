"""Held-out prompts by authors who saw the definitions of the vocabulary and nothing else.

Two authors ask for single actions, by which the supported actions of a bundle are published; a third wrote a list of
300 prompts as a games studio would send it, a fifth asks for sequences, and a sixth in verbs that the vocabulary lacks.
Nothing is trained on them or chosen by them. By the prompts of a fourth, `development`, settings are chosen.
"""

from __future__ import annotations

import csv
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

AUTHORS = (1, 2)
STUDIO_AUTHOR, DEVELOPMENT_AUTHOR, SEQUENCE_AUTHOR, OTHER_VERBS_AUTHOR = 3, 4, 5, 6


@dataclass(frozen=True)
class ActionPrompt:
    """A held-out prompt.

    Attributes:
        text: as a user types it.
        actions: ids of the vocabulary, in the order in which a motion shows them; none where no definition covers it.
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


@lru_cache(maxsize=1)
def development_prompts() -> tuple[ActionPrompt, ...]:
    """Return five prompts of each action, by which settings may be chosen."""
    return _by_action("prompts_development.toml", DEVELOPMENT_AUTHOR)


@lru_cache(maxsize=1)
def other_verb_prompts() -> tuple[ActionPrompt, ...]:
    """Return prompts of one action each, in verbs that the vocabulary does not know."""
    return _by_action("prompts_other_verbs.toml", OTHER_VERBS_AUTHOR)


def _by_action(file: str, author: int) -> tuple[ActionPrompt, ...]:
    tables = tomllib.loads(Path(__file__).with_name(file).read_text("utf-8"))
    return tuple(ActionPrompt(text, (action,), "", author) for action, texts in tables.items() for text in texts)


@lru_cache(maxsize=1)
def sequence_prompts() -> tuple[ActionPrompt, ...]:
    """Return prompts of two to four actions one after another, by which nothing is chosen."""
    table = tomllib.loads(Path(__file__).with_name("prompts_sequences.toml").read_text("utf-8"))
    return tuple(ActionPrompt(each["text"], tuple(each["actions"]), "", SEQUENCE_AUTHOR) for each in table["sequence"])


@lru_cache(maxsize=1)
def studio_prompts() -> tuple[ActionPrompt, ...]:
    """Return the list of a studio: of all kinds of actions, sequences, and 15 % that the vocabulary does not cover."""
    with Path(__file__).with_name("prompts_studio.csv").open(encoding="utf-8", newline="") as file:
        return tuple(
            ActionPrompt(row["prompt"], tuple(filter(None, row["actions"].split("; "))), "", STUDIO_AUTHOR)
            for row in csv.DictReader(file)
        )
