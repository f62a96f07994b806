"""Clauses that the readers leave together though their signs set them apart, cut where both sides are movements (ours).

The reader of sequences finds joints by the states of an encoder that has read few lists; what a full stop, an arrow,
"then" or a comma before a verb separates is read by itself here.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Sequence

from marey.text.clause_order import comes_with, is_end, without_joints
from marey.text.clause_parts import begins_with_verb, goes_on, is_on_other_side
from marey.text.sequence_reader import TURNS, ReadMovement
from marey.vocabulary.bearing_words import is_done_at_once, stated_bearings
from marey.vocabulary.counts import STEPPING, stated_count
from marey.vocabulary.gazes import only_gaze
from marey.vocabulary.in_place import goes_in_place
from marey.vocabulary.scope import STANDING

_STRONG = re.compile(
    r"\s*(?:[.;!](?=\s)|->|→|\s>\s)\s*(?:and\s+)?(?:then\s+)?|,?\s+(?:and\s+)?then,?\s+", re.IGNORECASE
)
"""Signs behind which another movement begins."""
_COMMA = re.compile(r",\s+(?:and\s+)?(?=(?:(?:he|she|they)\s+)?(?:\w+ly\s+)?[a-z]+)", re.IGNORECASE)
"""Signs behind which one begins if a verb comes first."""
HERE = re.compile(
    r"""\W*(?:\w+ed\b|(?:he|she|they|it)\ (?:is|are|looks?|seems?)\ (?!\w+ing\b)
    |(?:stay|remain|keep|hold|wait|repeat|continue|finish|start|begin|try|make)\w*\b)""",
    re.IGNORECASE | re.VERBOSE,
)
"""Beginning of words that say how long, how or how often the movement before them is done."""


def clauses_apart(text: str) -> list[str]:
    """Return the parts of a text between the signs that set movements apart; itself alone if there are none."""
    parts = [part for strong in _cut(text, _STRONG, lambda _: True) for part in _cut(strong, _COMMA, begins_with_verb)]
    joined: list[str] = []
    for part in parts:
        said = without_joints(part)
        belongs = joined and (
            (is_done_at_once(f"{joined[-1]}, {said}") and not is_done_at_once(joined[-1]))
            or comes_with(joined[-1], said)
            or is_end(said)
            or goes_on(said)
            or HERE.match(said)
            or only_gaze(said)
        )
        if belongs:
            joined[-1] = f"{joined[-1]}, {part}"
        elif part:
            joined.append(said if joined else part)
    return joined


def told_apart(
    text: str, read: Callable[[str], Sequence[ReadMovement]], *, way: bool = True
) -> tuple[ReadMovement, ...]:
    """Return the movements of the parts of a text, none if there are not several of them.

    Args:
        text: of one movement, as a reader took it.
        read: returns the movements of a part; none if it asks for none.
        way: turns on a way are part of it, "walks ahead, then turns left", and commas alone set nothing apart.
    """
    parts = clauses_apart(text)
    if len(parts) < 2 or (way and not _STRONG.search(text)):
        return ()
    found: list[ReadMovement] = []
    for part in parts:
        movements = list(read(part))
        if not movements:
            if not found:
                return ()
            found[-1] = _and(found[-1], part)
        elif found and _is_one(found[-1], movements[0]):
            found[-1] = _and(found[-1], movements[0].text)
            found += movements[1:]
        else:
            found += movements
    actions = {each.action for each in found}
    turns_back = any(is_on_other_side(a.text, b.text, b.action or "") for a, b in itertools.pairwise(found))
    in_place = {goes_in_place(each.text, each.action or "") for each in found} == {False, True}
    first = found[0]
    counted = first.action in STEPPING and stated_count(first.text, first.action) is not None
    if len(found) < 2 or (way and not counted and actions <= TURNS and not turns_back and not in_place):
        return ()
    return tuple(found)


def _and(movement: ReadMovement, more: str) -> ReadMovement:
    return ReadMovement(f"{movement.text}, {more}", movement.action, movement.seconds)


def _is_one(before: ReadMovement, after: ReadMovement) -> bool:
    """Return True if two movements are one: the same action on the same side, in the same bearing."""
    if before.action != after.action:
        return False
    if goes_in_place(before.text, before.action or "") != goes_in_place(after.text, after.action or ""):
        return False
    if before.action == STANDING:
        return _drawn(before.text) == _drawn(after.text)
    return not is_on_other_side(before.text, after.text, after.action or "")


def _drawn(text: str) -> frozenset[tuple[str, str]]:
    return frozenset((each.name, each.side) for each in stated_bearings(text))


def _cut(text: str, sign: re.Pattern[str], separates: Callable[[str], bool]) -> Iterator[str]:
    """Yield the parts of a text between signs behind which comes what separates it."""
    at = 0
    for found in sign.finditer(text):
        before = text[at : found.start()]
        if before.strip() and before.count("(") == before.count(")") and separates(text[found.end() :]):
            yield text[at : found.start()].strip()
            at = found.end()
    yield text[at:].strip()
