"""The words of a prompt that say how the body bears itself, and the prompt without them."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from marey.vocabulary.bearing_patterns import (
    ALL,
    DOES,
    SEEMS,
    bearing_patterns,
    doers,
    named_by_adjectives,
    only_beside,
    person_ahead,
    unless_beside,
    walking_forms,
)
from marey.vocabulary.bearings import FEET, Side, StatedBearing, each_once
from marey.vocabulary.counts import stated_strokes, strokes_before, strokes_behind
from marey.vocabulary.held_poses import held_words
from marey.vocabulary.hurt_legs import hurt_leg
from marey.vocabulary.inflection import verb_forms
from marey.vocabulary.lengths import known_verb_forms
from marey.vocabulary.meanwhile import AT_ONCE, JOINS_AHEAD, WAYS, is_on_a_way, spans_at_once
from marey.vocabulary.sheaths import drawing_hand
from marey.vocabulary.word_lists import load_word_lists

KEPT_READINGS = 1024
"""Prompts whose words are kept as read: reader, scope and manifest ask for the same ones."""
_LOAD, _PERSON, LIMP = " with a load", "person", "limp"
_JOINT = re.compile(
    r"(?:^|(?<=\W))(?:(?:and|then|while|as|but|first|who|that|with)\s+)*(?:(?:he|she|they|it)\s+)?(?:(?:is|are)\s+)?$",
    re.IGNORECASE,
)
"""Words that join these to what comes before."""
_JOINED = re.compile(r"^\s*[,;]?\s*(?:(?:and|then|while|as|who|before)\s+)*(?:(?:he|she|they|it)\s+)?", re.IGNORECASE)
"""Words that join what comes behind these."""
_LIKE = re.compile(
    r"\b(?:(?:just |much )?(?:like|as(?: if| though)?(?: (?:he|she|it|they) (?:is|was|are|were))?)"
    r"|(?:in|with) the (?:manner|style|way) of"
    r"|(?:imitat|pretend|impersonat)(?:e|es|ing)(?: to be)?|acts?(?:ing)? like) $"
)
_DENIED = re.compile(
    r"\b(?:(?:without|not|never|no|n't|don't|doesn't)\s+(?:(?!and\b|then\b)\w+\s+){0,2}"
    r"|(?:stops?|avoids?|instead of)\s+"
    r"|(?:until|when|if|because|before|after)\s+(?:(?:he|she|they|it|the \w+)\s+)?(?:(?:is|are)\s+)?)$"
)
_AT_ONCE = re.compile(r"\b(?:while|as|still|whilst)\W*(?:(?:he|she|they|it)\s+)?(?:(?:is|are)\s+)?$", re.IGNORECASE)
_AND = re.compile(r"\b(?:and|then)\b\W*(?:(?:he|she|they|it)\s+)?$", re.IGNORECASE)
_AT_ONCE_AFTER = re.compile(r"^\W*(?:while|as|whilst|during|when|seated|sitting)\b", re.IGNORECASE)
_UNTIDY = tuple(
    re.compile(pattern)
    for pattern in (
        r"[\s,;]*\b(?:(?:and|but|while|who|that) )?(?:(?:he|she|they|it) )?"
        rf"{SEEMS}(?: (?:to be|like|very|really|so|quite|rather|a (?:bit|little)))*\s*(?=[,.;!?]|$)",
        r"\s+(?=[\s,.;!?])",
        r",\s*(?=[,.;])",
        r"^[\s,;.]+(?:and\s+)?",
        r"[\s,;]+(?:(?:and|while|with|as)\s*)?(?=[.!?]*$)",
        r"(?<=\b[Aa])n(?= [^aeiouAEIOU])",
    )
)
"""Verbs of what is seen in a body without what is seen, spaces and commas that stand twice or at the ends, words that
join nothing, and "an" before a consonant."""
_SUBJECT = re.compile(rf"\b(?:(?:{ALL}) (?:(?!(?:{ALL}) )[\w,-]+ ){{0,4}}|who )$")
_NO_ACTION = frozenset(
    [
        "a",
        "an",
        "the",
        "is",
        "are",
        "and",
        "who",
        "then",
        "as",
        "while",
        "to",
        "in",
        "at",
        "with",
        "of",
        "want",
        "need",
        "one",
        "where",
        "me",
        "my",
        "make",
        "show",
        "create",
        "generate",
        "animate",
        "animation",
        "clip",
        "please",
        "can",
        "have",
    ]
)
_DOER = re.compile(
    r"^\W*(?:an?|the|my|his|her|this) (?:\w+ )?\w+(?:ist|er|or|ian|[a-z]man|[a-z]woman)s?\W*$"
    r"|^\W*(?:(?:an?|the|my|his|her|our|this) )?(?:[\w-]+ )?"
    r"(?:basketball|tennis|football|soccer|volleyball|baseball|golf|hockey|badminton|rugby|cricket) "
    r"(?:player|star|pro|champion|coach|fan)s?\W*$"
)
"""A noun that names a person by what they do: "a violinist"."""
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
_ONLY_LENGTH = re.compile(
    r"\W*(?:for|lasting|during) (?:about |around |some )?[\w.]+ ?(?:s|secs?|seconds?|moments?|while)\W*"
)
"""Words of how long something is done, and of nothing else."""
_SHIVERS = re.compile(
    r",? (?:and )?(?:his |her |their )?(?:whole )?(?:body )?(?:shiver|trembl|shak)\w*\b", re.IGNORECASE
)
"""Beginning of what is done all the while: "hugs herself, shivering"."""
_GOES_ON = re.compile(
    r"\b(?:go|goes|going|comes?|coming) (?:back )?(?:in|inside|out|outside|through|away|upstairs|downstairs)\b"
)
"""Words of a way of which every one says nothing alone."""
_OVER_AND_OVER = re.compile(
    r" (?:(?:from )?side to side|back and forth|up and down|to and fro|left and right|over and over(?: again)?)\b"
)
"""Words of how work goes on, behind its own."""
_HOLDING = re.compile(r"(?:,? and|,? then|,| -)? (?:(?:he|she|they) )?(?=hold|keep|maintain|for )")
"""Words between those of a gesture and those that have its pose held."""
_HANDED = re.compile(r"\b(?:left|right)[- ]handed\b")
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
class _Words:
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


@dataclass(frozen=True)
class BarePrompt:
    """A prompt without the words that ask for a bearing.

    Attributes:
        prompt: as a user typed it.
        text: "a man walks" of "an old man shambles"; empty if the prompt asks for nothing else.
        places: where in the prompt each character of the text comes from.
        stated: the bearings, each once, in their order.
    """

    prompt: str
    text: str
    places: tuple[int, ...]
    stated: tuple[StatedBearing, ...]

    @classmethod
    def of(cls, prompt: str) -> BarePrompt:
        """Read a prompt."""
        found = _found(prompt)
        if not found:
            return as_written(prompt)
        return cls(prompt, *_without(prompt, found), each_once(each.stated for each in found))

    def written(self, start: int, end: int) -> str:
        """Return the words of the prompt of which these characters of the text are left."""
        begin = 0 if start == 0 else self._edge(start)
        return self.prompt[begin:] if end >= len(self.text) else self.prompt[begin : self._edge(end)]

    def _edge(self, at: int) -> int:
        """Return where in the prompt a clause begins that begins here in the text; a word left out that joins it to a
        bearing of the same time is its own: "stops, and | as he turns, he nods"."""
        place = self.places[at]
        if at == 0:
            return place
        joint = JOINS_AHEAD.search(self.prompt[self.places[at - 1] + 1 : place])
        return place if joint is None else place - len(joint[0])

    def fits(self, action: str) -> bool:
        """Return True if one of the bearings at least can be shown beside an action of the vocabulary."""
        return any(each.shown_in(action) for each in self.stated)


def as_written(prompt: str) -> BarePrompt:
    """Return a prompt that is read with all its words."""
    return BarePrompt(prompt, prompt, tuple(range(len(prompt))), ())


def stated_bearings(prompt: str) -> tuple[StatedBearing, ...]:
    """Return the bearings that a prompt asks for, each once, in their order.

    Args:
        prompt: as a user typed it.
    """
    return each_once(each.stated for each in _found(prompt))


def is_done_at_once(text: str) -> bool:
    """Return True if a text says in two clauses what a body does, and which bearing it has in it: "as he runs, he
    waves"."""
    return AT_ONCE.search(text) is not None and any(each.at_once for each in _found(text))


