"""Expected actions of a motion in text form: `walk`, `wave left`, `walk straight then bow`.

Actions are in the order in which they must occur, joined by `then`. Standard library only: the small client and the
API read files of prompts with it. The evaluator defines what an action means for a motion.
"""

from __future__ import annotations

from dataclasses import dataclass

from marey.core.errors import InvalidInput

TURN = "turn"
TRAVELS = ("walk", "run", "walk_back")
"""Actions that may be `straight`."""
SIDED: dict[str, tuple[str, ...]] = {
    TURN: ("left", "right"),
    "wave": ("left", "right", "both"),
    "raise": ("left", "right", "both"),
}
"""Actions that may name a side: the direction of a turn, the hand that waves or is raised."""
ACTIONS = (*TRAVELS, *SIDED, "bow", "kick", "punch", "slash", "dance")
STRAIGHT = "straight"
JOIN = "then"
MAX_ACTIONS = 4


@dataclass(frozen=True)
class ExpectedAction:
    """One action. `side` is empty if none is named."""

    action: str
    side: str = ""
    straight: bool = False


def read_expected(text: str) -> tuple[ExpectedAction, ...]:
    """Parse the actions of a text such as `walk straight then wave left`.

    Raises:
        InvalidInput: an unknown action, a word that does not belong to its action, or too many actions.
    """
    parts: list[list[str]] = [[]]
    for word in text.lower().split():
        if word == JOIN:
            parts.append([])
        else:
            parts[-1].append(word)
    if len(parts) > MAX_ACTIONS:
        raise InvalidInput(f"{len(parts)} actions are over the limit of {MAX_ACTIONS}")
    return tuple(_action(words) for words in parts)


def _action(words: list[str]) -> ExpectedAction:
    if not words:
        raise InvalidInput(f'an action is missing: write "walk", or "walk {JOIN} wave left"')
    name, *rest = words
    if name not in ACTIONS:
        raise InvalidInput(f"{name[:40]!r} is not an action; known: {', '.join(ACTIONS)}")
    side, straight = "", False
    for word in rest:
        if word == STRAIGHT and name in TRAVELS and not straight:
            straight = True
        elif word in SIDED.get(name, ()) and not side:
            side = word
        else:
            raise InvalidInput(f"{word[:40]!r} does not belong to {name!r}; {_allowed(name)}")
    if name == TURN and not side:
        raise InvalidInput(f'a turn needs its side: "{TURN} left" or "{TURN} right"')
    return ExpectedAction(name, side, straight)


def _allowed(name: str) -> str:
    words = SIDED.get(name) or ((STRAIGHT,) if name in TRAVELS else ())
    return f"it may have {' or '.join(words)}" if words else f'actions are joined by "{JOIN}"'
