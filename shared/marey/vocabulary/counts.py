"""How often a prompt asks for its action: "twice", "three times", "x5", "two deep squats", "clap clap clap"."""

from __future__ import annotations

import re
from collections.abc import Iterator, Set
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

from marey.vocabulary.blows import stated_blows
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.inflection import noun_forms
from marey.vocabulary.lengths import NUMBERS
from marey.vocabulary.word_lists import load_word_lists

MOST = 20
"""More repetitions than these are not read."""
_NUMBERS = {
    **NUMBERS,
    "single": 1,
    "double": 2,
    "couple": 2,
    "couple of": 2,
    "pair of": 2,
    "triple": 3,
    "trio of": 3,
    "half dozen": 6,
    "half a dozen": 6,
    "dozen": 12,
}
_COMPOUND = "(?:hand|arm|leg|foot|knee|fist|finger|edg|blad|head|side?|face|point)e?d|handers?"
"""Behind a number: an adjective of how it is done ("a two-handed swing"), not of how often."""
_NUMBER = (
    rf"(?<!\bor )(?<!\bto )\b(?P<number>\d{{1,3}}|{'|'.join(sorted(_NUMBERS, key=len, reverse=True))})"
    rf"(?![ -](?:{_COMPOUND})\b)"
)
_TIMES = re.compile(
    rf"{_NUMBER} ?(?:(?:more|whole|separate|consecutive) )?"
    r"(?:times|time|occasions?|reps?|repetitions?|x|×)\b(?! as\b| (?:the )?(?:speed|pace|tempo|normal)\b)"
)
_BY = re.compile(rf"(?:\bx|×) ?(?P<by>\d{{1,2}})\b|\b(?:reps|times|count): ?{_NUMBER}\b")
_STROKE = (
    "times?|x|×|reps?|repetitions?|(?:[a-z]+ )?(?:strokes?|blows?|hits?|knocks?|swings?|taps?|beats?|stamps?|stomps?"
    "|pats?|raps?|rounds?|chops?|cuts?|slaps?|pulls?|thrusts?|circles?|sweeps?|snaps?|shakes?)"
)
_STROKES = re.compile(
    rf"(?P<adverb>\b(?:twice|thrice|once)\b)(?! (?:as|the|more|again)\b)"
    rf"|{_NUMBER} ?(?:(?:more|whole|separate) )?(?:{_STROKE})\b(?! as\b)|(?:\bx|×) ?(?P<by>\d{{1,2}})\b"
)
_CLAUSE = re.compile(
    r"(?: (?!and\b|then\b|while\b|before\b|after\b|as\b)[\w'×-]+){0,4}"
    r"(?:,? (?:with |using )?(?:both|alternating|each) (?:arms?|hands?|sides?))?"
    rf"(?:,? (?:for |exactly |just )?(?:once|twice|thrice|[×x] ?\d+|\d+|{'|'.join(_NUMBERS)})(?: ?[\w×]+)?\b)?"
)
"""Words behind what is done that may name a number of strokes: those of its clause, and a number behind a comma."""
_NOTED = re.compile(
    rf" ?(?:[:(\[–—-]|, ) ?(?:(?:x|×) ?(?P<by>\d{{1,2}})|(?:reps|times|count):? {_NUMBER}"
    rf"|{_NUMBER.replace('<number>', '<times>')} ?(?:x|×|times|reps|repetitions))\b[)\]]?"
)
"""A number noted behind what is done: "burpees (x3)", "burpees: 3 reps"."""
_GIVEN = re.compile(
    rf"(?:^|\b(?:gives?|makes?|does|do|giving|making|doing|delivers?|lands?|performs?|performing|completes?) )"
    rf"(?:(?:[a-z]+|\d+) sets? of )?{_NUMBER} (?:(?!times )[a-z]+ )?$"
)
_AT_FIRST = re.compile(rf"^(?:do|does|doing|performs?|performing) {_NUMBER} (?!times\b)[a-z]")
"""Words that begin with a number of what is done: "does eight bicep curls"."""
_ADVERBS = {"twice": 2, "thrice": 3}
_ADVERB = re.compile(r"\b(?:twice|thrice)\b(?! (?:as|the)\b)")
_ONCE = re.compile(
    r"\b(?:just|only|exactly) once\b"
    r"|(?<!^)(?<!\bat )(?<!\bmore than )\bonce\b(?=\W*$|\s*[,.;!?:)—-]|\s+(?:and|only|to|then|with|because|before|after"
    r"|while|in|at|on|for|from|like|over|up|down|as|towards?|into|when|so|but|by)\b)(?!\s+in a while)"
)
_COUNTED = re.compile(rf"{_NUMBER}(?P<words>(?:[ -]+[a-z'’]+){{1,5}})")
_ALTERNATIVES = ("or", "to")
STEPPING = frozenset({"walk", "walk-backward", "run"})
"""Actions of which steps are counted, and nothing else: "walks twice around the house" is one walk."""
_STEPS = frozenset({"step", "steps", "pace", "paces", "stride", "strides"})
_ONE_STEP = re.compile(
    r"\b(?:a|one|1|another|single) (?:(?!time|few|couple)\w+ )?(?:step|pace|stride)\b"
    r"|\bstep(?:s|ped)? (?:\w+ly )?(?:once )?(?:straight )?(?:back|forward|ahead)(?:wards?)?\b"
)
"""Words of a single step; "steps" is a verb there."""
_SEVERAL_STEPS = re.compile(
    r"\b(?:\d+|two|three|four|five|six|seven|eight|nine|ten|some|several|few|many|of|big|small|slow|quick|keeps?)"
    r" steps\b"
)
"""Words of several steps."""
_WORDS = re.compile(r"[a-z]+")