def parts_by_gestures(prompt: str) -> tuple[str, ...]:
    """Return the parts of a prompt with gestures that come before or after what else is done.

    "walks forward" and "salutes" of "walks forward and salutes"; none if there are no such gestures.
    """
    parts, at, last = list[str](), 0, ""
    found = _found(prompt)
    events = [each.stated.bearing for each in found if each.is_event]
    in_turn = len(events) > 1 and not all(each.gesture for each in events)
    for each in found:
        before, behind = prompt[at : each.start], prompt[each.end :]
        if not each.is_event or _AT_ONCE.search(before) or _AT_ONCE_AFTER.match(behind):
            continue
        acts = _acts(before)
        if not (parts or acts or in_turn or _acts(behind)) or (acts and each.is_gerund and not _AND.search(before)):
            continue
        if acts:
            parts.append(prompt[at : at + _joint(before)].strip(" ,;."))
        if acts or each.stated.name != last:
            parts.append(prompt[each.start if acts else at : each.end].strip(" ,;."))
        at, last = each.end, each.stated.name
    rest = _JOINED.sub("", prompt[at:]).strip(" ,;.")
    if len(parts) == 1 and _SHIVERS.match(prompt, at) and "shiver" in events[0].also:
        return ()
    if parts and _ONLY_LENGTH.fullmatch(rest):
        parts[-1] = f"{parts[-1]} {rest}"
    elif parts and _acts(rest):
        parts.append(rest)
    return (*parts[:1], *map(_without_joint, parts[1:])) if len(parts) > 1 else ()


