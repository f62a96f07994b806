"""Prompts of edited motions. Standard library only."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from marey.core.sides import swap_sides
from marey.motion.edits.steps import Step

READ_PROMPT = ("rewritten", "not_rewritten", "graph", "scope")
"""Keys of a manifest that say how its prompt was read."""


def prompt_of(prompt: str, steps: Sequence[Step], other: Callable[[Step], str]) -> str:
    """Return the prompt of the result of operations.

    Args:
        prompt: of the motion; empty if it has none.
        other: returns the prompt of the motion that a step names in `with`.
    """
    for step in steps:
        if step.operation.name == "mirror":
            prompt = swap_sides(prompt)
            continue
        own = step.values.get("prompt")
        if own:
            prompt = with_own(step.operation.name, prompt, own)
        if "with" in step.values:
            prompt = joined(prompt, other(step))
    return prompt


def with_own(operation: str, prompt: str, own: str) -> str:
    """Return the prompt of a motion after an operation with a prompt of its own."""
    if not prompt:
        return own
    return meanwhile(prompt, own) if operation == "body-part" else joined(prompt, own)


def meanwhile(first: str, second: str) -> str:
    """Return the prompt of two actions at once."""
    return f"{first} while {second}" if first != second else first


def joined(first: str, second: str) -> str:
    """Return the prompt of two motions in sequence; the first one's where either has none, or both are equal."""
    return f"{first}, then {second}" if first and second and first != second else first
