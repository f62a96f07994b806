"""Augmentation of the role labeller's sentences, which keeps labels true, and labels that it is tested on."""

from __future__ import annotations

import random
import re
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from marey.core.documents import read_json
from marey.core.errors import InvalidFile
from marey.labeller.sentences import Example
from marey.text.roles import Argument, Frame

_AUXILIARIES = (
    "is are was were be been being am has have had having will would can could shall should may might must do does did"
)
AUXILIARIES = frozenset(_AUXILIARIES.split())
SWAPS = (
    ("left", "right"),
    ("clockwise", "counterclockwise", "counter-clockwise", "anticlockwise"),
    ("forward", "forwards", "backward", "backwards"),
    ("slowly", "quickly", "carefully"),
    ("one", "two", "three", "four", "five"),
    ("his", "her", "their", "the", "its"),
    ("hand", "arm"),
    ("foot", "leg"),
    ("hands", "arms"),
    ("he", "she"),
)
_SWAP = {word: group for group in SWAPS for word in group}
_STOP = re.compile(r"[.!?]+$")


def read_labels(file: Path) -> list[Example]:
    """A parser's labels of captions (`srl-kit-dev.json`), without argument-less auxiliaries ("is" beside "walking").

    They are for tests alone: no weights are trained on them.

    Args:
        file: a list of captions, each with `words`, `predicates` and `arguments`.

    Raises:
        InvalidFile: not such a file.
    """
    try:
        return [_labelled(entry) for entry in read_json(file)]
    except (ValueError, KeyError, TypeError, AttributeError, IndexError) as error:
        raise InvalidFile(f"is not a file of role labels: {error!r}", where=str(file)) from error


def _labelled(entry: dict[str, list[dict[str, object]]]) -> Example:
    words = tuple(str(word) for word in entry["words"])
    frames: list[Frame] = []
    for number, predicate in enumerate(entry["predicates"]):
        found = [a for a in entry["arguments"] if a["predicate"] == number]
        index = int(str(predicate["word"]))
        if not found and re.sub(r"\W", "", words[index]).lower() in AUXILIARIES:
            continue
        arguments = [Argument(str(a["role"]), min(a["words"]), max(a["words"]) + 1) for a in found]  # pyright: ignore
        frames.append(Frame(index, tuple(sorted(arguments, key=lambda a: a.start))))
    return Example(words, tuple(frames))


def distinct(examples: Sequence[Example]) -> list[Example]:
    """Return the sentences without repetitions."""
    return list({example.words: example for example in examples}.values())


def replace(example: Example, start: int, stop: int, new: Sequence[str]) -> Example | None:
    """`example` with the words [start, stop) replaced; None where that would cut an argument or a predicate."""
    shift = len(new) - (stop - start)

    def moved(index: int) -> int:
        return index + shift if index >= stop else index

    frames: list[Frame] = []
    for frame in example.frames:
        if start <= frame.predicate < stop:
            return None
        arguments: list[Argument] = []
        for argument in frame.arguments:
            apart = argument.stop <= start or argument.start >= stop
            around = argument.start <= start and argument.stop >= stop
            if not (apart or around) or not new:
                return None
            if around:
                arguments.append(Argument(argument.role, argument.start, argument.stop + shift))
            else:
                arguments.append(Argument(argument.role, moved(argument.start), moved(argument.stop)))
        frames.append(Frame(moved(frame.predicate), tuple(arguments)))
    return Example((*example.words[:start], *new, *example.words[stop:]), tuple(frames))


