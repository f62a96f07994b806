"""The table of rules: one for each action of the vocabulary."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
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


@lru_cache(maxsize=1)
def accepted_rules() -> frozenset[str]:
    """Return the actions whose rules are precise enough on real clips to say that an action is supported."""
    return frozenset(tomllib.loads(Path(__file__).with_name("accepted.toml").read_text("utf-8"))["accepted"])
