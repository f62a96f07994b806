"""Verdicts, the reviewed list of equivalent mutants, and the report."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from marey.referee.adherence import interval
from tests.mutants.drawing import Mutant

EQUIVALENTS = (
    Path(__file__).with_name("equivalent.toml"),
    *sorted(Path(__file__).parents[1].glob("models/*/equivalent.toml")),
)
"""A model's own stand beside its tests, with which it goes."""
KILLS = frozenset({"killed", "timeout"})


@dataclass(frozen=True)
class Equivalent:
    """A mutant that no test can kill, named by its file and its lines before and after, with the reason."""

    path: str
    before: str
    after: str
    reason: str

    def matches(self, mutant: Mutant) -> bool:
        """Return True if the entry is of this mutant."""
        return self.path == mutant.mutation.path and (self.before, self.after) == mutant.diff


def read_equivalents(paths: Iterable[Path] = EQUIVALENTS) -> list[Equivalent]:
    """Read the reviewed lists."""
    return [Equivalent(**entry) for path in paths for entry in tomllib.loads(path.read_text()).get("equivalent", [])]


def wilson(killed: int, total: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share; (0, 1) for a total of 0."""
    return interval(killed / total, total) if total else (0.0, 1.0)


def describe(
    seed: int, mutants: Iterable[Mutant], results: Mapping[str, dict[str, Any]], equivalents: Iterable[Equivalent]
) -> str:
    """Write the report as Markdown: a row for each group, then each survivor."""
    equivalents = list(equivalents)
    done = [(mutant, results[mutant.id]) for mutant in mutants if mutant.id in results]
    lines = [f"# Mutants of seed {seed}", "", "| group | killed | survived | equivalent | share killed | 95 % |"]
    lines.append("|---|---|---|---|---|---|")
    survivors: list[str] = []
    for group in dict.fromkeys(mutant.group for mutant, _ in done):
        counts = {"killed": 0, "survived": 0, "equivalent": 0}
        for mutant, result in done:
            if mutant.group != group:
                continue
            if result["verdict"] in KILLS:
                counts["killed"] += 1
            elif any(one.matches(mutant) for one in equivalents):
                counts["equivalent"] += 1
            else:
                counts["survived"] += 1
                survivors += _survivor(mutant, result)
        total = counts["killed"] + counts["survived"]
        low, high = wilson(counts["killed"], total)
        share = f"{counts['killed'] / total:.1%}" if total else "-"
        cells = [group, *map(str, counts.values()), share, f"{low:.1%} to {high:.1%}"]
        lines.append(f"| {' | '.join(cells)} |")
    if survivors:
        lines += ["", "## Survivors", "", *survivors]
    return "\n".join(lines) + "\n"


def _survivor(mutant: Mutant, result: dict[str, Any]) -> list[str]:
    before, after = mutant.diff
    tests = f"{result['tests']} tests passed" if result["tests"] else "no test runs the line"
    place = f"{mutant.mutation.path}:{mutant.mutation.line}"
    return [
        f"`{place}` ({mutant.group}, {mutant.mutation.kind}): {tests}",
        "```diff",
        f"- {before}",
        f"+ {after}",
        "```",
    ]
