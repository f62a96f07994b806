"""The table of rules: one for each action of the vocabulary."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from marey.referee.body import Body

Rule: TypeAlias = Callable[[Body], bool]
RULES: dict[str, Rule] = {}


def rule(action: str) -> Callable[[Rule], Rule]:
    """Register a function as the rule of an action."""

    def register(function: Rule) -> Rule:
        if action in RULES:
            raise ValueError(f"the action {action!r} has two rules")
        RULES[action] = function
        return function

    return register