def stated_count(prompt: str, action: str) -> int | None:
    """Return how often a prompt asks for an action, or for how many steps of one of `STEPPING`; None = it does not say,
    or says several numbers.

    Args:
        prompt: as a user typed it.
        action: id of the one action that it asks for.
    """
    text = " ".join(prompt.lower().split())
    if action in STEPPING:
        found = set(_of_things(text, _STEPS))
    else:
        found = {*_of_times(text), *_of_things(text, _nouns(action)), *_of_words_again(text, action)}
    if action == "punch" and found and len(blows := stated_blows(text)) > 1:
        found = {len(blows)}  # "jab, jab, cross": neither twice nor once
    return found.pop() if len(found) == 1 and 0 < max(found) <= MOST else None


def is_single_step(prompt: str) -> bool:
    """Return True if a prompt asks for one step ahead or back without a number: "steps back", "takes a big step"."""
    text = " ".join(prompt.lower().split())
    return bool(_ONE_STEP.search(text)) and not _SEVERAL_STEPS.search(text)


def stated_things(prompt: str, nouns: Set[str]) -> int | None:
    """Return how many things a prompt speaks of: three of "goes up three steps"; None = it names no number of them, or
    several.

    Args:
        prompt: as a user typed it.
        nouns: that name the things, in both numbers.
    """
    things = re.compile(rf"{_NUMBER} (?:[a-z-]+ )?(?:{'|'.join(sorted(nouns))})\b")
    found = {_value(match["number"]) for match in things.finditer(" ".join(prompt.lower().split()))}
    return found.pop() if len(found) == 1 and 0 < max(found) <= MOST else None


def stated_number(words: str) -> int | None:
    """Return the first number in words for what is done: "three" of "does three burpees", "twice"; None = none.

    Args:
        words: in lower case.
    """
    found = re.search(rf"{_NUMBER}\b", words)
    value = next(_of_times(words), None) or (None if found is None else _value(found["number"]))
    return value if value is not None and 0 < value <= MOST else None


