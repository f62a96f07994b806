"""The groups of files that mutants are drawn from, and the draw."""

from __future__ import annotations

import hashlib
import random
from dataclasses import dataclass
from pathlib import Path

from tests.mutants.operators import Mutation, is_valid, mutations

GROUPS = {
    "models": ("workers/marey/models", "shared/marey/nn"),
    "jobs": tuple(
        f"shared/marey/{noun}" for noun in ("jobs", "takes", "streams", "evaluations", "webhooks", "tenants", "db")
    ),
    "motion": ("shared/marey/motion",),
}


@dataclass(frozen=True)
class Mutant:
    """A drawn mutation with the lines that it changes."""

    group: str
    mutation: Mutation
    source: bytes
    mutated: bytes

    @property
    def id(self) -> str:
        """Name of the mutant: of the source, the place and the edit."""
        edit = f"{self.mutation.path}\n{self.mutation.start}\n{self.mutation.end}\n{self.mutation.replacement}\n"
        return hashlib.sha256(edit.encode() + self.source).hexdigest()[:16]

    @property
    def diff(self) -> tuple[str, str]:
        """Lines of the file before and after, stripped; several are joined by a blank."""
        before, after = self.source.decode().splitlines(), self.mutated.decode().splitlines()
        first = next((i for i, (a, b) in enumerate(zip(before, after, strict=False)) if a != b), 0)
        same = 0
        while same < min(len(before), len(after)) - first and before[-1 - same] == after[-1 - same]:
            same += 1
        old, new = before[first : len(before) - same], after[first : len(after) - same]
        return " ".join(map(str.strip, old)), " ".join(map(str.strip, new))


def draw(root: Path, group: str, number: int, seed: int) -> list[Mutant]:
    """Draw different mutants of a group, each as likely as any other; a seed always draws the same from a source."""
    sources = {
        path.relative_to(root).as_posix(): path.read_bytes()
        for folder in GROUPS[group]
        for path in sorted((root / folder).rglob("*.py"))
    }
    candidates = [mutation for path, source in sources.items() for mutation in mutations(path, source)]
    random.Random(f"{seed} {group}").shuffle(candidates)
    drawn: list[Mutant] = []
    for mutation in candidates:
        if len(drawn) == number:
            break
        source = sources[mutation.path]
        if is_valid(mutation, source):
            drawn.append(Mutant(group, mutation, source, mutation.apply(source)))
    return drawn
