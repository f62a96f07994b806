"""Sequences whose movements begin in the posture in which the one before has ended.

Each movement is made alone, by a body that stands. Who sat down and waves would stand up for it, who knelt and "stands
up" would fall in order to get up, and who lies and "sits up" would do sit-ups. Here the posture is handed from
one movement to the next; `marey.generation.postured` draws what follows from it.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from marey.drawing.floor_ways import FLAT, OPPOSITE
from marey.drawing.gesture import BOTH
from marey.drawing.holds import (
    BACK,
    CROSSED,
    CROUCH,
    FLOOR,
    FOURS,
    FRONT,
    KNEE,
    KNEES,
    LEFT_SIDE,
    LYING,
    ON_HANDS,
    PLANK,
    PRONE,
    RIGHT_KNEE,
    RIGHT_SIDE,
    SEAT,
    SEATED,
    SITTING,
    SLIDE,
    UPRIGHT,
)
from marey.drawing.low_deeds import PICKS, POUNDS, REACHES, LowDeed
from marey.generation.drawn_sides import drawn_side
from marey.generation.kneeling import drops
from marey.generation.posture import RowPosture
from marey.generation.whole_body import (
    ends_on_front,
    falls_on_front,
    half_turns,
    is_low_crawl,
    lies_and_rolls,
    tumbles,
)
from marey.posing.standing import LEFT, RIGHT
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.counts import stated_number
from marey.vocabulary.peeks import only_peeks
from marey.vocabulary.scope import GESTURES, STANDING

Row = tuple[str, str]
"""The id of the action of a row, empty if there is none that is known, and its words in lower case."""

POSTURES: Mapping[str, str] = {
    "sit-down": SEAT,
    "sit": SEAT,
    "sit-floor": FLOOR,
    "kneel": KNEES,
    "crouch": CROUCH,
    "lie": BACK,
    "lie-down": BACK,
    "die": BACK,
}
"""Postures that actions come to, or stay in."""
THERE = frozenset({"sit", "lie", ""})
"""Actions that begin in their posture, in the first row."""
RISING = frozenset({"get-up", "stand-up"})
RISES_FROM: Mapping[str, frozenset[str]] = {"get-up": LYING, "stand-up": SEATED}
"""Postures from which these rise by their definitions."""
AIMS = frozenset({"aim", "shoot"})
"""Actions that are done on the front, on the elbows."""
LAIN = frozenset(
    {STANDING, "wave", "clap", "laugh", "shiver", "talk", "reach-up", "reach-forward", "raise-arm", "cheer", "nod"}
)
"""Actions that are done on the back."""
ENTRIES: Mapping[str, str] = {"crawl": FOURS, "sit-ups": BACK, "push-ups": PLANK}
"""Postures in which movements begin that are drawn by themselves."""
LEAVES: Mapping[str, str] = {"push-ups": PLANK, "crawl": FOURS, "sit-ups": BACK}
"""Postures in which movements end that are drawn by themselves."""
CREEPS = frozenset({"sneak", "run", "sprint"})
"""Actions to which a body goes out of a crouch as it is, without standing up before."""
_UP = re.compile(
    r"\b(?:gets?|stands?|rises?|scrambles?|jumps?|springs?|clambers?|struggles?|climbs?|leaps?|pushes|straightens?"
    r"|picks? (?:him|her|them|it)sel\w+)\b.*\b(?:up|upright|feet)\b|\brises?\b|^\W*stands?\W*$"
)
_SITS_UP = re.compile(r"\bsit(?:s|ting)? (?:back |straight |bolt )?(?:up|upright)\b")
_SLIDES = re.compile(
    r"\bslid\w* (?:feet|foot|legs?)[ -]?first\b|\bslid\w* (?:in)?to (?:\w+ )?(?:home|base|plate)\b"
    r"|\bbaseball slide\b|\bslide tackle\w*"
)
_LIES = re.compile(r"\b(?:lying|lies|laying|in bed|wakes? up)\b")
_WAKES = re.compile(r"\b(?:wak(?:es?|ing)|awak(?:es?|ens?|ening)|woke)\b|\bopens? (?:his|her|their) eyes\b")
"""Words of who wakes: that alone moves no body that lies."""
_STAYS_LOW = re.compile(r"\b(?:in|into|to) (?:a|an|his|her|their) (?:\w+ )?(?:crouch|squat)\b|\bcrouch(?:ed|ing)\b")
"""Words of who rises as far as a crouch."""
_BEING = re.compile(r"\b(?:sitting|seated|kneeling|crouch(?:ing|ed)|squatting|lying)\b(?! down)")
"""Words of who is in a posture, not of who comes to it."""
_ONE_KNEE = re.compile(r"\bone knee\b|\ba knee\b|\bpropos\w+|\bknight\w*|\brifle|\bgun\b|\baim\w*|\bpistol|\bbow\b")
_BACK = re.compile(r"\b(?:back|supine|face[ -]?up)\b")
_CROSSES = re.compile(
    r"\b(?<!un)cross\w* (?:(?:his|her|their|its|the|both|one) )*(?:legs?|ankles?|knees?)\b|\b(?:legs|ankles) crossed\b"
    r"|\bone leg (?:over|across)\b|\b(?:leg|knee) (?:over|across) (?:the other|his|her|their)\b"
)
_UNCROSSES = re.compile(r"\buncross\w*\b")
"""Words of legs that are laid over each other on a seat, and of those that are put side by side again."""
_ON_FLOOR = re.compile(r"\b(?:floor|ground|carpet|grass|sand|dirt|earth|feet)\b|\boff the rug\b")
_TWO_HANDS = re.compile(
    r"\bboth (?:hands|arms)\b|\b(?:heavy|big|large|huge)\b|\b(?:box|boxes|crates?|chest|barrel|child|baby|toddler|sack"
    r"|buckets|stack|armful|papers|suitcases|bags)\b"
)
"""Words of what lies on the floor beside a seat, and of what is picked up with both hands."""
_TURNS_OVER = re.compile(r"\b(?:roll|turn|flip|tumbl|spin)\w*\b")
"""Words of a body that lies and turns over."""
_GOES = re.compile(
    r"\b(?:walk|run|leave|exit|go|step|jump|march|dash|flee|rush|jog|climb|hop|danc|skip|move|turn|spin|kick|charg|escap"
    r"|return|approach|enter|crawl|roll|swim|fall|lie|kneel|crouch|squat)\w*\b"
)
"""Words of what a body cannot do where it sits."""


def row_postures(rows: Sequence[Row], seed: int) -> list[RowPosture]:
    """Return the postures of the movements of a sequence, in their order.

    Args:
        rows: of the sequence.
        seed: of the sequence.
    """
    found: list[RowPosture] = []
    begin = ""
    for number, row in enumerate(rows):
        before = rows[number - 1] if number else None
        after = rows[number + 1] if number + 1 < len(rows) else None
        found.append(replace(_held(row, (before, after), begin), seed=seed))
        begin = found[-1].comes_to
    last = RowPosture(begin=begin)
    creeps = [*(row[0] in CREEPS for row in rows[1:]), False]
    return [
        replace(held, end=held.own if crept and held.own == CROUCH else _entered(after))
        for crept, (held, after) in zip(creeps, pairwise([*found, last]), strict=True)
    ]


def _entered(after: RowPosture) -> str:
    """Return the posture in which a movement begins, so far as the one before has to come to it."""
    return "" if after.apart else after.begin or after.enters


def _held(row: Row, beside: tuple[Row | None, Row | None], begin: str) -> RowPosture:
    """Return the postures of a row whose body is in `begin`, but for the end; one that stands up is none.

    Args:
        row: action and words.
        beside: the rows before and after it; None = there is none.
        begin: name of the posture.
    """
    (action, said), (before, _) = row, beside
    rolled = _rolled(row, begin)
    if rolled is not None:
        return rolled
    own = _posture(row, beside, begin)
    deed = _deed(row, begin or own)
    if deed is not None:
        own = begin if begin in REACHES else KNEES
        return RowPosture(begin, own, deed=deed)
    if own:
        crawled = own == PRONE and _crawls_low(before)
        there = crawled or (
            before is None and (action in THERE or _BEING.search(said) is not None or _only_wakes(said))
        )
        return RowPosture(
            own if there else begin,
            own,
            apart=crawled,
            falls=not (begin or crawled) and (action == "die" or (own == KNEES and not there and drops(said))),
            fires=action == "shoot",
        )
    leaves = FRONT if _crawls_low(row) else LEAVES.get(action, "") or _dives(said)
    if begin and not stays(row, begin) and action in ENTRIES:
        return RowPosture(enters=FRONT if _crawls_low(row) else ENTRIES[action], leaves=leaves)
    if leaves:
        return RowPosture(leaves=leaves)
    if not begin or not stays(row, begin):
        return RowPosture(begin if begin and rises(row) else "")
    if action == STANDING and not only_peeks(said):
        return RowPosture(begin, begin)
    return RowPosture(begin, begin, gesture=True)


def _posture(row: Row, beside: tuple[Row | None, Row | None], begin: str) -> str:
    """Return the posture that a movement comes to; empty if it comes to none."""
    (action, said), (before, after) = row, beside
    if not begin and _SLIDES.search(said) and action in ("", "get-up", "idle", "run"):
        return SLIDE
    if begin in SEATED and (_CROSSES.search(said) or _UNCROSSES.search(said)):
        return SEAT if _UNCROSSES.search(said) else CROSSED
    if begin in SITTING and _CROSSES.search(said):
        return FLOOR
    if action in ("sit", "sit-down") and _CROSSES.search(said):
        return CROSSED
    if action == "kneel":
        side = drawn_side(said, action)
        return RIGHT_KNEE if side == RIGHT else KNEE if side or _ONE_KNEE.search(said) else KNEES
    if action == "die":
        return FRONT if falls_on_front(said, "" if before is None else before[1]) else BACK
    if begin in LYING and _only_wakes(said):
        return begin
    if begin and rises(row) and _STAYS_LOW.search(said):
        return CROUCH
    if action in AIMS and (begin in (FRONT, PRONE) or _crawls_low(before)):
        return PRONE
    if action in ("lie", "lie-down"):
        on_front = ends_on_front(said) or (begin in (FOURS, FRONT, PLANK) and not _BACK.search(said))
        return FRONT if on_front else BACK
    if action == "squat" and after is not None and (rises(after) or after[0] in GESTURES):
        return CROUCH
    if _SITS_UP.search(said) and (action == "sit-ups" or not action) and begin in LYING:
        return UPRIGHT
    wakes = _only_wakes(said) and action in ("", *RISING)
    if (
        (wakes or (not action and _LIES.search(said)))
        and not begin
        and after is not None
        and (_SITS_UP.search(after[1]) or rises(after))
    ):
        return BACK
    return POSTURES.get(action, "")


def _rolled(row: Row, begin: str) -> RowPosture | None:
    """Return the postures of a body that lies and rolls over; None if it does not.

    Args:
        row: action and words.
        begin: name of the posture in which it is.
    """
    action, said = row
    lies = begin in FLAT
    turns = action in ("", "roll", "lie", "lie-down") and _TURNS_OVER.search(said) is not None
    if not turns or tumbles(said) or not (lies or (action == "roll" and lies_and_rolls(said))):
        return None
    halves = half_turns(said)
    named = re.search(r"\bto (?:the|his|her|their) (left|right)\b", said)
    own = begin if begin in OPPOSITE else FRONT
    if action in ("lie", "lie-down"):
        own, halves = (FRONT if ends_on_front(said) else BACK), 0
    elif lies and halves % 2:
        own = OPPOSITE.get(begin, FRONT)
    return RowPosture(begin, own, halves=halves, rolls_to=named[1] if named else "")


def _deed(row: Row, begin: str) -> LowDeed | None:
    """Return what the hands do low over the floor; None if nothing."""
    action, said = row
    pounds = next((each for each in stated_bearings(said) if each.name == "pound-ground"), None)
    if pounds is not None and begin not in LYING | ON_HANDS:
        return LowDeed(POUNDS, pounds.side, stated_number(pounds.words))
    if action != "pick-up" or begin not in REACHES:
        return None
    hand = drawn_side(said, action) or (BOTH if _TWO_HANDS.search(said) else "")
    return LowDeed(PICKS, hand, high=begin in SEATED and not _ON_FLOOR.search(said))


def _dives(said: str) -> str:
    """Return the posture in which a dive ends; empty if there is none."""
    for each in stated_bearings(said):
        if each.name == "side-dive":
            return LEFT_SIDE if each.side == LEFT else RIGHT_SIDE
        if each.name == "cover-dive":
            return FRONT
    return ""


def _crawls_low(row: Row | None) -> bool:
    """Return True if a movement is a crawl on the belly."""
    return row is not None and row[0] == "crawl" and is_low_crawl(row[1])


def _only_wakes(said: str) -> bool:
    """Return True if a movement is that of waking, and not of rising."""
    return _WAKES.search(said) is not None and _UP.search(said) is None


def is_as_alone(held: RowPosture, action: str) -> bool:
    """Return True if a row shows its action as a motion of that alone does, which the rules of actions describe."""
    if held.carries:
        return held.own not in LYING | {CROUCH}
    if not held.is_drawn:
        return True
    if not held.own:
        return held.begin in RISES_FROM.get(action, ())
    return held.begin in ("", held.own) and held.end == held.own and action in POSTURES


def rises(row: Row) -> bool:
    """Return True if a movement is that of standing up."""
    action, said = row
    return (action in RISING and not _only_wakes(said)) or (action in ("", STANDING) and _UP.search(said) is not None)


def stays(row: Row, begin: str) -> bool:
    """Return True if a movement is done in the posture in which the body is."""
    action, said = row
    if rises(row) or (begin in LYING | ON_HANDS and action not in (LAIN if begin == BACK else {STANDING})):
        return False
    return action == STANDING or action in GESTURES or (not action and not _GOES.search(said))