@dataclass(frozen=True)
class StatedStrokes:
    """A number of strokes that words name.

    Attributes:
        number: 1 to `MOST`.
        end: of the words, in characters of the text.
    """

    number: int
    end: int


def stated_strokes(words: str) -> int | None:
    """Return how many strokes words name for what is done over and over: three of "knocks three times", "4x", "two
    blows"; None = no number, or several.

    Args:
        words: in lower case.
    """
    found = {each.number for each in _strokes_in(words)}
    return found.pop() if len(found) == 1 else None


def strokes_behind(text: str, at: int) -> StatedStrokes | None:
    """Return the number of strokes that is named right behind what is done, or behind up to four words more of the same
    clause; None = none.

    Args:
        text: in lower case.
        at: where the words of what is done end, in characters.
    """
    noted = _NOTED.match(text, at)
    number = 0 if noted is None else _value(noted["by"] or noted["number"] or noted["times"])
    if noted is not None and 0 < number <= MOST:
        return StatedStrokes(number, noted.end())
    clause = _CLAUSE.match(text, at)
    end = at if clause is None else clause.end()
    for each in _strokes_in(text[at:end]):
        return replace(each, end=at + each.end)
    return None


def strokes_before(text: str) -> tuple[int, int] | None:
    """Return the number of strokes that is named right before them as a noun, "three" of "gives three", and where its
    words begin, in characters; None = none.

    Args:
        text: before the noun, in lower case.
    """
    found = _GIVEN.search(text)
    return None if found is None else (_value(found["number"]), found.start())


def _strokes_in(words: str) -> Iterator[StatedStrokes]:
    """Yield the numbers of strokes in their order."""
    at_first = _AT_FIRST.match(words)
    if at_first is not None and 0 < (number := _value(at_first["number"])) <= MOST:
        yield StatedStrokes(number, at_first.end("number"))
    for match in _STROKES.finditer(words):
        number = _ADVERBS.get(match["adverb"] or "") or (
            1 if match["adverb"] else _value(match["number"] or match["by"])
        )
        if 0 < number <= MOST:
            yield StatedStrokes(number, match.end())


def _of_times(text: str) -> Iterator[int]:
    """Yield numbers of times: "twice", "x3"."""
    yield from (_value(match["number"]) for match in _TIMES.finditer(text))
    yield from (_value(match["by"] or match["number"]) for match in _BY.finditer(text))
    yield from (_ADVERBS[match[0]] for match in _ADVERB.finditer(text))
    yield from (1 for _ in _ONCE.finditer(text))


def _of_things(text: str, nouns: Set[str]) -> Iterator[int]:
    """Yield numbers before the action as a thing: "two deep squats", but not "two hands"."""
    uncounted = load_word_lists().uncounted - nouns
    for match in _COUNTED.finditer(text):
        words = _WORDS.findall(match["words"])
        for word, after in pairwise([*words, ""]):
            if word in nouns:
                yield _value(match["number"])
            elif word not in _ALTERNATIVES and (after in nouns or not {word, word.removesuffix("s")} & uncounted):
                continue  # "two arm circles"
            break


def _of_words_again(text: str, action: str) -> Iterator[int]:
    """Yield how often a word for the action is said in a row."""
    words, times = _WORDS.findall(text), 1
    for word, after in pairwise([*words, ""]):
        if word == after and word in _nouns(action):
            times += 1
        elif times > 1:
            yield times
            times = 1


def _value(number: str) -> int:
    return int(number) if number.isdecimal() else _NUMBERS[number]


@lru_cache(maxsize=128)
def _nouns(action: str) -> frozenset[str]:
    """Return the words that name an action as a thing, in both numbers: the last of each noun, the first of each
    verb."""
    known = load_vocabulary().need(action)
    nouns = {form for noun in known.nouns for form in noun_forms(noun.split()[-1])}
    verbs = {verb.split()[0] for verb in (*known.verbs, *known.near)}
    return frozenset(nouns | verbs | {f"{verb}s" for verb in verbs})
