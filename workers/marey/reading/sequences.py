"""Texts that the reader of sequences learns from: prompts in parts, each with what it asks for.

Those of `several.toml` were written and cut by people. More are made of verb phrases and of sentences that ask for one
action, joined as people join them. Sentences of one action are texts of one part.
"""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import starmap

from marey.data.captions import lower_first, seeded
from marey.data.spoken import SUBJECTS
from marey.reading.texts import LONGEST, LabelledText, held_out, labelled_texts, several_texts, words_alone
from marey.text.action_reader import OUTSIDE, SEVERAL
from marey.text.clause_order import CONTEXT
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.inflection import gerund, phrase_in_third_person

MADE = 10_000
"""Number of texts that are made."""
WRITTEN, SINGLE = 5.0, 0.7
"""Weights of the texts of `several.toml`, and of those of one action, beside made ones."""
_COUNTS, _SHARES_OF_COUNTS = (2, 3, 4), (0.6, 0.33, 0.07)
_OUTSIDE, _OF_VERBS, _SENTENCE, _ASKED = 0.05, 0.6, 0.35, 0.1
_MOST_WORDS = 18
"""Of a sentence that is a part."""
_OTHERS = ("the knight", "an old man", "a dancer", "the guard", "my guy", "the robot", "a soldier", "the kid")
_PRONOUNS = ("he", "she", "they", "", "", "")
_REQUESTS = ("please ", "can you do ", "I need ", "make him ", "just ")


@dataclass(frozen=True)
class TextPart:
    """A part of a prompt.

    Attributes:
        text: as written, with the words that join it to others.
        asks: id of an action, `OUTSIDE` or `CONTEXT`.
        at_once: it comes at the same time as the part before.
        place: in time, from 1 on, among the parts that ask for a movement; 0 = that of the text.
    """

    text: str
    asks: str
    at_once: bool = False
    place: int = 0


@dataclass(frozen=True)
class PartedText:
    """A prompt in parts."""

    parts: tuple[TextPart, ...]
    weight: float

    @property
    def text(self) -> str:
        """Return the whole."""
        return "".join(part.text for part in self.parts)

    def places(self) -> list[int]:
        """Return the place in time of each part, from 1 on; equal for those at once, 0 for one without a movement."""
        found: list[int] = []
        place = last = 0
        for part in self.parts:
            moves = part.asks != CONTEXT
            place += moves
            at = part.place or (last if part.at_once and last else place)
            found.append(at if moves else 0)
            last = at if moves else last
        return found


@dataclass(frozen=True)
class _Joint:
    """A way to join two parts.

    Attributes:
        first: words before the first part.
        ends: the sign behind it.
        between: words before the second part.
        weight: how often it is drawn.
        forms: of both parts: `v`erb phrase, with a `s`ubject, or `g`erund.
        at_once: both come at the same time.
        earlier: the second comes before the first.
    """

    first: str
    ends: str
    between: str
    weight: float
    forms: str = "vv"
    at_once: bool = False
    earlier: bool = False


