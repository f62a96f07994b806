"""Guards against rewrites that change the meaning: verbs, sides, directions and counts must stay."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence, Set
from functools import lru_cache

from marey.text.graph import SemanticGraph
from marey.text.words import DIRECTIONS, NUMBERS, SIDES, bare, lemma
from marey.vocabulary.entries import load_vocabulary

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
    its own action where the vocabulary knows the verb.

    Args:
        before: of the prompt with its spelling corrected.
        after: of the rewrite.
    """
    was, now = _verbs(before), _verbs(after)
    gone, new = was - now, now - was
    names, meant = _verbs_of_actions()
    strange = any(verb in names for verb in gone) or any(verb not in names for verb in new)
    other = any(verb in meant and not meant[verb] & new.keys() for verb in gone)
    if strange or other or gone.total() != new.total():
        return f"it changes the verbs: {_list(was)} became {_list(now)}"
    for what, earlier, later in _named(before.words, after.words):
        if earlier != later:
            return f"it changes {what}: {_list(earlier)} became {_list(later)}"
    return None


@lru_cache(maxsize=1)
def _verbs_of_actions() -> tuple[frozenset[str], Mapping[str, Set[str]]]:
    """Return the verbs by which the vocabulary calls its actions, and for each verb that it knows those of its
    actions."""
    meant: dict[str, set[str]] = {}
    names: set[str] = set()
    for action in load_vocabulary().actions.values():
        first, *_ = (lemma(phrase.split()[0]) for phrase in action.verbs) if action.verbs else (None,)
        if first is None:
            continue
        names.add(first)
        for phrase in (*action.verbs, *action.near):
            meant.setdefault(lemma(phrase.split()[0]), set()).add(first)
    return frozenset(names), meant


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
