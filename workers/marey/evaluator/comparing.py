"""Compare two evaluations of the same prompts: changes and alarms.

Alarms depend on prompt checks and R-precision (`marey.measures.comparing`), never on a distance of distributions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from marey.evaluator.report import Baseline, Change, Metric, MotionScore, sentence_of
from marey.measures.comparing import OBEYED, RETRIEVED, compare

COLUMNS = frozenset({OBEYED, RETRIEVED})
"""Paired metrics that are columns of a report; rows of timelines have a section of their own."""


@dataclass(frozen=True)
class Earlier:
    """An earlier run to compare with."""

    baseline: Baseline
    scores: Sequence[MotionScore]


def changes(earlier: Earlier, scores: Sequence[MotionScore], *, seed: int) -> tuple[Change, ...]:
    """Return the changes of the columns that can be paired.

    Raises:
        InvalidInput: the runs have no motions in common.
    """
    baseline = earlier.baseline
    found = compare(earlier.scores, scores, seed=seed, where=f"evaluation {baseline.evaluation}")
    return tuple(
        Change(
            metric=change.metric,
            against=baseline.against,
            before=change.before,
            after=change.after,
            low=change.low,
            high=change.high,
            verdict=change.verdict,
        )
        for change in found
        if change.metric in COLUMNS
    )


def alarms(found: Sequence[Change], metrics: Mapping[str, Metric]) -> tuple[str, ...]:
    """Return one sentence for each regression."""
    return tuple(sentence_of(change, metrics[change.metric]) for change in found if change.verdict == "worse")
