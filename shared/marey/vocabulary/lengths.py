"""Lengths that a prompt states in words: "for six seconds", "a 3-second idle", "2s of waving".

Standard library only. A bundle's range of lengths is not known here (`marey.bundles.limits`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.held_poses import without_held_pose
from marey.vocabulary.inflection import third_person
from marey.vocabulary.word_lists import load_word_lists

_TO_TWENTY = """one two three four five six seven eight nine ten eleven twelve thirteen fourteen fifteen sixteen
seventeen eighteen nineteen twenty"""
NUMBERS: Mapping[str, int] = {word: number for number, word in enumerate(_TO_TWENTY.split(), 1)}
"""The numbers from 1 to 20, by their words."""
TO_TEN, TO_TWELVE, TO_TWENTY = ("|".join([*NUMBERS][:last]) for last in (10, 12, 20))
"""Words of the numbers from 1 on, for patterns."""
_NUMBERS = {
    **{word: float(number) for word, number in NUMBERS.items()},
    "thirty": 30.0,
    "forty": 40.0,
    "fifty": 50.0,
    "sixty": 60.0,
    "ninety": 90.0,
    "a": 1.0,
    "an": 1.0,
}
_WORDS = "|".join(sorted(_NUMBERS, key=len, reverse=True))
_UNIT = r"(?P<unit>seconds?|secs?|s|minutes?|mins?)"
_FULL = r"(?:(?:whole|full|entire|long|solid)[ ])?"
_LENGTH = re.compile(
    rf"""\b(?:
        (?P<half>half)[ ](?:a|of[ ]a)[ ]{_UNIT.replace("unit", "half_unit")}
      | (?P<digits>(?<![\d.,])\d{{1,3}}(?:[.,]\d+)?)[ -]?{_FULL}{_UNIT.replace("unit", "digit_unit")}
      | (?P<word>{_WORDS})(?P<and_half>[ ]and[ ]a[ ]half)?[ -]{_FULL}{_UNIT.replace("unit", "word_unit")}
        (?P<half_after>[ ]and[ ]a[ ]half)?
    )\b(?!['’])""",
    re.VERBOSE,
)
_BEFORE = re.compile(r"\b(?:after|every|each|first|last|next|another|per|within|at|than|the)(?: \w+)?[ ]$")
"""Words before a time that is a moment or a part, not a length: "after two seconds", "the first three seconds"."""
_AFTER = re.compile(r"^[ ]?(?:later|ago|in\b|apart|into|mark|hand|from now|at a time|between)")
_NEXT = re.compile(r"\b(?:then|before|after|afterwards?|followed by|finally|next)\b|[;.!?](?:\s|$)|->|→|\s[-–—]\s")
"""Separators of actions in the order of time."""
_FIRST = re.compile(r"^(?:right |just |shortly )?(?:after|before|once|when)\b(?P<clause>[^,;.]*[a-z]{3}[^,;.]*),")
"""A first clause that says when the others come: "after clapping for two seconds, she bows"."""
_LISTED = re.compile(r"(?:,|\band\b)(?:\s+and)?\s+(?:(?:he|she|they)\s+)?(?:\w+ly\s+)?(?=(?P<verb>[a-z]+)\b)")
"""Separators of the clauses of a list, before the verb of the next one."""
_WORD = re.compile(r"[^\W\d_]{2}")
_NAMED_PARTS = frozenset({"back", "face", "head", "hand", "arms", "legs", "feet", "hands"})
"""Parts of the body whose names are forms of verbs: "sits for eight seconds, back straight"."""
_HERE = "\0"
"""Stands in place of a length."""
_CLAUSE_BEFORE = re.compile(r"[^\W\d_]{3}.*\bfor\s+(?:(?:about|around|exactly|roughly|only|just)\s+)?$")
"""A clause, and the word before the length that is its own."""
_OWN_BEFORE = re.compile(r"(?<!\bfor)(?<!\bin)(?<!\babout)(?<!\bof)(?<=[^\W\d_]{2})\s*$")
"""A clause whose length stands behind it: "balances 2 s, jumps"."""
_DECADE = re.compile(r"[5-9]0s")
_SECONDS = rf"(?:\d{{1,3}}(?:[.,]\d+)?|{TO_TWENTY})[ -]?(?:seconds?|secs?|s)\b"
_SO_LONG = (
    r"(?:(?:to|at|about|around|exactly|roughly|only|just|max(?:imum)?|no[ ](?:more|longer)[ ]than|up[ ]to)\b\.?[ ]?)*"
)
_WHOLE_SHOT = r"the[ ](?:(?:whole|entire)[ ])?(?:thing|clip|motion|animation|shot)"
WHOLE = re.compile(
    rf"""[\s,;.(–—-]*(?:\b(?:hmm+|oh|but|and|please|ok(?:ay)?|actually|so|all|everything|{_WHOLE_SHOT})\b[,\s]*)*
    (?:\b(?:keep|make|hold|get)[ ](?:it|this|that|{_WHOLE_SHOT})[ ](?:all[ ])?(?:last[ ]|be[ ])?{_SO_LONG}
      (?P<under>(?:under|below|less[ ]than|within)[ ])?(?P<kept>{_SECONDS})
      (?:[ ](?:long|in[ ]total|total|max(?:imum)?|or[ ](?:so|less)))?
    |\b(?:(?:total|overall|clip)[ ])?(?:length|duration)(?:[ ](?:is|of)|:|[ ]=)?[ ]?{_SO_LONG}(?P<label>{_SECONDS})
    |(?P<total>{_SECONDS})[ ](?:in[ ]total|total|overall|altogether)
    )(?=\s*(?:[).,;!]|$))[\s).,;!]*$""",
    re.IGNORECASE | re.VERBOSE,
)
"""The length of the whole at the end of a prompt: "keep it to 3 seconds", "length: 4 s", "6 seconds in total"."""
UNDER = 0.9
"""Share of a length that a motion stays under."""
_BY_LENGTH = re.compile(
    r"(?:,|-|–|—)?\s*\b(?:for|lasting|over|during|in)\s+(?:(?:about|around|exactly|roughly|only|just|some|maybe|approximately)\s+)*$"
    r"|,?\s*\b(?:about|around|exactly|roughly|approximately|lasting)\s+$|[\s,(~]+$"
)
"""Words that join a length to the clause before it."""
_LABEL = re.compile(r"\b(?:length|duration|total|time|lasting|takes?|overall)\b")


@dataclass(frozen=True)
class StatedLength:
    """Lengths in the words of a prompt.

    Attributes:
        seconds: of the whole motion; None = none is stated, or only that of a part.
        is_partial: a length is stated for a part of the motion, and none for the rest.
    """

    seconds: float | None = None
    is_partial: bool = False

    def within(self, low: float, high: float) -> float | None:
        """Return the length if a motion of `low` to `high` seconds can have it, else None."""
        return self.seconds if self.seconds is not None and low <= self.seconds <= high else None


def stated_length(prompt: str) -> StatedLength:
    """Return the length that a prompt states.

    Several lengths are summed where every action in order has one: "walks for two seconds, then waves for 3 s" has
    five. "walks, then waves for three seconds" states that of a part, and so does "walks for two seconds, waves and
    sits down": a length behind the first of several clauses is its own.
    """
    text = " ".join(without_held_pose(prompt).lower().split())
    if (whole := WHOLE.search(text)) is not None and (said := _LENGTH.search(whole[0])) is not None:
        return StatedLength(_seconds(said) * (UNDER if whole["under"] else 1.0))
    found = [match for match in _LENGTH.finditer(text) if not _is_moment(text, match)]
    if not found:
        return StatedLength()
    rest = _FIRST.sub(r"\g<clause> then", _LENGTH.sub(f" {_HERE} ", text))
    clauses = [clause for part in _NEXT.split(rest) for clause in _listed(part)]
    parts = [part for part in clauses if re.search(r"[^\W\d_]{3}", _LABEL.sub("", part))]
    if len(found) < len(parts):
        return StatedLength(is_partial=True)
    return StatedLength(sum(map(_seconds, found)))


def only_length(prompt: str) -> float | None:
    """Return the seconds of the one length that a prompt of one movement names, wherever it stands; None = it names
    none, or several: "sprint start, then full speed, 3 seconds" has three."""
    text = " ".join(without_held_pose(prompt).lower().split())
    found = [match for match in _LENGTH.finditer(text) if not _is_moment(text, match)]
    return _seconds(found[0]) if len(found) == 1 else None


def without_length(prompt: str) -> str:
    """Return a prompt without its lengths: "walk away" of "walk away for 4 seconds"; as it is where nothing is left.

    Models are told how long a motion is, and make other movements of such words.
    """
    kept = _without_lengths(prompt)
    return kept if _WORD.search(kept) else prompt


def is_length(text: str) -> bool:
    """Return True if a text says how long something takes and nothing else: "for 4 seconds"."""
    return _WORD.search(text) is not None and _WORD.search(_without_lengths(text)) is None


def _without_lengths(prompt: str) -> str:
    kept, text = prompt, prompt.lower()
    for found in reversed(list(_LENGTH.finditer(text) if len(text) == len(prompt) else ())):
        if _is_moment(text, found):
            continue
        joint = _BY_LENGTH.search(text[: found.start()])
        begin = found.start() if joint is None else joint.start()
        behind = kept[found.end() :].removeprefix(")").removeprefix(" of")
        kept = f"{kept[:begin]}{behind}" if begin else behind.lstrip(" ,;:-–—")
    return kept.strip(" ,;:-–—")


def _listed(part: str) -> Iterator[str]:
    """Yield the clauses behind a length that is said of the first one: "walks for two seconds", "waves" and "sits
    down"; the part as it is where the length is at its beginning or its end."""
    before, here, after = part.partition(_HERE)
    own = _CLAUSE_BEFORE.search(before) or (_OWN_BEFORE.search(before) and after.lstrip().startswith(","))
    if not here or not own:
        yield part
        return
    begins = [found for found in _LISTED.finditer(after) if found["verb"] in known_verb_forms()]
    edges = [0, *(found.start() for found in begins), len(after)]
    yield before + after[: edges[1]]
    yield from (after[low:high] for low, high in pairwise(edges[1:]))


@lru_cache(maxsize=1)
def known_verb_forms() -> frozenset[str]:
    """Return the forms without an ending, and those with -s, of all verbs that are known."""
    lists = load_word_lists()
    phrases = [phrase for each in load_vocabulary().actions.values() for phrase in (*each.verbs, *each.near)]
    verbs = {phrase.split()[0] for phrase in (*phrases, *lists.other_verbs)}
    return (
        frozenset(verbs | {third_person(verb) for verb in verbs if verb.isalpha()})
        - lists.body_parts
        - lists.uncounted
        - _NAMED_PARTS
    )


def _is_moment(text: str, match: re.Match[str]) -> bool:
    decade = _DECADE.fullmatch(match[0]) and not text[match.end() :].startswith(" of ")
    return bool(decade or _BEFORE.search(text[: match.start()]) or _AFTER.search(text[match.end() :]))


def _seconds(match: re.Match[str]) -> float:
    if match["half"]:
        value, unit = 0.5, match["half_unit"]
    elif match["digits"]:
        value, unit = float(match["digits"].replace(",", ".")), match["digit_unit"]
    else:
        value, unit = _NUMBERS[match["word"]], match["word_unit"]
        value += 0.5 if match["and_half"] or match["half_after"] else 0.0
    return value * 60 if unit.startswith("m") else value
