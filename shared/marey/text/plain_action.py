"""The action that a prompt asks for, said first in plain words (ours).

A model that learned an action from a few takes knows few of the ways to ask for it: "two slow steps of a stroll" and
"the waiter takes a bow" are further from its captions than "a person walks" and "a person bows". What else the prompt
says stays behind the plain words.
"""

from __future__ import annotations

from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.inflection import third_person
from marey.vocabulary.scope import every_action, match_scope

VERSION = 1
"""Raise it when the same prompt and vocabulary give other words."""
MOST_WORDS = 20
"""Longer prompts tell a movement part by part: three of ten that name one action ask for another."""
STANDING, TURNING = "idle", "turn"
"""Said beside other actions: "stands and waves". A gait in a curve: "walks and turns the corner"."""


def with_plain_action(prompt: str) -> str:
    """Return the prompt behind its action in plain words: "a person bows, the waiter takes a bow".

    As written, where its words name no action, several, or one in doubt, are more than `MOST_WORDS`, or have the plain
    ones.

    Args:
        prompt: as `check_prompt` returns it.
    """
    action = _only_action(prompt)
    if action is None:
        return prompt
    verb, *rest = load_vocabulary().need(action).plain.split()
    plain = " ".join(["a person", third_person(verb), *rest])
    return prompt if plain in prompt.lower() else f"{plain}, {_lowered(prompt)}"


def _only_action(prompt: str) -> str | None:
    """Return the id of the one action that a prompt asks for; None = none, several, or in doubt."""
    if len(prompt.split()) > MOST_WORDS:
        return None
    scope = match_scope(prompt, every_action())
    if scope.left is not None:
        return None
    names = {each.action for each in scope.actions}
    if len(names) > 1:
        names.discard(STANDING)
    actions = [load_vocabulary().need(name) for name in names if name is not None]
    names.difference_update(*(action.implies for action in actions))
    if TURNING in names:
        names.difference_update(action.id for action in actions if action.in_place and action.id != TURNING)
    return names.pop() if len(names) == 1 else None


def _lowered(prompt: str) -> str:
    """Return a prompt as it stands inside a sentence: "The waiter" with a small letter, "I'm" and "NPC" as they are."""
    first = prompt.split(maxsplit=1)[0]
    small = first == "A" or (first[1:2].isalpha() and not first[1:2].isupper())
    return prompt[:1].lower() + prompt[1:] if small else prompt
