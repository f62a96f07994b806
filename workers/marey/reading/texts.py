"""Texts that the reader of actions learns from: sentences that ask for one action, for several, and for none.

One action: the sentences of `sayings.toml`, the vocabulary's own words, and the captions of known sets whose terms
allow commercial use. Several: two and three of these, joined, and `several.toml`, which also has texts of one action
that sound like several. None: `outside.toml`. `manner.toml` has texts of one action that say how fast or how often,
`wordings.toml` of one action in words of many kinds. The authors of these files saw the definitions and no prompts.
"""

from __future__ import annotations

import tomllib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from marey.checks import reader_prompts
from marey.data.caption_files import read_caption_files
from marey.data.captions import lower_first, seeded
from marey.data.dataset import INDEX, SETS, known_set, known_sets
from marey.data.index import read_index
from marey.data.spoken import MARKED, SUBJECTS, all_sayings
from marey.referee.pairs import development_pairs, pair_prompts
from marey.referee.prompts import action_prompts, development_prompts, sequence_prompts, studio_prompts
from marey.text.action_reader import OUTSIDE, SEVERAL
from marey.vocabulary.entries import load_vocabulary
from marey.vocabulary.inflection import phrase_in_third_person
from marey.vocabulary.paces import Pace

SEQUENCES = 4000
"""Number of texts of several actions that are made of those of single ones."""
WRITTEN = 3.0
"""Weight of the texts of `several.toml`, `manner.toml`, `wordings.toml` and `outside.toml`."""
LONGEST = 45
"""Most words of them."""
_OF_THREE, _OF_ONE_SUBJECT = 0.2, 0.6
_JOINTS = (
    "{a}, then {b}",
    "{a} and then {b}",
    "{a}. Then {b}",
    "{a}, {b}",
    "{a} and {b}",
    "{a} and {b}",
    "{a} -> {b}",
    "first {a}, then {b}",
    "{a}; after that {b}",
    "{a} before {b}",
    "after {a}, {b}",
    "{a}, followed by {b}",
    "{a} until {b}",
    "{a} + {b}",
)


@dataclass(frozen=True)
class LabelledText:
    """A text with what it asks for: the id of an action, `SEVERAL` or `OUTSIDE`.

    Attributes:
        weight: of the text beside others of its class. Sentences that ask for an action are most like prompts.
    """

    text: str
    asks: str
    weight: float


@dataclass(frozen=True)
class MannerText:
    """A text that asks for one action.

    Attributes:
        pace: that it asks for; empty = none.
        count: how often; None = it gives no number.
    """

    text: str
    action: str
    pace: Pace
    count: int | None


def labelled_texts(seed: int) -> list[LabelledText]:
    """Return all texts but those of prompts that something is measured by; joined ones by a seed."""
    single = list(dict.fromkeys((*_of_people(), *_of_clips(), *_of_vocabulary())))
    several = [LabelledText(text, SEVERAL, 1.0) for text in _joined(single, seed)]
    texts = [
        *single,
        *several,
        *(_whole(text, asks) for text, asks in several_texts()),
        *(LabelledText(text, OUTSIDE, WRITTEN) for text in _written("outside")),
    ]
    unseen = held_out()
    return [each for each in texts if each.text.casefold() not in unseen]


def held_out() -> set[str]:
    """Return the prompts by which the readers, and the motions of what they read, are measured."""
    asked = (*action_prompts(), *studio_prompts(), *development_prompts(), *sequence_prompts())
    pairs = (*pair_prompts(), *development_pairs())
    others = (*reader_prompts.outside_prompts(), *(text for text, _ in reader_prompts.sequence_prompts()))
    return {text.casefold() for text in (*(prompt.text for prompt in (*asked, *pairs)), *others)}


@cache
def several_texts() -> tuple[tuple[str, str], ...]:
    """Return the texts of `several.toml` with bars, and what their parts ask for, as it stands there; and those of
    `manner.toml` and `wordings.toml`, which have one part."""
    written = ((text, asks) for kind in ("several", "wordings") for text, asks in _written(kind))
    return (*written, *((each.text, each.action) for each in manner_texts()))


@cache
def manner_texts() -> tuple[MannerText, ...]:
    """Return the texts of `manner.toml`."""
    rows = _written("manner")
    return tuple(
        MannerText(text, action, "" if pace == "none" else pace, count or None) for text, action, pace, count in rows
    )


def _written(kind: str) -> list[Any]:
    return tomllib.loads(Path(__file__).with_name(f"{kind}.toml").read_text("utf-8"))[kind]


def _whole(text: str, asks: str) -> LabelledText:
    """Return a text of `several.toml`, whose parts are divided by bars."""
    return LabelledText(text.replace("|", ""), SEVERAL if "|" in text else asks, WRITTEN)


def _of_people() -> Iterator[LabelledText]:
    for action, sentences in all_sayings().items():
        yield from (LabelledText(text, action, 2.0) for text in sentences)


def _of_clips() -> Iterator[LabelledText]:
    """Yield the captions of clips of one action."""
    known = load_vocabulary().actions
    for name in known_sets():
        dataset = known_set(name)
        if dataset.tier != "commercial" or not (SETS / name / INDEX).is_file():
            continue
        rows = read_index(SETS / name / INDEX, dataset.model_copy(update={"columns": {}}))
        actions = {row.id: row.action for row in rows if row.action in known}
        for file in read_caption_files(SETS / name, rows):
            for clip, captions in file.captions.items():
                if clip in actions:
                    yield from (LabelledText(text, actions[clip], 1.0) for text in captions)


def _of_vocabulary() -> Iterator[LabelledText]:
    for action in load_vocabulary().actions.values():
        for phrase in words_alone(action.verbs):
            yield LabelledText(phrase, action.id, 0.7)
            yield LabelledText(f"a person {phrase_in_third_person(phrase)}", action.id, 0.7)
        yield from (LabelledText(noun, action.id, 0.7) for noun in words_alone(action.nouns))


def _joined(single: Sequence[LabelledText], seed: int) -> Iterator[str]:
    """Yield texts of two and three different actions: whole ones joined, or verb phrases of one subject."""
    rng = seeded("joined", str(seed))
    by_action = defaultdict[str, list[str]](list)
    for each in single:
        by_action[each.asks].append(each.text)
    verbs = {action.id: words_alone(action.verbs) for action in load_vocabulary().actions.values()}
    subjects = (*SUBJECTS, "")
    actions, made = list(by_action), 0
    while made < SEQUENCES:
        names = rng.sample(actions, 3 if rng.random() < _OF_THREE else 2)
        if rng.random() < _OF_ONE_SUBJECT:
            subject = rng.choice(subjects)
            parts = [rng.choice(verbs[name]) for name in names]
            if subject:
                parts = [phrase_in_third_person(part) for part in parts]
            parts[0] = f"{subject} {parts[0]}".lstrip()
        else:
            parts = [rng.choice(by_action[name]) for name in names]
        text, *others = (part.rstrip(".") for part in parts)
        for part in others:
            text = rng.choice(_JOINTS).format(a=lower_first(text), b=lower_first(part))
        if len(text.split()) <= LONGEST:
            made += 1
            yield text


def words_alone(phrases: Sequence[str]) -> list[str]:
    """Return the phrases of an entry that are words, without those that are patterns for matching."""
    return [phrase for phrase in phrases if not MARKED.search(phrase)]