_JOINTS = (
    _Joint("", ",", " then ", 4),
    _Joint("", "", " and then ", 4),
    _Joint("", ".", " Then ", 2),
    _Joint("", ",", " ", 5),
    _Joint("", "", " and ", 8),
    _Joint("", ",", " and ", 2),
    _Joint("", "", " -> ", 0.7),
    _Joint("", "", " → ", 0.7),
    _Joint("", "", " > ", 0.3),
    _Joint("", "", " + ", 0.5),
    _Joint("", "", " / ", 0.3),
    _Joint("", ";", " ", 0.7),
    _Joint("first ", ",", " then ", 1),
    _Joint("First ", ",", " then ", 0.5),
    _Joint("", ";", " after that ", 0.5),
    _Joint("", ",", " after that ", 0.5),
    _Joint("", ",", " next ", 0.5),
    _Joint("", ",", " finally ", 0.7),
    _Joint("", "", " and finally ", 0.7),
    _Joint("", ",", " and finally ", 0.5),
    _Joint("", "", " and afterwards ", 0.4),
    _Joint("", ",", " afterwards ", 0.3),
    _Joint("", ",", " pauses, then ", 0.3),
    _Joint("", "", " and, after a short pause, ", 0.2),
    _Joint("", ",", " waits, and ", 0.2),
    _Joint("", ",", " followed by ", 1, "vg"),
    _Joint("", "", " followed by ", 1, "vg"),
    _Joint("", ",", " ending with ", 0.3, "vg"),
    _Joint("", "", " until ", 0.6, "vs"),
    _Joint("", ".", " ", 2, "vs"),
    _Joint("", "", " before ", 2, "sg"),
    _Joint("", "", " before ", 0.7, "ss"),
    _Joint("after ", ",", " ", 1.5, "gs"),
    _Joint("after ", ",", " ", 0.7, "ss"),
    _Joint("once ", ",", " ", 0.7, "ss"),
    _Joint("having finished ", ",", " ", 0.3, "gs"),
    _Joint("when done ", ",", " ", 0.2, "gs"),
    _Joint("", "", " prior to ", 0.4, "sg"),
    _Joint("", "", " right before ", 0.4, "sg"),
    _Joint("", "", " and only then ", 0.3),
    _Joint("", ",", " after which he ", 0.3, "sv"),
    _Joint("", "", " and once that is done ", 0.2, "vs"),
    _Joint("starts by ", ",", " then ", 0.4, "gv"),
    _Joint("", ",", " which leads into ", 0.2, "vg"),
    _Joint("", "", " after ", 1.5, "sg", earlier=True),
    _Joint("", "", " after ", 0.5, "ss", earlier=True),
    _Joint("", "", " once ", 0.5, "ss", earlier=True),
    _Joint("", "", " right after ", 0.4, "sg", earlier=True),
    _Joint("", ",", " but only after ", 0.4, "sg", earlier=True),
    _Joint("", ",", " but not before ", 0.3, "sg", earlier=True),
    _Joint("", ",", " this after ", 0.3, "sg", earlier=True),
    _Joint("", "", " following ", 0.3, "sg", earlier=True),
    _Joint("", ",", " having first finished ", 0.3, "sg", earlier=True),
    _Joint("", "", " as soon as he is done ", 0.3, "sg", earlier=True),
    _Joint("before ", ",", " ", 1.5, "gs", earlier=True),
    _Joint("before ", ",", " ", 0.4, "ss", earlier=True),
    _Joint("prior to ", ",", " ", 0.5, "gs", earlier=True),
    _Joint("", ",", " but first ", 0.5, earlier=True),
    _Joint("", ",", " but before that ", 0.3, earlier=True),
    _Joint("", ";", " before that ", 0.3, earlier=True),
    _Joint("", "", " while ", 1.5, "sg", at_once=True),
    _Joint("", "", " as ", 0.7, "ss", at_once=True),
    _Joint("", "", " and at the same time ", 0.5, "vv", at_once=True),
    _Joint("while ", ",", " ", 1, "gs", at_once=True),
    _Joint("while ", ",", " ", 0.4, "ss", at_once=True),
    _Joint("as ", ",", " ", 0.3, "ss", at_once=True),
    _Joint("", ",", " ", 0.8, "sg", at_once=True),
    _Joint("", "", " at the same time as ", 0.3, "sg", at_once=True),
)
_FIRST_AND_THEN = _JOINTS[0]
_WEIGHTS = [joint.weight for joint in _JOINTS]
_LATER = tuple(joint for joint in _JOINTS if not joint.first)
_LATER_WEIGHTS = [joint.weight for joint in _LATER]


def parted_texts(seed: int) -> list[PartedText]:
    """Return all texts but those of prompts that something is measured by; made ones by a seed."""
    written = {text.replace("|", "") for text, _ in several_texts()}
    single = [each for each in labelled_texts(seed) if each.asks != SEVERAL and each.text not in written]
    texts = [
        *(PartedText(parts, WRITTEN) for parts in written_parts()),
        *_made(single, seed),
        *(PartedText((TextPart(each.text, each.asks),), SINGLE * each.weight) for each in single),
    ]
    unseen = held_out()
    return [each for each in texts if each.text.casefold() not in unseen]


def written_parts() -> Iterator[tuple[TextPart, ...]]:
    """Yield the texts that people wrote, in parts."""
    for text, asks in several_texts():
        yield tuple(starmap(_written_part, zip(text.split("|"), asks.split(), strict=True)))


def _written_part(text: str, ask: str) -> TextPart:
    mark, _, place = ask.partition("#")
    name = mark.lstrip("&")
    return TextPart(text, {"-": CONTEXT, "?": OUTSIDE}.get(name, name), mark.startswith("&"), int(place or 0))


