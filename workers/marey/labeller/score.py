"""Scores of a role labeller: predicates by word, arguments by predicate, exact span and role."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from marey.text.roles import Frame

Item = tuple[object, ...]


@dataclass
class Tally:
    """Counts of correct, predicted and expected items."""

    right: int = 0
    said: int = 0
    wanted: int = 0

    def add(self, said: set[Item], wanted: set[Item]) -> None:
        """Count one sentence."""
        self.right += len(said & wanted)
        self.said += len(said)
        self.wanted += len(wanted)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 0 where there is nothing."""
        return 2 * self.right / max(1, self.said + self.wanted)


@dataclass
class Scores:
    """Over all sentences (micro averages)."""

    predicates: Tally = field(default_factory=Tally)
    arguments: Tally = field(default_factory=Tally)
    spans: Tally = field(default_factory=Tally)
    """Arguments whatever their role."""
    by_role: dict[str, Tally] = field(default_factory=dict[str, Tally])

    def add(self, said: Sequence[Frame], wanted: Sequence[Frame]) -> None:
        """Count one sentence."""
        self.predicates.add(_predicates(said), _predicates(wanted))
        mine, theirs = _arguments(said), _arguments(wanted)
        self.arguments.add(mine, theirs)
        self.spans.add({item[:-1] for item in mine}, {item[:-1] for item in theirs})
        for role in {str(item[-1]) for item in mine | theirs}:
            tally = self.by_role.setdefault(role, Tally())
            tally.add({item for item in mine if item[-1] == role}, {item for item in theirs if item[-1] == role})


def _predicates(frames: Sequence[Frame]) -> set[Item]:
    return {(frame.predicate,) for frame in frames}


def _arguments(frames: Sequence[Frame]) -> set[Item]:
    return {(frame.predicate, a.start, a.stop, a.role) for frame in frames for a in frame.arguments}


def confusions(said: Iterable[Sequence[Frame]], wanted: Iterable[Sequence[Frame]]) -> Counter[tuple[str, str]]:
    """Roles taken for others on the right span: (wanted, said) counts."""
    pairs: Counter[tuple[str, str]] = Counter()
    for mine, theirs in zip(said, wanted, strict=True):
        roles = {item[:-1]: str(item[-1]) for item in _arguments(mine)}
        for item in _arguments(theirs):
            found = roles.get(item[:-1])
            if found is not None and found != item[-1]:
                pairs[str(item[-1]), found] += 1
    return pairs
