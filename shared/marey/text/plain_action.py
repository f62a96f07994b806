"""The action that a prompt asks for, said first in plain words (ours).

A model that learned an action from a few takes knows few of the ways to ask for it: "just a normal walk please" and "the
waiter takes a bow" are further from its captions than "a person walks" and "a person bows". What else the prompt says
stays behind the plain words.
"""

from __future__ import annotations

from functools import lru_cache

from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.inflection import third_person
from marey.vocabulary.scope import ActionLists, match_scope

VERSION = 1
"""Raise it when the same prompt and vocabulary give other words."""
MOST_WORDS = 20
"""Longer prompts describe a movement part by part; the actions that they name are often none that the whole shows."""
STANDING = "idle"
"""Said beside most other actions: "stands and waves"."""


def with_plain_action(prompt: str) -> str:
    """Return the prompt behind its action in plain words: "a person walks, just a normal walk please".

    As written, where its words name no action, several, or one in doubt, deny something, or are more than `MOST_WORDS`.

    Args:
        prompt: as `check_prompt` returns it.
    """
    action = _only_action(prompt)
    if action is None:
        return prompt
    verb, *rest = load_vocabulary().need(action).plain.split()
    return f"{' '.join(['a person', third_person(verb), *rest])}, {_lowered(prompt)}"


def _only_action(prompt: str) -> str | None:
    """Return the id of the one action that a prompt asks for; None = none, several, or in doubt."""
    if len(prompt.split()) > MOST_WORDS:
        return None
    scope = match_scope(prompt, _every_action())
    if scope.left is not None or "negation" in scope.flags:
        return None
    names = {each.action for each in scope.actions}
    if len(names) > 1:
        names.discard(STANDING)
    implied = {implied for name in names if name for implied in load_vocabulary().need(name).implies}
    left = names - implied
    return left.pop() if len(left) == 1 else None


def _lowered(prompt: str) -> str:
    """Return a prompt as it stands inside a sentence: "The waiter" with a small letter, "I" and "NPC" as they are."""
    first = prompt.split(maxsplit=1)[0]
    return prompt if first[1:2].isupper() or not first[1:2].isalpha() else prompt[:1].lower() + prompt[1:]


@lru_cache(maxsize=1)
def _every_action() -> ActionLists:
    return ActionLists(tuple(load_vocabulary().actions))
