"""Prompts for measuring scope, in sets by different authors: nine classes, two of them in scope.

`development` is by the author of the words in `marey.vocabulary`, and so is `meaning`, for the limits of the encoder's
verdict; `test` is by another author and is never used for choosing words or limits.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from marey.vocabulary.scope import ActionLists, Scope, match_scope

ScopeSet = Literal["development", "meaning", "test"]
IN_SCOPE = "in-scope"
OBJECTS = "objects"
DRAWN = "drawn"
"""Classes with rules of their own; the prompts of all others are out of scope."""
Matcher = Callable[[str, ActionLists], Scope]
"""Judges a prompt: `match_scope`, or `marey.text.meaning.MeaningJudge.judge`."""


@dataclass(frozen=True)
class ScopePrompt:
    """A prompt with its class; in scope also the action that it names."""

    text: str
    group: str
    action: str | None = None


@dataclass(frozen=True)
class ScopeRate:
    """Counts of a class: prompts, and prompts with the right answer.

    Right is: in scope not `unknown`; gestures that are drawn `known`; objects flagged as such; all others
    `unknown`, or, for plausible unknown actions, not `known`.
    """

    group: str
    prompts: int
    right: int

    @property
    def share(self) -> float:
        """Share of right answers."""
        return self.right / self.prompts


def scope_prompts(which: ScopeSet) -> tuple[ScopePrompt, ...]:
    """Read one of the sets, in the order of its file."""
    path = Path(__file__).with_name(f"scope_prompts_{which}.toml")
    table: dict[str, Any] = tomllib.loads(path.read_text("utf-8"))
    named = table.pop(IN_SCOPE)["expect"]
    outside = [ScopePrompt(text, group) for group, content in table.items() for text in content["prompts"]]
    return (*outside, *(ScopePrompt(text, IN_SCOPE, action) for text, action in named))


def scope_rates(prompts: Sequence[ScopePrompt], lists: ActionLists, match: Matcher = match_scope) -> list[ScopeRate]:
    """Return the rate of each class under a bundle's lists."""
    groups = dict.fromkeys(prompt.group for prompt in prompts)
    return [_rate(group, [prompt for prompt in prompts if prompt.group == group], lists, match) for group in groups]


def _rate(group: str, prompts: Sequence[ScopePrompt], lists: ActionLists, match: Matcher) -> ScopeRate:
    right = sum(is_right(prompt, match(prompt.text, lists)) for prompt in prompts)
    return ScopeRate(group, len(prompts), right)


def is_right(prompt: ScopePrompt, scope: Scope) -> bool:
    """Return True if the scope of a prompt fits its class; see `ScopeRate`."""
    if prompt.group == IN_SCOPE:
        return scope.verdict != "unknown"
    if prompt.group == DRAWN:
        return scope.verdict == "known"
    if prompt.group == OBJECTS:
        return "objects" in scope.flags
    return scope.verdict == "unknown" or (prompt.group == "unknown-action" and scope.verdict != "known")
