"""Where a prompt has the words that say how the body bears itself."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from marey.vocabulary.bearing_patterns import (
    ALL,
    DOES,
    bearing_patterns,
    only_beside,
    person_ahead,
    unless_beside,
    walking_forms,
)
from marey.vocabulary.bearings import FEET, OVERHEAD, Side, StatedBearing
from marey.vocabulary.counts import stated_strokes, strokes_before, strokes_behind
from marey.vocabulary.held_poses import held_words
from marey.vocabulary.hurt_legs import hurt_leg
from marey.vocabulary.inflection import verb_forms
from marey.vocabulary.meanwhile import WAYS, is_on_a_way, spans_at_once
from marey.vocabulary.sheaths import drawing_hand
from marey.vocabulary.who_acts import says_more
from marey.vocabulary.word_lists import load_word_lists

_KEPT_READINGS = 1024
"""Prompts whose words are kept as read: reader, scope and manifest ask for the same ones."""
_LOAD, _PERSON, _LIMP = " with a load", "person", "limp"
_LIKE = re.compile(
    r"\b(?:(?:just |much )?(?:like|as(?: if| though)?(?: (?:he|she|it|they) (?:is|was|are|were))?)"
    r"|(?:in|with) the (?:manner|style|way) of"
    r"|(?:imitat|pretend|impersonat)(?:e|es|ing)(?: to be)?|acts?(?:ing)? like) $"
)
_COWER, _COWERS_ON_WAY = "cower", "shrinking"
_BACKS_AWAY = re.compile(
    r"\b(?:back(?:s|ing)?|steps?|stepping|walk(?:s|ing)?|mov(?:es?|ing)|shuffl(?:es?|ing)|edg(?:es?|ing)|scrambl(?:es?|ing)"
    r"|creep(?:s|ing)?)(?: \w+ly)? (?:away|backwards?|back|off|up)\b|\bretreat(?:s|ing)?\b"
)
_IN_TURN = re.compile(r"\b(?:then|before|after|until)\b|[;.] \w")
"""Words of one thing after the other."""
_HOW_QUICK = re.compile(
    r" (?:sharply|crisply|smartly|briskly|quickly|swiftly|slowly|formally|properly|firmly|gently|lightly|helplessly"
    r"|deeply|loudly|quietly|softly|vigorously|suddenly|briefly|casually|politely|respectfully|solemnly)"
    r"(?=\W*$|[,.;!]| (?:and|then|before|while|as)\b)"
)
"""Words behind those of a gesture that say how it is done, and nothing of what comes behind it."""
_DENIED = re.compile(
    r"\b(?:(?:without|not|never|no|n't|don't|doesn't)\s+(?:(?!and\b|then\b)\w+\s+){0,2}"
    r"|(?:avoids?|instead of)\s+"
    r"|(?:until|when|if|because|before|after)\s+(?:(?:he|she|they|it|the \w+)(?:'s)?\s+)?(?:(?:is|are)\s+)?)$"
)
_STOPPED = re.compile(r"\bstops?\s+$")
"""Words behind which others say what comes to an end: "stops waving", but not "stops with his hands on his knees"."""
BEHIND_AND = re.compile(r"\b(?:and|then)\b\W*(?:(?:he|she|they|it)\s+)?$", re.IGNORECASE)
_SUBJECT = re.compile(rf"\b(?:(?:{ALL}) (?:(?!(?:{ALL}) )[\w,-]+ ){{0,4}}|who )$")
_ARTICLE = re.compile(r"\b(?:a|an|the|his|her|their|its) (\w+ )?$")
_NOUN_PHRASE = re.compile(rf"(?:\b(?:{ALL}) (?:(?!(?:{ALL}) )\w+ )?)?$")
_MANNER = re.compile(
    r" (?:walk|shuffle|gait|style|run|idle|pose|movement|way)\b(?! (?:toward|forward|a|the|in|on|over))"
)
_ACTS = re.compile(
    r"$|[,.;!]| (?!bars?\b)(?:\w+(?:s|ing|ed|ly)|who|that|in|with|on|at|from|and|comes?|goes?|walk|run|stand)\b"
)
_SIDE = re.compile(r"\b(left|right)\b")
_WITH_HAND = re.compile(
    r"(?: for (?:about )?[\w.]+ ?(?:s|secs?|seconds?))?,? (?:with|using|in|on|from|of) "
    r"(?:(?:the |a )?(?:back|side|palm|heel|tips?|fingers?|sleeve) of )?"
    r"(?:(?:his|her|their|its|the|one's|my|your) )?(?:left|right)[- ]"
    r"(?:(?:index )?(?:hand|arm|fist|thumb|sleeve|palm|finger|forearm|elbow|wrist)s?)\b"
)
"""Words of the hand that does a gesture, behind its own."""
_WITH_BOTH = re.compile(
    r",? (?:with |using )?both (?:of )?(?:(?:his|her|their|its|the) )?(?:arms|hands)\b"
    r"(?! (?:up|raised|out|on|in|over|behind)\b)"
)
"""Words of both hands, behind those of work that both do."""
_OVERHEAD = re.compile(
    r",? (?:overhead|(?:up )?(?:above|over) (?:(?:his|her|their|the) )?head|up above(?: (?:him|her|them))?"
    r"|(?:in|into|on|at|to) (?:the|a) (?:\w+ )?(?:ceiling|rafters))(?![\w'])"
)
"""Words of the place over the head where work is done, behind its own."""
_BY_TURNS = re.compile(
    r"(?:,|:| -)? ?\(?(?:and |while )?(?:(?:with|on|using|by) )?(?:(?:his|her|their|the) )?"
    r"(?:(?:alternat|switch|swapp|chang)\w+(?: (?:his|her|their|the))?(?: (?:legs?|sides?|feet|foot|arms?|hands?|lead)"
    r"| each (?:time|rep))*|(?:both|each|either) (?:legs?|sides?|feet|foot)(?: in turn)?|legs? by turns"
    r"|one leg at a time|one (?:leg|side) (?:after|then) the other|(?:the )?(?:left|right)(?: (?:leg|foot|side))?"
    r"(?:,|/| and| then)+ ?(?:the )?(?:left|right)(?: (?:leg|foot|side))?"
    r"|side to side)\)?(?![\w'])"
)
"""Words of sides by turns, behind those of a movement."""
_OVER_AND_OVER = re.compile(
    r" (?:(?:from )?side to side|back and forth|up and down|to and fro|left and right|over and over(?: again)?)\b"
)
"""Words of how work goes on, behind its own."""
_HOLDING = re.compile(r"(?:,? and|,? then|,| -)? (?:(?:he|she|they) )?(?=hold|keep|maintain|for )")
"""Words between those of a gesture and those that have its pose held."""
_BRINGING = frozenset(
    [
        "cross",
        "fold",
        "put",
        "place",
        "set",
        "cover",
        "hide",
        "bury",
        "clasp",
        "press",
        "answer",
        "hang",
        "end",
        "raise",
        "spread",
        "stretch",
        "extend",
        "stick",
        "shove",
        "stuff",
        "play",
        "strum",
        "swear",
        "pledge",
        "burst",
        "slump",
        "sag",
        "drop",
        "listen",
    ]
)
"""Verbs by which arms come to where they are held: what is told before and after is done before and after."""
_POSTURES = re.compile(r"\b(?:kneel\w*|knelt|crouch\w*|squat\w*|sit|sits|sitting|sat|seated|knees?)\b")
_WHILE = re.compile(r"\b(?:while|whilst|as)\s+(?:(?:he|she|they)\s+)?(?:(?:is|are)\s+)?$")
_WAY = re.compile(rf"\b{WAYS}\b")
_BORNE = rf"(?:{WAYS}|stand(?:s|ing)?|kneel(?:s|ing)?|crouch(?:es|ing)?|idles?|climb(?:s|ing)?|limp(?:s|ing)?)"
_BORNE_BEFORE = re.compile(rf"\b{_BORNE}\b[^.;]*$")
_BORNE_JUST_BEFORE = re.compile(rf"\b{_BORNE} (?:cycle )?$")
_NAMED_AFTER = re.compile(r"[ -](?:walk|gait|run|jog|strut|walking|running)(?: cycle)?(?=\W|$)")
"""A way that is named behind a verb: "swagger walk"."""
_BORNE_AFTER = re.compile(rf"^\W*(?:\w+ly )?(?!\w+ing\b){_BORNE}\b")


@dataclass(frozen=True)
class BearingSpan:
    """Words of a prompt that ask for a bearing, and those that stand in their place.

    Attributes:
        start, end: of these words, with those that join them to others.
        stated: the bearing.
        instead: words in their place.
        own: first of the words that ask for it, where the prompt says that it comes at the same time as a way.
        at_once: they are left out with the words that join both.
    """

    start: int
    end: int
    stated: StatedBearing
    instead: str = ""
    own: int | None = None
    at_once: bool = False

    @property
    def is_gerund(self) -> bool:
        """True if they begin with a verb in -ing."""
        return self.stated.first.endswith("ing")

    @property
    def is_event(self) -> bool:
        """True if something is done in them: "salutes", "crosses his arms"; not "with his arms crossed"."""
        bearing, first = self.stated.bearing, self.stated.first
        arms = bool(bearing.arms) and not (bearing.pace or bearing.gait or bearing.roll)
        feet = bearing.gait in FEET and first.endswith("s")
        return not (self.instead or self.stated.whole or self.own is not None) and (
            bearing.gesture or bearing.work or feet or (arms and first in _event_verbs())
        )


@lru_cache(maxsize=1)
def _event_verbs() -> frozenset[str]:
    """Return the forms of the verbs by which arms are brought to where they are held."""
    return frozenset(form for verb in _BRINGING for form in verb_forms(verb))


@lru_cache(maxsize=_KEPT_READINGS)
def bearing_spans(prompt: str) -> tuple[BearingSpan, ...]:
    """Return the words that ask for bearings in their order; none overlap."""
    text = prompt.lower().replace("’", "'")
    spans: list[BearingSpan] = []
    if len(text) != len(prompt):  # lower case of another length: no language that these words are of
        return ()
    for each in sorted(_matches(text), key=lambda words: (words.start, -words.end, not words.instead)):
        apart = not spans or each.start >= spans[-1].end
        if (apart or _is_of_who(each, spans[-1])) and not _is_denied(text, each.start):
            spans.append(each)
    return tuple(_of_limps(text, _of_cowards(text, _of_zombies(spans))))


def _is_denied(text: str, start: int) -> bool:
    """Return True if what begins there in a text is not done: "without waving", "stops waving"."""
    before = text[:start]
    return bool(_DENIED.search(before) or (_STOPPED.search(before) and not text.startswith("with ", start)))


def _of_limps(text: str, spans: Iterable[BearingSpan]) -> Iterator[BearingSpan]:
    """Yield words, of limps with the leg that hurts, wherever the prompt names it."""
    for each in spans:
        limps = each.stated.bearing.gait == _LIMP
        yield replace(each, stated=replace(each.stated, side=hurt_leg(text))) if limps else each


def _is_of_who(found: BearingSpan, joined: BearingSpan) -> bool:
    """Return True if words are said of the person who is left out with other words: "runs, the tired man waves"."""
    return joined.own is not None and found.end <= joined.own


def _of_zombies(spans: Sequence[BearingSpan]) -> Iterator[BearingSpan]:
    """Yield words, of zombies with arms that are "out" ahead, not at the sides, and that lurch as the dead do, not as
    drunkards."""
    ahead = any(each.stated.name == "zombie" for each in spans)
    for each in spans:
        if ahead and each.stated.name == "drunk" and not each.stated.whole:
            yield replace(each, stated=replace(each.stated, name="zombie"))
            continue
        out = ahead and each.stated.name == "arms-wide" and each.stated.words.endswith(" out")
        yield replace(each, stated=replace(each.stated, name="arms-ahead")) if out else each


def _of_cowards(text: str, spans: Iterable[BearingSpan]) -> Iterator[BearingSpan]:
    """Yield words, of who cowers with the way back on which it does so: "cowers in fear, backing away"."""
    backs = _BACKS_AWAY.search(text) is not None and _IN_TURN.search(text) is None
    for each in spans:
        cowers = backs and each.stated.name == _COWER
        yield replace(each, stated=replace(each.stated, name=_COWERS_ON_WAY)) if cowers else each


def _matches(text: str) -> Iterator[BearingSpan]:
    for name, kind, pattern in bearing_patterns(text):
        for match in pattern.finditer(text):
            if name in unless_beside() and unless_beside()[name].search(text):
                break
            if name in only_beside() and not only_beside()[name].search(text):
                break
            for each in _words_of(text, name, kind, match):
                yield from _with_joints(text, _held(text, _counted(text, each)), only=kind == "meanwhile")


def _held(text: str, found: BearingSpan) -> BearingSpan:
    """Return words of a gesture with those behind them that have its pose held: "salutes, holds it for 4 seconds"."""
    bearing, joint = found.stated.bearing, _HOLDING.match(text, found.end)
    if joint is None or not bearing.gesture or bearing.moves or bearing.stroke_hz or bearing.keys or found.instead:
        return found
    hold = held_words(text, joint.end())
    if hold is None:
        return found
    return replace(found, end=hold[1], stated=replace(found.stated, hold_s=hold[0]))


def _with_joints(text: str, found: BearingSpan, *, only: bool) -> Iterator[BearingSpan]:
    """Yield words, with those that join them to a way or a posture at the same time.

    Args:
        text: in lower case.
        found: words of a bearing.
        only: they ask for it only at the same time as a way.
    """
    arms = found.stated.bearing.gesture or found.stated.bearing.arms
    may_join = not found.instead and bool(only or arms)
    joined = spans_at_once(text, found.start, found.end) if may_join else ()
    for start, end in joined:
        yield replace(found, start=start, end=end, own=found.start, at_once=True)
    if not joined and not only:
        yield found
    elif not joined and is_on_a_way(text, found.start, found.end):
        yield replace(found, own=found.start)


def _counted(text: str, found: BearingSpan) -> BearingSpan:
    """Return words with the number of strokes that they or those beside them name, which are left out with them."""
    bearing = found.stated.bearing
    if not (bearing.gesture or bearing.work or bearing.gait == "stomp") or found.instead:
        return found
    number = stated_strokes(text[found.start : found.end])
    if number is not None:
        return replace(found, stated=replace(found.stated, times=number))
    if behind := strokes_behind(text, found.end):
        return replace(found, end=behind.end, stated=replace(found.stated, times=behind.number))
    before = strokes_before(text[: found.start])
    if before is None:
        return found
    return replace(found, start=before[1], stated=replace(found.stated, times=before[0]))


def _words_of(text: str, name: str, kind: str, match: re.Match[str]) -> Iterator[BearingSpan]:
    """Yield the words of a bearing, as one match of a pattern of its kind has them."""
    whole = kind in ("adjectives", "beings", "people")
    stated = StatedBearing(name, _side(match[0]), whole, match[0])
    if kind in ("gaits", "loads"):
        yield from _gait(text, match, stated, _LOAD if kind == "loads" else "")
    elif kind in ("beings", "people"):
        yield from _being(text, match, stated, _PERSON if kind == "beings" else match[0])
    elif kind == "read":
        yield BearingSpan(*match.span(), stated, match[0])
    elif kind == "by":
        start, end = match.span(DOES)
        both = _WITH_BOTH.match(text, end) if stated.bearing.work else None
        end = end if both is None else both.end()
        yield BearingSpan(start, end, replace(stated, side=_side(match[DOES]), words=match[DOES]))
    elif kind == "beside":
        beside = _is_beside(f"{text[: match.start()]} {text[match.end() :]}", match[0])
        if beside or spans_at_once(text, *match.span()):
            yield BearingSpan(*match.span(), stated)
    elif kind in ("how", "meanwhile") or _is_subject(text[: match.start()]):
        by_hand = stated.bearing.gesture or stated.bearing.work or len(stated.bearing.arms) == 1
        hand = _WITH_HAND.match(text, match.end()) if not stated.side and by_hand else None
        over = _OVER_AND_OVER.match(text, match.end()) if stated.bearing.work else None
        over = _OVERHEAD.match(text, match.end()) or over if stated.bearing.work else over
        if over is not None and OVERHEAD.search(over[0]):
            stated = replace(stated, words=text[match.start() : over.end()])
        if stated.bearing.moves and (turns := _BY_TURNS.match(text, match.end())):
            over, stated = turns, replace(stated, words=text[match.start() : turns.end()])
        if over is None and stated.bearing.work and len(stated.bearing.arms) > 1:
            over = _WITH_BOTH.match(text, match.end())
        if hand is None:
            end = match.end() if over is None else over.end()
            quick = _HOW_QUICK.match(text, end) if stated.bearing.gesture else None
            yield BearingSpan(match.start(), end if quick is None else quick.end(), stated)
        else:
            yield BearingSpan(match.start(), hand.end(), replace(stated, side=_side(hand[0])))


def _is_beside(text: str, words: str) -> bool:
    """Return True if a body does what these words say in a posture that the rest of its prompt names, or on its way:
    "kneels and aims a rifle", "walks aiming a rifle", but not "walks in and aims a rifle"."""
    first = words.split()[0]
    return bool(_POSTURES.search(text) or ((first.endswith("ing") or first == "with") and _WAY.search(text)))


def _is_subject(before: str) -> bool:
    """Return True if nothing is done in the words before those that begin to say who does it."""
    return not says_more(_SUBJECT.sub("", before))


def _gait(text: str, match: re.Match[str], stated: StatedBearing, load: str) -> Iterator[BearingSpan]:
    """Yield the words of a verb that is read as walking; "a swaggering cowboy" is said of the person.

    Only the load, if any, stands in their place where the prompt names a way beside, and nothing beside a posture:
    "walks carrying a box", "stands carrying a box".
    """
    before, verb = text[: match.start()], match["verb"]
    if verb.endswith("ing") and not load and person_ahead().match(text, match.end()):
        yield BearingSpan(*match.span(), replace(stated, whole=True))
    elif _is_borne_otherwise(before, verb, text[match.end() :]):
        goes = load if _WAY.search(text) else ""
        joint = _WHILE.search(before) if goes else None
        yield BearingSpan(match.start() if joint is None else joint.start(), match.end(), stated, goes.strip())
    elif not _is_noun(before, verb):
        yield BearingSpan(*match.span(), stated, walking_forms()[verb] + load)


def _is_borne_otherwise(before: str, verb: str, after: str) -> bool:
    """Return True if the words around a verb say how the body goes or stands: "stands carrying", "a walk limp"."""
    if verb.endswith("ing"):
        goes = _BORNE_BEFORE.search(before) and not BEHIND_AND.search(before)
        return bool(goes or _BORNE_AFTER.match(after))
    named = _BORNE_JUST_BEFORE.search(before) or _NAMED_AFTER.match(after)
    return not verb.endswith(("s", "ed")) and bool(named)


def _is_noun(before: str, verb: str) -> bool:
    """Return True for "stagger" behind "a" or "a wild", not behind "a man"."""
    article = _ARTICLE.search(before)
    if article is None or article[1] is None:
        return article is not None
    return not verb.endswith("s") and article[1].strip() not in load_word_lists().people


def _being(text: str, match: re.Match[str], stated: StatedBearing, instead: str) -> Iterator[BearingSpan]:
    """Yield the words of a being: who acts is read as another, what a person is like is left out."""
    article = _NOUN_PHRASE.search(text[: match.start()])
    begin = match.start() if article is None else article.start()
    like, after = _LIKE.search(text[:begin]), text[match.end() :]
    if like is not None:
        yield BearingSpan(like.start(), match.end(), stated)
    elif _MANNER.match(after):
        yield BearingSpan(*match.span(), stated)
    elif _ACTS.match(after) and not says_more(text[:begin]):
        yield BearingSpan(*match.span(), stated, instead)


def _side(words: str) -> Side:
    side = _SIDE.search(words)
    if side is None:
        return ""
    return drawing_hand(words) or ("left" if side[1] == "left" else "right")
