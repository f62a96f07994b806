"""Annotated sentences: one sentence a line, and below it a line `> predicate ROLE phrase; ROLE phrase` for each verb.

    A person walks forward, then turns left.
    > walks ARG0 A person; ARGM-DIR forward
    > turns ARGM-TMP then; ARG1 A person; ARGM-DIR left

Punctuation at the edges of a phrase and case do not count. A word that occurs more than once is the next after the
predicate before it; a phrase that does, the one nearest to its predicate; `he@2` names the second.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile
from marey.text.roles import Argument, Frame

TRAIN = Path(__file__).parent / "sentences" / "train.txt"
TEST = Path(__file__).parent / "sentences" / "test.txt"
ROLE = re.compile(r"(ARG[0-4]|ARGM-[A-Z]{3}|C-V)")
MAX_BYTES = 2**22
_EDGES = re.compile(r"^\W+|\W+$")
_NUMBERED = re.compile(r"(.+)@([1-9])")


@dataclass(frozen=True)
class Example:
    """A sentence and its frames."""

    words: tuple[str, ...]
    frames: tuple[Frame, ...]


def read_sentences(file: Path) -> list[Example]:
    """The sentences of a file with their frames, in order.

    Raises:
        InvalidFile: a line is not of the format, a phrase is not in its sentence, or two arguments share a word.
    """
    examples: list[Example] = []
    for number, line in enumerate(read_bytes(file, limit=MAX_BYTES).decode().splitlines(), 1):
        try:
            if line.startswith(">"):
                examples[-1] = _with_frame(examples[-1], line[1:].strip())
            elif line.strip() and not line.startswith("#"):
                examples.append(Example(tuple(line.split()), ()))
        except (ValueError, IndexError) as error:
            raise InvalidFile(f"{error} ({line!r})", where=f"{file}, line {number}") from error
    return examples


def _with_frame(example: Example, line: str) -> Example:
    verb, _, rest = line.partition(" ")
    predicate = _predicate(example, verb)
    arguments: list[Argument] = []
    for said in filter(None, (part.strip() for part in rest.split(";"))):
        role, _, phrase = said.partition(" ")
        if not ROLE.fullmatch(role):
            raise ValueError(f"{role!r} is not a role")
        arguments.append(Argument(role, *_span(example.words, phrase, predicate)))
    covered = [predicate, *(word for argument in arguments for word in argument.words)]
    if len(covered) != len(set(covered)):
        raise ValueError("two arguments, or an argument and its predicate, share a word")
    frame = Frame(predicate, tuple(sorted(arguments, key=lambda argument: argument.start)))
    return Example(example.words, (*example.frames, frame))


def _predicate(example: Example, verb: str) -> int:
    after = example.frames[-1].predicate if example.frames else -1
    found = next((start for start, _ in _occurrences(example.words, verb) if start > after), None)
    if found is None:
        raise ValueError(f"no word {verb!r} after the predicate before it")
    return found


def _span(words: Sequence[str], phrase: str, predicate: int) -> tuple[int, int]:
    numbered = _NUMBERED.fullmatch(phrase)
    found = list(_occurrences(words, numbered[1] if numbered else phrase))
    if not found:
        raise ValueError(f"no phrase {phrase!r} in the sentence")
    if numbered:
        return found[int(numbered[2]) - 1]
    return min(found, key=lambda span: span[0] - predicate if span[0] > predicate else predicate - span[1] + 1)


def _occurrences(words: Sequence[str], phrase: str) -> Iterator[tuple[int, int]]:
    wanted = [_plain(word) for word in phrase.split()]
    plain = [_plain(word) for word in words]
    for start in range(len(words) - len(wanted) + 1):
        if wanted and plain[start : start + len(wanted)] == wanted:
            yield start, start + len(wanted)


def _plain(word: str) -> str:
    return _EDGES.sub("", word).lower()
