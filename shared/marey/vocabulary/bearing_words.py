"""A prompt without the words that say how the body bears itself, and the bearings that it asks for."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from marey.vocabulary.bearing_patterns import (
    SEEMS,
    named_by_adjectives,
)
from marey.vocabulary.bearing_spans import BEHIND_AND, BearingSpan, bearing_spans
from marey.vocabulary.bearings import StatedBearing, each_once
from marey.vocabulary.lengths import known_verb_forms
from marey.vocabulary.meanwhile import AT_ONCE, JOINS_AHEAD
from marey.vocabulary.who_acts import says_more

_JOINT = re.compile(
    r"(?:^|(?<=\W))(?:(?:and|then|while|as|but|first|who|that|with)\s+)*(?:(?:he|she|they|it)\s+)?(?:(?:is|are)\s+)?$",
    re.IGNORECASE,
)
"""Words that join these to what comes before."""
_JOINED = re.compile(r"^\s*[,;]?\s*(?:(?:and|then|while|as|who|before)\s+)*(?:(?:he|she|they|it)\s+)?", re.IGNORECASE)
"""Words that join what comes behind these."""
_AT_ONCE = re.compile(r"\b(?:while|as|still|whilst)\W*(?:(?:he|she|they|it)\s+)?(?:(?:is|are)\s+)?$", re.IGNORECASE)
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
_FACE = re.compile(
    r"[\s,;]*(?:\b(?:and|with|while) )?\b(?:(?:his|her|their|its|the) )?"
    r"(?:(?:eyes?|lips?|chin|teeth|mouth|jaw|brows?|voice)"
    r" (?:(?:is|are) )?(?:closed|shut|wide|open|clenched|furrowed|shaking|quivering|trembling|chattering|red|breaking"
    r"|squeezed shut|half closed)|tears (?:streaming|running|rolling|flowing|pouring)"
    r"(?: down (?:his|her|their) (?:face|cheeks))?"
    r"|(?:hand|fist) (?:over|before|to|at|on|covering) (?:(?:his|her|their|the) )?mouth)(?: wide| tight(?:ly)?| open)?"
    r"(?=\s*(?:$|[,.;!]|(?:and|while)\b))",
    re.IGNORECASE,
)
"""Faces, which no motion shows, and the hand that is at the mouth of who coughs or yawns."""
_HEAVES = re.compile(
    r"[\s,;]*(?:\b(?:and|with|while) )?\b(?:(?:his|her|their|its|the|whole) )*(?:shoulders?|body|frame|chest|back)"
    r" (?:(?:is|are) )?(?:visibly )?"
    r"(?:shaking|heaving|trembling|quivering|jerking|convulsing|shuddering|rising and falling)"
    r"(?: \w+ly)?(?: with (?:(?:each|every|his|her) )?\w+)?(?=\s*(?:$|[,.;!]|(?:and|while)\b))",
    re.IGNORECASE,
)
"""A trunk that moves with its breath, as it is drawn of who sobs or is winded."""
_ONLY_LENGTH = re.compile(
    r"\W*(?:for|lasting|during) (?:about |around |some )?[\w.]+ ?(?:s|secs?|seconds?|moments?|while)\W*"
)
"""Words of how long something is done, and of nothing else."""
_SHIVERS = re.compile(
    r",? (?:and )?(?:his |her |their )?(?:whole )?(?:body )?(?:shiver|trembl|shak)\w*\b", re.IGNORECASE
)
"""Beginning of what is done all the while: "hugs herself, shivering"."""


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
        found = bearing_spans(prompt)
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
    return each_once(each.stated for each in bearing_spans(prompt))


def is_done_at_once(text: str) -> bool:
    """Return True if a text says in two clauses what a body does, and which bearing it has in it: "as he runs, he
    waves"."""
    return AT_ONCE.search(text) is not None and any(each.at_once for each in bearing_spans(text))


def parts_by_gestures(prompt: str) -> tuple[str, ...]:
    """Return the parts of a prompt with gestures that come before or after what else is done.

    "walks forward" and "salutes" of "walks forward and salutes"; none if there are no such gestures.
    """
    parts, at, last = list[str](), 0, ""
    found = bearing_spans(prompt)
    events = [each.stated.bearing for each in found if each.is_event]
    in_turn = len(events) > 1 and not all(each.gesture for each in events)
    for each in found:
        before, behind = prompt[at : each.start], prompt[each.end :]
        if not each.is_event or _AT_ONCE.search(before) or _AT_ONCE_AFTER.match(behind):
            continue
        acts = _acts(before)
        alone = acts and each.is_gerund and not BEHIND_AND.search(before)
        if alone or not (parts or acts or in_turn or _acts(behind)):
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


def _without_joint(part: str) -> str:
    """Return a part of a prompt without the words that join it to the one before: "salutes" of "and then salutes"."""
    return _JOINED.sub("", part) or part


def _acts(text: str) -> bool:
    """Return True if something else is done in a text than bearing oneself in some way."""
    text = _HEAVES.sub("", _FACE.sub("", text))
    named = named_by_adjectives().match(text.lower())
    if named is not None and named["noun"] not in known_verb_forms():
        return False
    return says_more(BarePrompt.of(text.strip(" ,;.")).text)


def _joint(before: str) -> int:
    """Return where the words begin that join what follows to these."""
    joint = _JOINT.search(before)
    return len(before) if joint is None else joint.start()


def _without(prompt: str, found: Sequence[BearingSpan]) -> tuple[str, tuple[int, ...]]:
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
    heaves = any(each.stated.bearing.sob or each.stated.bearing.heave for each in found)
    patterns = (_FACE, *((_HEAVES,) if heaves else ()), *_UNTIDY)
    return _tidied(kept + prompt[at:], [*places, *range(at, len(prompt))], patterns)


def _tidied(text: str, places: Sequence[int], patterns: Sequence[re.Pattern[str]]) -> tuple[str, tuple[int, ...]]:
    """Return a text without what is untidy, and where each of its characters was; empty if nothing is done in it."""
    left = list(range(len(text)))
    for pattern in patterns:
        joined = "".join(text[k] for k in left)
        gone = {k for found in pattern.finditer(joined) for k in range(found.start(), found.end())}
        left = [k for n, k in enumerate(left) if n not in gone]
    text, places = "".join(text[k] for k in left), tuple(places[k] for k in left)
    return (text, places) if says_more(text) else ("", ())