def _made(single: Sequence[LabelledText], seed: int) -> Iterator[PartedText]:
    rng = seeded("sequences", str(seed))
    sentences = defaultdict[str, list[str]](list)
    for each in single:
        if len(each.text.split()) <= _MOST_WORDS:
            sentences[each.asks].append(each.text.rstrip("."))
    phrases = {action.id: words_alone(action.verbs) for action in load_vocabulary().actions.values()}
    made = 0
    while made < MADE:
        text = PartedText(tuple(_finished(_joined(_Speaker(rng, phrases, sentences)), rng)), 1.0)
        if len(text.text.split()) <= LONGEST:
            made += 1
            yield text


class _Speaker:
    """One way to speak: of whom, in verb phrases or in sentences."""

    def __init__(
        self, rng: random.Random, phrases: Mapping[str, Sequence[str]], sentences: Mapping[str, Sequence[str]]
    ) -> None:
        self.rng = rng
        self._phrases, self._sentences = phrases, sentences
        self._subject = rng.choice((*SUBJECTS, *_OTHERS, "", "", ""))
        self._bends = bool(self._subject) or rng.random() < 0.3
        self._in_verbs = rng.random() < _OF_VERBS

    def actions(self) -> list[str]:
        """Draw what the parts ask for; none asks for the same as the one before."""
        drawn: list[str] = []
        (count,) = self.rng.choices(_COUNTS, _SHARES_OF_COUNTS)
        while len(drawn) < count:
            name = OUTSIDE if self.rng.random() < _OUTSIDE else self.rng.choice(list(self._phrases))
            if name not in drawn[-1:]:
                drawn.append(name)
        return drawn

    def say(self, action: str, form: str, *, first: bool) -> str:
        """Return words for an action.

        Args:
            action: id, or `OUTSIDE`.
            form: as in `_Joint.forms`.
            first: the subject is not known yet.
        """
        rng = self.rng
        in_sentences = action == OUTSIDE or not (self._in_verbs or rng.random() < 0.5)
        if in_sentences and (form != "g" or action == OUTSIDE):
            return lower_first(rng.choice(self._sentences[action]))
        phrase = rng.choice(self._phrases[action])
        if form == "g":
            verb, *rest = phrase.split()
            return " ".join([gerund(verb), *rest])
        subject = self._subject if first else self._pronoun(form)
        bent = (self._bends or subject) and subject != "they"
        return f"{subject} {phrase_in_third_person(phrase) if bent else phrase}".lstrip()

    def _pronoun(self, form: str) -> str:
        if form == "v":
            return self.rng.choice(_PRONOUNS) if self._bends else ""
        return self.rng.choice(("he", "she")) if self._subject or self.rng.random() < 0.7 else ""


def _joined(speaker: _Speaker) -> list[TextPart]:
    actions = speaker.actions()
    (joint,) = speaker.rng.choices(_JOINTS, _WEIGHTS)
    joint = _FIRST_AND_THEN if joint.earlier and not joint.first and len(actions) > 2 else joint
    last = len(actions) if joint.earlier and joint.first else 0  # "before sitting, he waves and bows"
    parts = [TextPart(joint.first + speaker.say(actions[0], joint.forms[0], first=joint.forms[0] != "g"), actions[0])]
    parts[0] = replace(parts[0], place=last or (2 if joint.earlier else 1))
    for number, action in enumerate(actions[1:]):
        if number:
            (joint,) = speaker.rng.choices(_LATER, _LATER_WEIGHTS)
            joint = _FIRST_AND_THEN if joint.earlier and (last or number < len(actions) - 2) else joint
        said = speaker.say(action, joint.forms[1], first=number == 0 and joint.forms[0] == "g")
        said = f"{said[:1].upper()}{said[1:]}" if joint.ends == "." and joint.between == " " else said
        parts[-1] = replace(parts[-1], text=parts[-1].text + joint.ends)
        place = parts[-1].place if joint.at_once else number + (1 if last else 2)
        if joint.earlier and not last:
            parts[-1], place = replace(parts[-1], place=number + 2), number + 1
        parts.append(TextPart(joint.between + said, action, joint.at_once, place))
    return parts


def _finished(parts: list[TextPart], rng: random.Random) -> list[TextPart]:
    """Write parts as a sentence, as a request, or as they are."""
    first, last = parts[0], parts[-1]
    if rng.random() < _SENTENCE:
        parts[-1] = replace(last, text=f"{last.text}.")
        parts[0] = replace(first, text=f"{first.text[:1].upper()}{first.text[1:]}")
    elif rng.random() < _ASKED:
        parts[0] = replace(first, text=rng.choice(_REQUESTS) + first.text)
    return parts