@dataclass
class Augmenter:
    """Makes variants of sentences; donors of phrases are the training sentences alone."""

    donors: Sequence[Example]
    rng: random.Random

    def __post_init__(self) -> None:
        self._phrases: dict[tuple[str, str], list[tuple[str, ...]]] = defaultdict(list)
        for example in self.donors:
            predicates = {frame.predicate for frame in example.frames}
            for frame in example.frames:
                for a in frame.arguments:
                    if predicates.isdisjoint(a.words):
                        key = (a.role, stem(example.words[frame.predicate]))
                        self._phrases[key].append(example.words[a.start : a.stop])
        self._subjects = [example.words[: a.stop] for example in self.donors if (a := _subject(example))]

    def variant(self, example: Example) -> Example:
        """One variant: words and phrases exchanged, clauses joined, then noise of spelling and punctuation."""
        steps: tuple[tuple[float, Callable[[Example], Example]], ...] = (
            (0.5, self.swap_words),
            (0.5, self.swap_subject),
            (0.5, self.swap_phrase),
            (0.2, self.coordinate),
            (0.12, self.append_sentence),
        )
        for probability, step in steps:
            if self.rng.random() < probability:
                example = step(example)
        return self.noise(example)

    def noise(self, example: Example) -> Example:
        """Typos, missing or added punctuation: the labels stay."""
        words = list(example.words)
        if self.rng.random() < 0.5:
            words[-1] = _STOP.sub("", words[-1]) or words[-1]
        elif self.rng.random() < 0.4 and not _STOP.search(words[-1]):
            words[-1] += "."
        if self.rng.random() < 0.2:
            words = [word.rstrip(",") or word for word in words]
        if self.rng.random() < 0.2:
            index = self.rng.randrange(len(words))
            words[index] = typo(words[index], self.rng)
        return Example(tuple(words), example.frames)

    def swap_words(self, example: Example) -> Example:
        """Exchange left for right, his for her, two for three …"""
        words = [self._swap_word(word) if self.rng.random() < 0.5 else word for word in example.words]
        return Example(tuple(words), example.frames)

    def _swap_word(self, word: str) -> str:
        core = word.rstrip(".,;")
        choices = _SWAP.get(core.lower())
        return self.rng.choice(choices) + word[len(core) :] if choices else word

    def swap_subject(self, example: Example) -> Example:
        """Another sentence's subject ("a person" → "the old man"), for one of at most two words at the start."""
        first = next(
            (a for f in example.frames for a in f.arguments if a.start == 0 and a.role in ("ARG0", "ARG1")), None
        )
        if first is None or first.stop > 2 or not self._subjects:
            return example
        return replace(example, 0, first.stop, self.rng.choice(self._subjects)) or example

    def swap_phrase(self, example: Example) -> Example:
        """Another phrase of the same role of the same verb."""
        spots = [(frame, a) for frame in example.frames for a in frame.arguments if a.start > 0]
        if not spots:
            return example
        frame, argument = self.rng.choice(spots)
        phrases = self._phrases.get((argument.role, stem(example.words[frame.predicate])))
        if not phrases:
            return example
        new = [word.rstrip(".,") or word for word in self.rng.choice(phrases)]
        last = example.words[argument.stop - 1]
        new[-1] += last[len(last.rstrip(".,")) :]
        return replace(example, argument.start, argument.stop, new) or example

    def coordinate(self, example: Example) -> Example:
        """ "A person walks" + "someone bows" → "a person walks and then bows", with the subject shared."""
        other = self.rng.choice(self.donors)
        mine, theirs = _subject(example), _subject(other)
        if mine is None or theirs is None or len(example.words) + len(other.words) > 30:
            return example
        joint = self.rng.choice((("and",), ("and", "then"), ("then",), ("but", "then"), ("and",)))
        words = [*example.words[:-1], _STOP.sub("", example.words[-1]) + self.rng.choice(("", "", ",")), *joint]
        offset = len(words) - theirs.stop
        frames = list(example.frames)
        for frame in other.frames:
            arguments = [
                Argument(a.role, mine.start, mine.stop)
                if a.start == 0
                else Argument(a.role, a.start + offset, a.stop + offset)
                for a in frame.arguments
            ]
            if joint[-1] == "then" and frame is other.frames[0]:
                arguments.append(Argument("ARGM-TMP", len(words) - 1, len(words)))
            arguments.sort(key=lambda a: a.start)
            frames.append(Frame(frame.predicate + offset, tuple(arguments)))
        return Example((*words, *other.words[theirs.stop :]), tuple(frames))

    def append_sentence(self, example: Example) -> Example:
        """Two sentences, nothing shared."""
        other = self.rng.choice(self.donors)
        words = [*example.words[:-1], _STOP.sub("", example.words[-1]).rstrip(",") + "."]
        offset = len(words)
        moved = [
            Frame(f.predicate + offset, tuple(Argument(a.role, a.start + offset, a.stop + offset) for a in f.arguments))
            for f in other.frames
        ]
        return Example((*words, *other.words), (*example.frames, *moved))


def _subject(example: Example) -> Argument | None:
    """Return the span at the start if every argument that touches it covers it and no predicate precedes it."""
    starts = {(a.start, a.stop) for f in example.frames for a in f.arguments if a.start == 0}
    if len(starts) != 1 or not example.frames:
        return None
    subject = Argument("ARG0", *starts.pop())
    crossing = any(0 < a.start < subject.stop for f in example.frames for a in f.arguments)
    early = any(f.predicate < subject.stop for f in example.frames)
    return None if crossing or early or subject.stop > 3 else subject


def stem(word: str) -> str:
    """A verb without its ending, roughly: walks, walking, walked → walk."""
    word = re.sub(r"\W", "", word.lower())
    word = re.sub(r"(ing|ed|es|s)$", "", word) if len(word) > 4 else word
    return word[:-1] if len(word) > 3 and word[-1] == word[-2] else word.rstrip("e")


def typo(word: str, rng: random.Random) -> str:
    """One slip of the fingers: a letter lost, doubled, or two exchanged."""
    if len(word) < 4:
        return word
    i = rng.randrange(len(word) - 2)
    return rng.choice(
        (word[:i] + word[i + 1 :], word[:i] + word[i] + word[i:], word[:i] + word[i + 1] + word[i] + word[i + 2 :])
    )
