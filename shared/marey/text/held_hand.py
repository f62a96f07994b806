"""The hand that has taken something, and throws or uses it (ours)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace

from marey.text.sequence_reader import ReadMovement
from marey.vocabulary.bearing_words import stated_bearings

TAKING = frozenset({"pick-up", "reach-up", "carry"})
"""Actions behind which something is in a hand."""
THROW = "throw"
SWORD_DRAWN, SWORD_SHEATHED, OF_SWORDS = "sword-drawn", "sword-sheathed", frozenset({"slash", "stab", "block"})
"""Bearings in which a sword comes into the hand, the right one unless the words say otherwise, and is put away; and
actions that are done with it."""
_HAND = re.compile(
    r"\b(?:with|in|into|using|by) (?:(?:his|her|their|its|the|my|your|one's) )?(left|right) (?:hand|arm)\b", re.I
)
_THROWN = re.compile(r"\b(?:throw|toss|hurl|lob|fling|pitch)\w* (?:it|them|the|that)\b", re.IGNORECASE)
_SIDE = re.compile(r"\b(?:left|right|both)\b(?= (?:hand|arm))", re.IGNORECASE)
_TAKES = re.compile(
    r"\b(?:pick|tak|grab|lift|answer|pour|hold|fill|rais|grip|pull)\w*\b[^.;]*?"
    r"\b(?:with|in|using) (?:(?:his|her|their|the) )?(?P<side>left|right) (?:hand|arm)\b",
    re.IGNORECASE,
)
"""Words of a hand that takes a thing."""
_USES = re.compile(
    r"(?<=[,;.] )(?P<use>(?:(?:and|then|and then) )?(?:(?P<listen>listens?)|hangs? up|(?:slam|bang|put|set|lay|drop)s?"
    r" (?:it|the \w+)(?: (?:down|away|back))?|takes? a (?:sip|drink|swig|bite)))(?=\W*$|[,.;]| (?:and|then)\b)",
    re.IGNORECASE,
)
"""Words of what a hand does with it."""
_PHONE = re.compile(r"\b(?:phone|telephone|receiver|smartphone|cellphone)\b", re.IGNORECASE)


def with_hand_again(prompt: str) -> str:
    """Return a prompt that names the hand that took a thing where the thing is used, as long as it names no other hand:
    "answers the phone with the left hand, then hangs up with the left hand"."""
    taken = _TAKES.search(prompt)
    if taken is None or _HAND.search(prompt, taken.end()):
        return prompt
    on = " on the phone" if _PHONE.search(prompt) else ""
    side = taken["side"].lower()

    def used(found: re.Match[str]) -> str:
        return f"{found['use']}{on if found['listen'] else ''} with the {side} hand"

    return prompt[: taken.end()] + _USES.sub(used, prompt[taken.end() :])


def with_held_hand(movements: Iterable[ReadMovement]) -> Iterator[ReadMovement]:
    """Yield movements; who throws what a hand has taken up does so with that hand: "picks up a stone with the left
    hand, then throws it". So does who draws a sword and strikes with it."""
    side = sword = ""
    for movement in movements:
        stated = {each.name: each for each in stated_bearings(movement.text)}
        sword = (stated[SWORD_DRAWN].acts or "right") if SWORD_DRAWN in stated else sword
        uses = movement.action in OF_SWORDS or (SWORD_SHEATHED in stated and SWORD_DRAWN not in stated)
        if sword and uses and not _SIDE.search(movement.text):
            movement = replace(movement, text=f"{movement.text} with the {sword} hand")
        hand = _HAND.search(movement.text)
        if movement.action in TAKING:
            side = hand[1].lower() if hand is not None else ""
        thrown = movement.action == THROW and side and _THROWN.search(movement.text)
        if thrown and not _SIDE.search(movement.text):
            movement = replace(movement, text=f"{movement.text} with the {side} hand")
        if movement.action == THROW:
            side = ""
        yield movement
