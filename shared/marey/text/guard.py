"""Guards against rewrites that change the meaning: verbs, sides, directions and counts must stay."""

from __future__ import annotations

import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass
from functools import lru_cache

from marey.text.graph import SemanticGraph
from marey.text.words import DIRECTIONS, NUMBERS, SIDES, bare, lemma
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.scope import every_action, match_scope

LIGHT_VERBS = frozenset({"be"})
_DIGITS = re.compile(r"^(\d+(?:[.,]\d+)?)\D{0,3}$")


def changed_meaning(before: SemanticGraph, after: SemanticGraph) -> str | None:
    """Describe the difference between the graphs of a prompt and its rewrite; None if the meaning is the same.

    Args:
        before: of the prompt with its spelling corrected, so that a typo is no other verb.
        after: of the rewrite.
    """
    for what, was, now in (("the verbs", _verbs(before), _verbs(after)), *_named(before.words, after.words)):
        if was != now:
            return f"it changes {what}: {_list(was)} became {_list(now)}"
    return None


def lost_meaning(before: SemanticGraph, after: SemanticGraph) -> str | None:
    """Name what a description no longer says of a prompt: a side, a direction or a count; None if all are kept.

    A description tells in other verbs how the body moves, and names sides and directions that the prompt left open.
    """
    for what, was, now in _named(before.words, after.words):
        if lost := set(was) - set(now):
            return f"it loses {what}: {', '.join(sorted(lost))}"
    return None


def changed_but_aligned(before: SemanticGraph, after: SemanticGraph) -> str | None:
    """Describe the difference between a prompt and its rewrite that is more than verbs brought into the vocabulary;
    None if there is none.

    Verbs by which the vocabulary calls its actions stay. Each other verb stays or becomes one of them, and the one of
    its own action where the vocabulary knows the verb. Where the prompt names no action of the vocabulary, a verb may
    bring the direction that is part of its action's name ("plonks himself on a chair" becomes "sits down on a chair"),
    and a prompt in which no verb was found becomes one action.

    Args:
        before: of the prompt with its spelling corrected.
        after: of the rewrite.
    """
    was, now = _verbs(before), _verbs(after)
    gone, new = was - now, now - was
    named = {named.action for named in match_scope(before.text, every_action()).actions if named.action}
    words = _words_of_actions()
    strange = any(verb in words.names for verb in gone) or any(verb not in words.names for verb in new)
    other = any((meant := words.meant_by(verb, named)) and not meant & new.keys() for verb in gone)
    one = not was and new.total() == 1 and (not named or bool(words.first(named) & new.keys()))
    if strange or other or not (one or gone.total() == new.total()):
        return f"it changes the verbs: {_list(was)} became {_list(now)}"
    for what, earlier, later in _named(before.words, after.words):
        brought = words.directions(new) if what == "a direction" and not named else Counter[str]()
        if earlier - later or not later - earlier <= brought:
            return f"it changes {what}: {_list(earlier)} became {_list(later)}"
    return None


@dataclass(frozen=True)
class _ActionWords:
    """Verbs by which the vocabulary calls its actions.

    Attributes:
        name: first verb of each action by which instructions call it, by id.
        phrases: the words of that name, by id.
        alone: actions of each verb that names one by itself.
        within: actions of each first verb of a phrase of several words.
    """

    name: Mapping[str, str]
    phrases: Mapping[str, str]
    alone: Mapping[str, Set[str]]
    within: Mapping[str, Set[str]]

    @property
    def names(self) -> Set[str]:
        return frozenset(self.name.values())

    def first(self, actions: Iterable[str]) -> Set[str]:
        return {self.name[action] for action in actions if action in self.name}

    def meant_by(self, verb: str, named: Set[str]) -> Set[str]:
        """Return the verbs that a verb may become; none = any. Phrases of several words ("heave self up") say nothing
        of their first verb, unless the prompt names their action."""
        return self.first(self.alone.get(verb, frozenset())) | self.first(self.within.get(verb, frozenset()) & named)

    def directions(self, verbs: Iterable[str]) -> Counter[str]:
        """Count the directions in the names of actions whose first verbs these are."""
        chosen = set(verbs)
        words = {word for action, verb in self.name.items() if verb in chosen for word in self.phrases[action].split()}
        return _bag(sorted(words), DIRECTIONS)


@lru_cache(maxsize=1)
def _words_of_actions() -> _ActionWords:
    alone, within = defaultdict[str, set[str]](set), defaultdict[str, set[str]](set)
    called = {name: action for name, action in load_vocabulary().actions.items() if action.verbs}
    for name, action in called.items():
        for phrase in (*action.verbs, *action.near):
            verb, *more = phrase.split()
            (within if more else alone)[lemma(verb)].add(name)
    phrases = {name: action.verbs[0] for name, action in called.items()}
    return _ActionWords({name: lemma(said.split()[0]) for name, said in phrases.items()}, phrases, alone, within)


def changed_details(before: str, after: str) -> str | None:
    """Name a side, a direction or a count that a paraphrase says more or less often than the text; None if all agree.

    A paraphrase may use other verbs, and join or split sentences.
    """
    for what, was, now in _named(before.split(), after.split()):
        if was != now:
            return f"it changes {what}: {_list(was)} became {_list(now)}"
    return None


def _named(before: Sequence[str], after: Sequence[str]) -> tuple[tuple[str, Counter[str], Counter[str]], ...]:
    """Sides, directions and counts before and after."""
    return (
        ("a side", _bag(before, SIDES), _bag(after, SIDES)),
        ("a direction", _bag(before, DIRECTIONS), _bag(after, DIRECTIONS)),
        ("a count", _counts(before), _counts(after)),
    )


def _verbs(graph: SemanticGraph) -> Counter[str]:
    verbs = [lemma(node.text) for node in graph.level("action")] + [lemma(text) for text in graph.cut.actions]
    return Counter(verb for verb in verbs if verb not in LIGHT_VERBS)


def _bag(words: Sequence[str], table: Mapping[str, str]) -> Counter[str]:
    return Counter(table[core] for word in words if (core := bare(word)) in table)


def _counts(words: Sequence[str]) -> Counter[str]:
    numbers = [NUMBERS[core] for word in words if (core := bare(word)) in NUMBERS]
    return Counter(numbers + [m[1] for word in words if (m := _DIGITS.match(bare(word)))])


def _list(bag: Counter[str]) -> str:
    return ", ".join(sorted(bag.elements())) or "none"
