"""Does a motion show an action, or several actions one after another?"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from marey.core.errors import InvalidInput
from marey.referee.body import Body
from marey.referee.rules import RULES

STEP_S = 0.25
"""Grid of the moments at which one action may end and the next begin."""
SHORTEST_S = 0.4
"""Shortest part of a clip that is judged by itself."""
CLIMBS = frozenset({"climb-stairs", "climb-ladder", "climb-onto"})
"""Actions behind which a body may stand higher: the floor of what follows is where its feet are."""


def shows(action: str, body: Body) -> bool:
    """Return True if the body does what the definition of an action says.

    Raises:
        InvalidInput: the vocabulary has no such action.
    """
    if action not in RULES:
        raise InvalidInput(f"unknown action {action!r}; known: {', '.join(sorted(RULES))}", where="action")
    return bool(RULES[action](body))


def shows_in_order(actions: Sequence[str], body: Body) -> bool:
    """Return True if the clip can be cut into parts, in order, that show the actions one after another.

    Raises:
        InvalidInput: no action, or an unknown one.
    """
    if not actions:
        raise InvalidInput("no action was given", where="actions")
    if len(actions) == 1:
        return shows(actions[0], body)
    step, shortest = body.frames(STEP_S), body.frames(SHORTEST_S)
    cuts = [*range(0, len(body) - shortest, step), len(body)]

    @cache
    def part_shows(index: int, begin: int, end: int) -> bool:
        part = body.part(begin, end)
        return shows(actions[index], part.on_own_floor() if CLIMBS & set(actions[:index]) else part)

    @cache
    def rest_shows(index: int, begin: int) -> bool:
        if index == len(actions) - 1:
            return len(body) - begin >= shortest and part_shows(index, begin, len(body))
        return any(
            part_shows(index, begin, end) and rest_shows(index + 1, end)
            for end in cuts
            if end - begin >= shortest and end < len(body)
        )

    return rest_shows(0, 0)