@lru_cache(maxsize=1)
def _event_verbs() -> frozenset[str]:
    """Return the forms of the verbs by which arms are brought to where they are held."""
    return frozenset(form for verb in _BRINGING for form in verb_forms(verb))


def _without_joint(part: str) -> str:
    """Return a part of a prompt without the words that join it to the one before: "salutes" of "and then salutes"."""
    return _JOINED.sub("", part) or part


def _acts(text: str) -> bool:
    """Return True if something else is done in a text than bearing oneself in some way."""
    named = named_by_adjectives().match(text.lower())
    if named is not None and named["noun"] not in known_verb_forms():
        return False
    return says_more(BarePrompt.of(text.strip(" ,;.")).text)


def _joint(before: str) -> int:
    """Return where the words begin that join what follows to these."""
    joint = _JOINT.search(before)
    return len(before) if joint is None else joint.start()


def _without(prompt: str, found: Sequence[_Words]) -> tuple[str, tuple[int, ...]]:
    """Return a prompt without words, and where each of its characters was."""
    places, kept, at = list[int](), "", 0
    for each in found:
        if each.start < at:
            continue
        whole = each.instead or each.at_once
        begin = at + _joint(prompt[at : each.start])
        ahead = each.own is not None and each.end <= each.own  # the word that joins two clauses alone
        if each.instead or ahead or (each.at_once and says_more(kept + prompt[at:begin])):
            begin = each.start
        kept, places = kept + prompt[at:begin], [*places, *range(at, begin)]
        kept, places = kept + each.instead, [*places, *[each.start] * len(each.instead)]
        at = each.end
        joined = _JOINED.match(prompt[at:])
        if joined is not None and not whole and not says_more(kept):
            length = len(kept.rstrip())
            kept, places, at = f"{kept[:length]} ", [*places[:length], each.start], at + joined.end()
    return _tidied(kept + prompt[at:], [*places, *range(at, len(prompt))])


def _tidied(text: str, places: Sequence[int]) -> tuple[str, tuple[int, ...]]:
    """Return a text without what is untidy, and where each of its characters was; empty if nothing is done in it."""
    left = list(range(len(text)))
    for pattern in _UNTIDY:
        joined = "".join(text[k] for k in left)
        gone = {k for found in pattern.finditer(joined) for k in range(found.start(), found.end())}
        left = [k for n, k in enumerate(left) if n not in gone]
    text, places = "".join(text[k] for k in left), tuple(places[k] for k in left)
    return (text, places) if says_more(text) else ("", ())


