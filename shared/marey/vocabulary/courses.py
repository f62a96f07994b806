"""Where the ways of a prompt go: straight ahead, off to a side, in a circle, an eight, or a zigzag."""

from __future__ import annotations

import re
from dataclasses import dataclass

from marey.vocabulary.distances import stated_across
from marey.vocabulary.hurt_legs import without_hurt_leg
from marey.vocabulary.in_place import goes_in_place
from marey.vocabulary.turns import WHOLE, Turn, stated_turn

STRAIGHT, ASIDE, CIRCLE, EIGHT, ZIGZAG = "straight", "aside", "circle", "eight", "zigzag"
QUARTER = 90.0
SIZES = {"tight": (1.0, 1.4), "": (1.6, 2.4), "wide": (3.0, 3.6)}
"""Metres across a circle, by its size."""
LEAST_ACROSS, MOST_ACROSS = 0.8, 12.0
"""Metres of circles whose size is read."""

RUNS = frozenset({"run", "sprint"})
"""Actions that are runs."""
WAYS = RUNS | {"walk"}
"""Actions that are bent to a course."""
_CIRCLING = WAYS | {"turn", "turn-around"}
_GAITS = (
    r"walk|run|jog|stroll|strid|stride|march|sprint|hurr(?:y|ie)|trot|wander|trudg|trudge|limp|rush|dash|head|go|goe|exit"
    r"|leav|leave|amble|saunter|strut|mov|move|rac|race|bolt|fle|flee|step|danc|dance"
)
_ASIDE = re.compile(
    rf"\b(?P<way>(?:{_GAITS})(?:s|es|ing)?(?:\ \w+ly)?)\b"
    rf"(?:\ (?:off|away|out|over|offscreen|offstage|stage|screen)){{0,2}}(?:\ (?:quickly|slowly|fast))?"
    rf"(?:\ (?:to|towards?)\ (?:the|his|her|their|its))?(?:\ (?:far|stage|screen))?\ (?P<side>left|right)\b"
    rf"(?!\ (?:away|foot|feet|leg|heel|toes?|hand|arm|shoulder|knee|hip|side\ of|"
    r"(?:and|then|to)\ (?:left|right)))",
    re.VERBOSE | re.IGNORECASE,
)
_OTHERWISE = re.compile(
    r"\b(?:turn|veer|curv|arc|corner|swerv|circl|zig|weav|slalom|bend|then|loop|sideway|diagonal|back"
    r"|while looking|around|path|track|side to side)\w*\b"
)
"""Words of ways to a side that are told in another manner."""
_ZIGZAG = re.compile(
    r"\b(?:zig[ -]?zag\w*|slalom\w*|serpentine|s[ -](?:shaped?|curves?|pattern|bends)"
    r"|(?:weav|swerv|snak)\w+ (?:left and right|from side to side|through|between|around|in and out))\b"
)
_EIGHT = re.compile(
    r"\bfigures?[ -](?:of[ -])?(?:an )?(?:eights?|8s?)\b|\b(?:infinity (?:sign|symbol|shape|loop|pattern)|lemniscate)\b"
    r"|\bin an (?:8|eight)\b"
)
_CIRCLE = re.compile(r"\bcircl(?:e|es|ing)\b|\bin a (?:\w+ )?(?:ring|loop)\b")
_NO_CIRCLE = re.compile(
    r"\b(?:semi|half|quarter|three)[ -]?(?:of a |a )?(?:circle|\w+ circle)|\barms?\b|\bhips?\b"
    r"|\b(?:spin|whirl|twirl|pivot)\w*\b|\bon the spot\b|\bin place\b"
)
_WIDE = re.compile(r"\b(?:wide(?:ly)?|big|large|huge|broad|great|long)\b")
_TIGHT = re.compile(r"\b(?:tight(?:ly)?|small|little|narrow|tiny)\b")
_ON_WAY = re.compile(rf"\b(?:{_GAITS})(?:s|es|ing)?\b|\bcircl(?:es|ing)\b|^circle\b")
_IN_CIRCLES = re.compile(r"\bin (?:\w+ )?circles\b|\bcircles? (?:on the spot|in place)")
_SHAPE = re.compile(
    r"\s*\b(?:in|on|along|around|round)\ (?:(?:a|an|the|one|full|whole|complete|wide|big|large|huge|broad|great|small"
    r"|little|tight|narrow|tiny|long|clockwise|counterclockwise|anticlockwise)\ )*"
    r"(?:circle|ring|loop|zig[ -]?zags?|slalom|figures?[ -](?:of[ -])?(?:eights?|8s?)|eight|8|infinity\ \w+|serpentine"
    r"|s[ -](?:shape|curve|pattern))\b"
    r"(?:\ (?:pattern|path|line|motion|course|fashion|manner))?(?:\ to\ (?:the|his|her|their)\ (?:left|right))?"
    r"(?:\ (?:counter-?|anti-?)?clockwise)?",
    re.VERBOSE | re.IGNORECASE,
)
_STAGGERS = re.compile(
    r"\b(?:(?:stagger|stumbl|reel|wobbl|lurch|teeter|sway)(?:s|es|e|ing)?"
    r"(?: (?:about|around)(?! (?:the|a|his|her|it)\b))?"
    r"|drunk(?:en(?:ly)?|s)?|diz(?:zy|zily))\b"
)
"""Words of a body that weaves on its way, which is drawn on a straight one."""
_DRIBBLES = re.compile(r"\bdribbl\w+\b")
_AHEAD = re.compile(
    r"\b(?:walk|jog|run|runn|mov|advanc|dash|charg|sprint|stroll)(?:s|es|e|ing)?\b|\b(?:forwards?|ahead)\b"
    r"|\b(?:up|down|along|across) (?:the |a )?(?:court|pitch|field|street|gym|floor)\b"
)
_DODGES = re.compile(
    r"\b(?:around|past|between|circl\w*|turn\w*|spin\w*|fak\w*|juk\w*|back(?:wards?)?|sideways|cross\w*|zig\w*|weav\w*"
    r"|left|right|feet|foot|soccer|football|then|stand\w*|stationary|on the spot|in place)\b"
)
"""Words of who dribbles in another manner than straight on with a hand."""


