"""PropBank of the English Web Treebank as training sentences of the role labeller.

Roles come from github.com/propbank/propbank-release, whose `gold_skel` files leave the words out; words come from
github.com/UniversalDependencies/UD_English-EWT, the same sentences with the same tokens. Both are CC BY-SA 4.0.
Sentences whose tokens or part-of-speech tags differ between the two are left out: one in forty.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from marey.core.errors import InvalidFile
from marey.labeller.sentences import Example
from marey.text.roles import Argument, Frame

SKELETONS = "data/google/ewt"
WORDS = "not-to-release/sources"
MAX_WORDS = 30  # captions have no more
AGREEMENT = 0.9  # of the tags of a sentence: UD has corrected some since
_COLUMNS = 8  # before the predicates': document, sentence, token, word, tag, parse, frame file, roleset
_ROLES = {"ARGM-PRR": "ARG1", "ARGM-LVB": None, "ARGM-CXN": None, "ARGM-ADJ": None, "ARGM-DSP": None}
"""Roles of light verbs as Marey's sentences have them ("take a step": ARG1); None = left out."""
_PUNCTUATION = re.compile(r"^\W+$")


@dataclass(frozen=True)
class Token:
    """One token of the treebank."""

    text: str
    tag: str
    glued: bool  # no space after it


def read_propbank(propbank: Path, words: Path) -> list[Example]:
    """Sentences of at most 30 words with the frames of their verbs, in order of the files' names.

    Args:
        propbank: a checkout of propbank-release.
        words: a checkout of UD_English-EWT.

    Raises:
        InvalidFile: a folder holds something else.
    """
    examples: list[Example] = []
    for file in sorted((propbank / SKELETONS).rglob("*.gold_skel")):
        genre = file.relative_to(propbank / SKELETONS).parts[0]
        document = words / WORDS / genre / f"{file.stem}.conllu"
        if document.is_file():
            examples += _document(file, document)
    if not examples:
        raise InvalidFile(
            f"has no sentence in common with {words}",
            where=str(propbank),
            hint="Give checkouts of propbank/propbank-release and UniversalDependencies/UD_English-EWT.",
        )
    return examples


def _document(skeleton: Path, document: Path) -> Iterator[Example]:
    """The sentences of a document that both have, found in order."""
    sentences = list(read_tokens(document))
    at = 0
    for rows in _blocks(skeleton):
        tags = [row.split()[4] for row in rows]
        for index in range(at, min(at + 4, len(sentences))):  # one side may have split a sentence
            if agree(tags, [token.tag for token in sentences[index]]):
                at = index + 1
                example = joined(sentences[index], [row.split() for row in rows])
                if example is not None and len(example.words) <= MAX_WORDS:
                    yield example
                break


def _blocks(file: Path) -> Iterator[list[str]]:
    for block in re.split(r"\n\s*\n", file.read_text(encoding="utf-8")):
        if rows := [row for row in block.splitlines() if row.strip()]:
            yield rows


def read_tokens(file: Path) -> Iterator[list[Token]]:
    """The sentences of a CoNLL-U file, without ranges (`3-4`) and empty nodes (`8.1`)."""
    for rows in _blocks(file):
        cells = [row.split("\t") for row in rows if not row.startswith("#")]
        glued_ranges = {row[0].partition("-")[2] for row in cells if "-" in row[0] and "SpaceAfter=No" in row[9]}
        inside = {
            str(number)
            for row in cells
            if "-" in row[0]
            for number in range(int(row[0].partition("-")[0]), int(row[0].partition("-")[2]))
        }
        yield [
            Token(row[1], row[4], "SpaceAfter=No" in row[9] or row[0] in glued_ranges or row[0] in inside)
            for row in cells
            if row[0].isdecimal()
        ]


def agree(tags: Sequence[str], others: Sequence[str]) -> bool:
    """Return True if two rows of tags belong to one sentence."""
    same = sum(a == b for a, b in zip(tags, others, strict=False))
    return len(tags) == len(others) and same >= AGREEMENT * len(tags)


def joined(tokens: Sequence[Token], rows: Sequence[Sequence[str]]) -> Example | None:
    """A sentence with its frames in words as captions have them, punctuation at the word before it.

    Args:
        tokens: of the sentence.
        rows: the columns of `gold_skel`, one row a token.

    Returns:
        None where two arguments would share a word.
    """
    places, words = glue(tokens)
    frames: list[Frame] = []
    predicates = [index for index, row in enumerate(rows) if row[_COLUMNS - 1] != "-"]
    for column, predicate in enumerate(predicates):
        if not rows[predicate][4].startswith("VB"):
            continue
        arguments: list[Argument] = []
        for role, start, stop in spans([row[_COLUMNS + column] for row in rows]):
            known = _ROLES.get(role, role)
            inner = [i for i in range(start, stop) if not _PUNCTUATION.match(tokens[i].text)]
            if known is None or known == "V" or not inner:
                continue
            arguments.append(Argument(known, places[inner[0]], places[inner[-1]] + 1))
        taken = [index for argument in arguments for index in argument.words]
        if len(taken) != len(set(taken)) or places[predicate] in taken:
            return None
        if arguments:  # without any it is an auxiliary, as in the captions
            frames.append(Frame(places[predicate], tuple(sorted(arguments, key=lambda a: a.start))))
    if len({frame.predicate for frame in frames}) < len(frames):
        return None
    return Example(tuple(words), tuple(sorted(frames, key=lambda frame: frame.predicate)))


def glue(tokens: Sequence[Token]) -> tuple[list[int], list[str]]:
    """The word each token falls into, and the words: punctuation joins the token it touches, "don't" stays two."""
    places: list[int] = []
    words: list[str] = []
    for index, token in enumerate(tokens):
        before = tokens[index - 1] if index else None
        marks = _PUNCTUATION.match(token.text) or (before and _PUNCTUATION.match(before.text))
        if before and before.glued and marks:
            words[-1] += token.text
        else:
            words.append(token.text)
        places.append(len(words) - 1)
    return places, words


def spans(cells: Sequence[str]) -> Iterator[tuple[str, int, int]]:
    """Roles and token ranges [start, stop) of a predicate's column: `(ARG0*`, `*`, `*)`, `(V*)`."""
    role, start = "", 0
    for index, cell in enumerate(cells):
        if cell.startswith("("):
            role, start = cell[1 : cell.index("*")], index
        if cell.endswith(")"):
            yield role, start, index + 1