def says_more(text: str) -> bool:
    """Return True if a text names more than who acts."""
    if _GOES_ON.search(text.lower()):
        return True
    lists = load_word_lists()
    words = set(re.findall(r"[a-z']+", _HANDED.sub("", text.lower())))
    said = words - lists.people - lists.determiners - lists.skipped - lists.auxiliaries - _NO_ACTION
    if len(said) > 1:
        return not (doers().match(text.lower()) or _DOER.match(text.lower()))
    return bool(said) and not (doers().match(text.lower()) or _DOER.search(text.lower()))


@lru_cache(maxsize=KEPT_READINGS)
def _found(prompt: str) -> tuple[_Words, ...]:
    """Return the words that ask for bearings in their order; none overlap."""
    text = prompt.lower().replace("’", "'")
    spans: list[_Words] = []
    if len(text) != len(prompt):  # lower case of another length: no language that these words are of
        return ()
    for each in sorted(_matches(text), key=lambda words: (words.start, -words.end, not words.instead)):
        apart = not spans or each.start >= spans[-1].end
        if (apart or _is_of_who(each, spans[-1])) and not _DENIED.search(text[: each.start]):
            spans.append(each)
    return tuple(_of_limps(text, _of_zombies(spans)))


def _of_limps(text: str, spans: Iterable[_Words]) -> Iterator[_Words]:
    """Yield words, of limps with the leg that hurts, wherever the prompt names it."""
    for each in spans:
        limps = each.stated.bearing.gait == LIMP
        yield replace(each, stated=replace(each.stated, side=hurt_leg(text))) if limps else each


def _is_of_who(found: _Words, joined: _Words) -> bool:
    """Return True if words are said of the person who is left out with other words: "runs, the tired man waves"."""
    return joined.own is not None and found.end <= joined.own


def _of_zombies(spans: Sequence[_Words]) -> Iterator[_Words]:
    """Yield words, of zombies with arms that are "out" ahead, not at the sides, and that lurch as the dead do, not as
    drunkards."""
    ahead = any(each.stated.name == "zombie" for each in spans)
    for each in spans:
        if ahead and each.stated.name == "drunk" and not each.stated.whole:
            yield replace(each, stated=replace(each.stated, name="zombie"))
            continue
        out = ahead and each.stated.name == "arms-wide" and each.stated.words.endswith(" out")
        yield replace(each, stated=replace(each.stated, name="arms-ahead")) if out else each


def _matches(text: str) -> Iterator[_Words]:
    for name, kind, pattern in bearing_patterns():
        for match in pattern.finditer(text):
            if name in unless_beside() and unless_beside()[name].search(text):
                break
            if name in only_beside() and not only_beside()[name].search(text):
                break
            for each in _words_of(text, name, kind, match):
                yield from _with_joints(text, _held(text, _counted(text, each)), only=kind == "meanwhile")


def _held(text: str, found: _Words) -> _Words:
    """Return words of a gesture with those behind them that have its pose held: "salutes, holds it for 4 seconds"."""
    bearing, joint = found.stated.bearing, _HOLDING.match(text, found.end)
    if joint is None or not bearing.gesture or bearing.moves or bearing.stroke_hz or bearing.keys or found.instead:
        return found
    hold = held_words(text, joint.end())
    if hold is None:
        return found
    return replace(found, end=hold[1], stated=replace(found.stated, hold_s=hold[0]))


def _with_joints(text: str, found: _Words, *, only: bool) -> Iterator[_Words]:
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


def _counted(text: str, found: _Words) -> _Words:
    """Return words with the number of strokes that they or those beside them name, which are left out with them."""
    bearing = found.stated.bearing
    if not (bearing.gesture or bearing.work or bearing.gait == "stomp") or bearing.moves or found.instead:
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


