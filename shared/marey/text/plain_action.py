"""The action that a prompt asks for, said first in plain words (ours).

A model that learned an action from a few takes knows few of the ways to ask for it: "two slow steps of a stroll" and
"the waiter takes a bow" are further from its captions than "a person walks" and "a person bows". What else the prompt
says stays behind the plain words.
"""

from __future__ import annotations

from marey.text.action_reader import STANDING
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import every_action, match_scope

VERSION = 2
"""Raise it when the same prompt, vocabulary and reader give other words."""
MOST_WORDS = 20
"""Longer prompts tell a movement part by part: by their words, three of ten that name one action ask for another."""
TURNING = "turn"
"""Said beside gaits: "walks and turns the corner"."""


def with_plain_action(prompt: str, action: str | None) -> str:
    """Return a prompt behind its action in plain words: "a person bows, the waiter takes a bow".

    As written where it has the plain words, or no action is known that it asks for.

    Args:
        prompt: as `check_prompt` returns it.
        action: id of the one action that it asks for; None = several, none, or in doubt.
    """
    if action is None:
        return prompt
    plain = load_vocabulary().need(action).plain_words
    return prompt if plain in prompt.lower() else f"{plain}, {_lowered(prompt)}"


def only_action(prompt: str) -> str | None:
    """Return the id of the one action that the words of a prompt ask for; None = several, none, or in doubt. For
    encoders that `marey.text.action_reader` does not read."""
    if len(prompt.split()) > MOST_WORDS:
        return None
    scope = match_scope(prompt, every_action())
    if scope.left is not None:
        return None
    vocabulary = load_vocabulary()
    found = {each.action for each in scope.actions if each.action is not None}
    if any(each.action is None for each in scope.actions):
        return None
    names = vocabulary.without_implied(found - {STANDING} if len(found) > 1 else found)
    if TURNING in names:
        names = {name for name in names if name == TURNING or not vocabulary.need(name).in_place}
    return names.pop() if len(names) == 1 else None


def _lowered(prompt: str) -> str:
    """Return a prompt as it stands inside a sentence: "The waiter" with a small letter, "I'm" and "NPC" as they are."""
    first = prompt.split(maxsplit=1)[0]
    small = first == "A" or (first[1:2].isalpha() and not first[1:2].isupper())
    return prompt[:1].lower() + prompt[1:] if small else prompt
