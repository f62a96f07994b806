"""Semantic roles: the output of a labeller, and the port of labellers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol


@dataclass(frozen=True)
class Argument:
    """One argument of a predicate: a PropBank role over the words [start, stop)."""

    role: str  # ARG0, ARGM-DIR, R-ARG1, …
    start: int
    stop: int

    @property
    def words(self) -> tuple[int, ...]:
        """Indices of its words."""
        return tuple(range(self.start, self.stop))


@dataclass(frozen=True)
class Frame:
    """One predicate and its arguments, in the order of the words."""

    predicate: int  # word index
    arguments: tuple[Argument, ...] = ()


class RoleLabeller(Protocol):
    """Port of role labellers: find predicates and their arguments (Shi & Lin 2019, arXiv 1904.05255)."""

    @property
    def name(self) -> str:
        """Name in `TextSpec.labeller`."""
        ...

    @property
    def sha256(self) -> str:
        """Hash of its weights."""
        ...

    def label(self, sentences: Sequence[Sequence[str]]) -> list[tuple[Frame, ...]]:
        """The frames of each sentence (a sequence of whitespace words), predicates in word order."""
        ...


class PredicateFinder(Protocol):
    """Finds the predicates alone."""

    def predicates(self, words: Sequence[str]) -> list[int]:
        """Word indices of the predicates of a sentence, in order."""
        ...


def spans_to_arguments(tags: Sequence[str]) -> tuple[Argument, ...]:
    """Read BIO tags (`B-ARG0 I-ARG0 O B-V`) as arguments; `V` itself is none.

    An `I-` that follows nothing of its role begins a span, as AllenNLP's decoder reads it.
    """
    arguments: list[Argument] = []
    role, start = "", 0
    for index, tag in enumerate([*tags, "O"]):
        kind, _, name = tag.partition("-")
        if role and (kind != "I" or name != role):
            arguments.append(Argument(role, start, index))
            role = ""
        if not role and kind in ("B", "I"):
            role, start = name, index
    return tuple(a for a in arguments if a.role != "V")