def _words_of(text: str, name: str, kind: str, match: re.Match[str]) -> Iterator[_Words]:
    """Yield the words of a bearing, as one match of a pattern of its kind has them."""
    whole = kind in ("adjectives", "beings", "people")
    stated = StatedBearing(name, _side(match[0]), whole, match[0])
    if kind in ("gaits", "loads"):
        yield from _gait(text, match, stated, _LOAD if kind == "loads" else "")
    elif kind in ("beings", "people"):
        yield from _being(text, match, stated, _PERSON if kind == "beings" else match[0])
    elif kind == "read":
        yield _Words(*match.span(), stated, match[0])
    elif kind == "by":
        start, end = match.span(DOES)
        both = _WITH_BOTH.match(text, end) if stated.bearing.work else None
        end = end if both is None else both.end()
        yield _Words(start, end, replace(stated, side=_side(match[DOES]), words=match[DOES]))
    elif kind == "beside":
        beside = _is_beside(f"{text[: match.start()]} {text[match.end() :]}", match[0])
        if beside or spans_at_once(text, *match.span()):
            yield _Words(*match.span(), stated)
    elif kind in ("how", "meanwhile") or _is_subject(text[: match.start()]):
        by_hand = stated.bearing.gesture or stated.bearing.work or len(stated.bearing.arms) == 1
        hand = _WITH_HAND.match(text, match.end()) if not stated.side and by_hand else None
        over = _OVER_AND_OVER.match(text, match.end()) if stated.bearing.work else None
        if over is None and stated.bearing.work and len(stated.bearing.arms) > 1:
            over = _WITH_BOTH.match(text, match.end())
        if hand is None:
            yield _Words(match.start(), match.end() if over is None else over.end(), stated)
        else:
            yield _Words(match.start(), hand.end(), replace(stated, side=_side(hand[0])))


def _is_beside(text: str, words: str) -> bool:
    """Return True if a body does what these words say in a posture that the rest of its prompt names, or on its way:
    "kneels and aims a rifle", "walks aiming a rifle", but not "walks in and aims a rifle"."""
    first = words.split()[0]
    return bool(_POSTURES.search(text) or ((first.endswith("ing") or first == "with") and _WAY.search(text)))


def _is_subject(before: str) -> bool:
    """Return True if nothing is done in the words before those that begin to say who does it."""
    return not says_more(_SUBJECT.sub("", before))


def _gait(text: str, match: re.Match[str], stated: StatedBearing, load: str) -> Iterator[_Words]:
    """Yield the words of a verb that is read as walking; "a swaggering cowboy" is said of the person.

    Only the load, if any, stands in their place where the prompt names a way beside, and nothing beside a posture:
    "walks carrying a box", "stands carrying a box".
    """
    before, verb = text[: match.start()], match["verb"]
    if verb.endswith("ing") and not load and person_ahead().match(text, match.end()):
        yield _Words(*match.span(), replace(stated, whole=True))
    elif _is_borne_otherwise(before, verb, text[match.end() :]):
        goes = load if _WAY.search(text) else ""
        joint = _WHILE.search(before) if goes else None
        yield _Words(match.start() if joint is None else joint.start(), match.end(), stated, goes.strip())
    elif not _is_noun(before, verb):
        yield _Words(*match.span(), stated, walking_forms()[verb] + load)


def _is_borne_otherwise(before: str, verb: str, after: str) -> bool:
    """Return True if the words around a verb say how the body goes or stands: "stands carrying", "a walk limp"."""
    if verb.endswith("ing"):
        goes = _BORNE_BEFORE.search(before) and not _AND.search(before)
        return bool(goes or _BORNE_AFTER.match(after))
    named = _BORNE_JUST_BEFORE.search(before) or _NAMED_AFTER.match(after)
    return not verb.endswith(("s", "ed")) and bool(named)


def _is_noun(before: str, verb: str) -> bool:
    """Return True for "stagger" behind "a" or "a wild", not behind "a man"."""
    article = _ARTICLE.search(before)
    if article is None or article[1] is None:
        return article is not None
    return not verb.endswith("s") and article[1].strip() not in load_word_lists().people


def _being(text: str, match: re.Match[str], stated: StatedBearing, instead: str) -> Iterator[_Words]:
    """Yield the words of a being: who acts is read as another, what a person is like is left out."""
    article = _NOUN_PHRASE.search(text[: match.start()])
    begin = match.start() if article is None else article.start()
    like, after = _LIKE.search(text[:begin]), text[match.end() :]
    if like is not None:
        yield _Words(like.start(), match.end(), stated)
    elif _MANNER.match(after):
        yield _Words(*match.span(), stated)
    elif _ACTS.match(after) and not says_more(text[:begin]):
        yield _Words(*match.span(), stated, instead)


def _side(words: str) -> Side:
    side = _SIDE.search(words)
    if side is None:
        return ""
    return drawing_hand(words) or ("left" if side[1] == "left" else "right")
