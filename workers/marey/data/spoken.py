"""Captions of an action, whatever a clip of it looks like: by the words of the vocabulary, and as people ask for it.

A network that reads three authors' captions of a clip knows these sentences: of hgm3-open 0.1, 60 % of the motions of
training captions showed their action, and 36 % of those of other authors' prompts. The sentences of `sayings.toml` were
written from the vocabulary's definitions alone, by authors who saw neither clips nor held-out prompts.
"""

from __future__ import annotations

import re
import tomllib
from functools import cache
from pathlib import Path

from marey.core.errors import InvalidInput
from marey.data.captions import seeded
from marey.items.prompts import check_prompt
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.inflection import phrase_in_third_person
from marey.vocabulary.scope import ActionLists, match_scope

PHRASES, SENTENCES = 6, 12
"""Largest number of captions of a clip in the words of the vocabulary, and of sentences that ask for its action."""
SUBJECTS = ("a person", "a man", "a woman", "someone", "the character", "he", "she", "the figure", "the actor")
_SHARE_OF_NOUNS, _SHARE_OF_COMMANDS = 0.25, 0.33
_SIDED = re.compile(r"\b(left|right)\b")  # true of some clips only
MARKED = re.compile(r"[~=]")  # patterns for matching, no words


def spoken(action: str, seed: str, untrue: str = "") -> tuple[str, ...]:
    """Return different captions for a clip of one action, none for an action that is not in the vocabulary.

    Args:
        action: id of the vocabulary.
        seed: the clip's name, so that a clip has the same captions on every machine.
        untrue: pattern of words that are not true of the clip, though of the action.
    """
    if action not in load_vocabulary().actions:
        return ()
    rng = seeded("spoken", seed)
    verbs, nouns = _words(action)
    if untrue:
        verbs, nouns = (tuple(word for word in words if not re.search(untrue, word)) for words in (verbs, nouns))
    said: dict[str, None] = {}
    for _ in range(PHRASES):
        if nouns and rng.random() < _SHARE_OF_NOUNS:
            said[rng.choice(nouns)] = None
        else:
            verb = rng.choice(verbs)
            said[
                verb if rng.random() < _SHARE_OF_COMMANDS else f"{rng.choice(SUBJECTS)} {phrase_in_third_person(verb)}"
            ] = None
    return tuple(said)


def sayings(action: str, seed: str) -> tuple[str, ...]:
    """Return different sentences that ask for an action; none where none were written.

    Args:
        action: id of the vocabulary.
        seed: the clip's name, so that a clip has the same captions on every machine.
    """
    written = all_sayings().get(action, ())
    return tuple(seeded("sayings", seed).sample(written, min(SENTENCES, len(written))))


@cache
def all_sayings() -> dict[str, list[str]]:
    """Read the sentences of all actions."""
    return tomllib.loads(Path(__file__).with_name("sayings.toml").read_text("utf-8"))


@cache
def _words(action: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Verbs and nouns that are captions: those that people may send as prompts and that are read as this action."""
    entry = load_vocabulary().actions[action]
    verbs = tuple(
        verb for verb in entry.verbs if _reads(verb, action) and _reads(f"he {phrase_in_third_person(verb)}", action)
    )
    return verbs, tuple(noun for noun in entry.nouns if _reads(noun, action))


def _reads(text: str, action: str) -> bool:
    if _SIDED.search(text) or MARKED.search(text):
        return False
    try:
        check_prompt(text)
    except InvalidInput:
        return False
    return any(named.action == action for named in match_scope(text, ActionLists((action,))).actions)
