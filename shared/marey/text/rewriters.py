"""Prompt rewriting: the port, `none` and `rules`; `openai` is in `marey.text.openai_rewriter`. Every rewrite passes the
same guard (`marey.text.guard`)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from marey.core.errors import MareyError
from marey.text.roles import Frame, RoleLabeller
from marey.text.words import SINGULAR, UNITS, bare, inflected, is_past, lemma

if TYPE_CHECKING:
    from marey.text.spelling import Speller

_AUXILIARIES = """
is are was were be been being am get gets got has have had will would can could should may might must to does do did not
"""
AUXILIARIES = frozenset(_AUXILIARIES.split())
FIRST_SECOND = {"i": "a person", "you": "a person", "my": "their", "your": "their", "myself": "themselves"} | {
    "yourself": "themselves",
    "me": "them",
    "i'm": "a person is",
    "you're": "a person is",
}
_UNIT = re.compile(rf"^(\d+(?:[.,]\d+)?)({'|'.join(sorted(UNITS, key=len, reverse=True))})([.,;!?]*)$", re.IGNORECASE)
_NUMBER = re.compile(r"^\d+(?:[.,]\d+)?$")
SPACED_UNITS = frozenset(UNITS) - {"in", "s", "x", "m", "min"} | {"m"}
"""Short forms understood after a space too: "5 in" may go on with "place"."""


class NotRewritten(MareyError):
    """Raised if a rewriter has no better version of a prompt, which is then used as written."""


@dataclass(frozen=True)
class Rewrite:
    """A prompt as the model is to read it.

    Attributes:
        text: the prompt in other words.
        seconds: length of the motion that the rewriter proposes; None = none.
        refused: why a rewrite was not used, where `text` is the prompt as written.
    """

    text: str
    seconds: float | None = None
    refused: str | None = None


class PromptRewriter(Protocol):
    """Port of rewriters: bring a prompt closer to the captions a model was trained on (MOGO's TCA; SnapMoGen Tab.
    6)."""

    @property
    def name(self) -> str:
        """Name in `TextSpec.rewriter`."""
        ...

    def rewrite(self, prompt: str) -> Rewrite:
        """The rewritten prompt. Raises NotRewritten."""
        ...

    def prefetch(self, prompts: Sequence[str]) -> None:
        """Get ready to rewrite these, if that is faster for several at once."""
        ...


class NoRewriter:
    """Leave the prompt unchanged. The default: rewriting trades FID for R-precision (MOGO Tab. 2)."""

    name = "none"

    def rewrite(self, prompt: str) -> Rewrite:
        """`prompt` itself."""
        return Rewrite(prompt)

    def prefetch(self, prompts: Sequence[str]) -> None:
        """Do nothing."""


class RulesRewriter:
    """Correct spelling, units, third person and present tense; add nothing but the subject of captions, "a person"."""

    name = "rules"

    def __init__(self, labeller: RoleLabeller, speller: Speller) -> None:
        self._labeller = labeller
        self._speller = speller

    def rewrite(self, prompt: str) -> Rewrite:
        """The prompt as a caption: "Walk 2m fowards" → "a person walks 2 meters forwards"."""
        words = expand_units(self._speller.correct(prompt).split())
        words = self._third_person(words)
        return Rewrite(" ".join(self._present_tense(words)))

    def prefetch(self, prompts: Sequence[str]) -> None:
        """Do nothing."""

    def _third_person(self, words: list[str]) -> list[str]:
        """I, you and imperatives become "a person"."""
        first = bare(words[0])
        frames = self._frames(words)
        if first in ("i", "you", "i'm", "you're"):
            base_forms = _subjectless(words, frames, subject=first)
            words = [inflected(word) if i in base_forms else word for i, word in enumerate(words)]
            return " ".join(FIRST_SECOND.get(bare(word), word) for word in words).split()
        if not frames or frames[0].predicate != 0:
            return words
        words = [words[0].lower(), *words[1:]]
        if first.endswith("ing"):
            return ["a", "person", "is", *words]
        if lemma(first) != first:
            return words
        base_forms = _subjectless(words, frames, subject=None)
        words = [inflected(word) if i in base_forms else word for i, word in enumerate(words)]
        return ["a", "person", *(FIRST_SECOND.get(bare(word), word) for word in words)]

    def _present_tense(self, words: list[str]) -> list[str]:
        """Past forms of singular subjects become present ones; participles after "is", "gets" or "has" stay."""
        result = list(words)
        for frame in self._frames(words):
            index = frame.predicate
            before = [bare(word) for word in words[max(0, index - 2) : index]]
            subject = [a for a in frame.arguments if a.stop <= index and a.role in ("ARG0", "ARG1")]
            plural = subject and bare(words[subject[0].stop - 1]).endswith("s")
            if is_past(words[index]) and not AUXILIARIES.intersection(before) and subject and not plural:
                result[index] = inflected(words[index])
        return result

    def _frames(self, words: Sequence[str]) -> tuple[Frame, ...]:
        return self._labeller.label([words])[0]


def _subjectless(words: Sequence[str], frames: Sequence[Frame], subject: str | None) -> set[int]:
    """Predicates in their base form that share the (missing) subject: not infinitives, not of another subject."""
    found: set[int] = set()
    for frame in frames:
        index = frame.predicate
        own = [a for a in frame.arguments if a.stop <= index and a.role == "ARG0"]
        other = any(bare(words[a.start]) != subject for a in own)
        infinitive = index > 0 and bare(words[index - 1]) in AUXILIARIES
        if not other and not infinitive and lemma(words[index]) == bare(words[index]):
            found.add(index)
    return found


def expand_units(words: Sequence[str]) -> list[str]:
    """2m → 2 meters, 90° → 90 degrees, 3 sec → 3 seconds. Sequence of words in and out."""
    result: list[str] = []
    for word in words:
        match = _UNIT.match(word)
        previous = result[-1] if result else ""
        if match:
            result += [match[1], _unit(match[1], match[2]) + match[3]]
        elif _NUMBER.match(previous) and bare(word) in SPACED_UNITS:
            result.append(_unit(previous, bare(word)) + word[len(word.rstrip(".,;!?")) :].lstrip("."))
        else:
            result.append(word)
    return result


def _unit(number: str, short: str) -> str:
    unit = UNITS[short.lower()]
    return SINGULAR[unit] if number == "1" else unit