@dataclass(frozen=True)
class WayCourse:
    """The course of a way.

    Attributes:
        kind: `STRAIGHT`, `ASIDE`, `CIRCLE`, `EIGHT` or `ZIGZAG`.
        side: `left` or `right`, to which it turns; empty = either.
        across: least and most metres across a circle.
    """

    kind: str = STRAIGHT
    side: str = ""
    across: tuple[float, float] = (0.0, 0.0)


def stated_course(prompt: str, action: str) -> WayCourse | None:
    """Return the course of a walk or a run; None = the words tell another one, or the action is no such way.

    Args:
        prompt: of one action, as a user typed it.
        action: its id.
    """
    if goes_in_place(prompt, action):
        return None
    text = without_hurt_leg(" ".join(prompt.lower().replace("’", "'").split()))
    sides = set(re.findall(r"\b(left|right)(?:wards?)?\b", text))
    side = next(iter(sides)) if len(sides) == 1 else ""
    turn = stated_turn(text, action)
    goes = action in WAYS or (action in _CIRCLING and _ON_WAY.search(text))
    if action in WAYS and _EIGHT.search(text):
        return WayCourse(EIGHT, side)
    if goes and _CIRCLE.search(text) and not _NO_CIRCLE.search(text) and not _IN_CIRCLES.search(text):
        counter = re.search(r"\b(?:(counter|anti)[ -]?)?clockwise\b", text)
        side = ("left" if counter[1] else "right") if counter else side
        across = stated_across(text)
        if across is not None and LEAST_ACROSS <= across <= MOST_ACROSS:
            return WayCourse(CIRCLE, side, (0.95 * across, 1.05 * across))
        size = "wide" if _WIDE.search(text) else "tight" if _TIGHT.search(text) else ""
        whole = turn is None or (turn.is_exact and turn.least == WHOLE)
        return WayCourse(CIRCLE, side, SIZES[size]) if whole else None
    if action not in _CIRCLING:
        return None
    aside = _ASIDE.search(text)
    if aside is not None and side and not _OTHERWISE.search(text):
        return WayCourse(ASIDE, aside["side"].lower())
    if action in WAYS and _ZIGZAG.search(text):
        return WayCourse(ZIGZAG, side)
    if action not in WAYS:
        return None
    return WayCourse() if Turn() in (turn, stated_turn(_STAGGERS.sub(" ", text), action)) else None


def without_course(prompt: str, action: str) -> str:
    """Return a prompt without the words of the course on which its way goes: "he jogs" of "he jogs in a zigzag"; empty
    if these cannot be left out, and the prompt as it is if it tells no course but straight ahead.

    Args:
        prompt: of one action, as a user typed it.
        action: its id.
    """
    course = stated_course(prompt, action)
    if course is None or course.kind == STRAIGHT:
        return prompt
    left = " ".join((_ASIDE.sub(r"\g<way>", prompt) if course.kind == ASIDE else _SHAPE.sub("", prompt)).split())
    told = stated_course(left, action)
    return left if told is not None and told.kind == STRAIGHT else ""


def dribbles_ahead(prompt: str) -> bool:
    """Return True if a prompt has a body dribble a ball by hand on a straight way ahead."""
    text = " ".join(prompt.lower().split())
    return all(words.search(text) for words in (_DRIBBLES, _AHEAD)) and _DODGES.search(text) is None
