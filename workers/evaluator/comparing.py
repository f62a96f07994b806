"""Two evaluations of the same prompts, motion against motion: what changed, and what is an alarm.

Motions are paired by prompt and repeat, and the repeats of a prompt are resampled together. Alarms go by prompt checks
and R-precision; a distance of distributions has no motions to pair.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shared.errors import InvalidInput
from workers.evaluator.metrics.intervals import Difference, paired_bootstrap
from workers.evaluator.report import Baseline, Change, Metric, MotionScore, sentence_of
from workers.evaluator.report.model import Verdict
from workers.evaluator.scoring import OBEYED, RETRIEVED

COMPARED = {OBEYED: "obeyed", RETRIEVED: "retrieved"}
"""Metrics with a number a motion, and the field of `MotionScore` that holds it. All of them raise alarms."""
ROUNDS = 10_000


@dataclass(frozen=True)
class Earlier:
    """A run to compare with."""

    baseline: Baseline
    scores: Sequence[MotionScore]


def changes(earlier: Earlier, scores: Sequence[MotionScore], *, seed: int) -> tuple[Change, ...]:
    """What became of each metric that can be paired.

    Raises:
        InvalidInput: the runs have no motions in common.
    """
    before = {(score.index, score.variant): score for score in earlier.scores}
    shared = [(before[key], score) for score in scores if (key := (score.index, score.variant)) in before]
    if not shared:
        raise InvalidInput(
            "the two runs have no prompts in common",
            where=f"evaluation {earlier.baseline.evaluation}",
            hint="Compare runs of the same prompts.",
        )
    found = (_change(metric, field, shared, earlier.baseline, seed) for metric, field in COMPARED.items())
    return tuple(change for change in found if change is not None)


def alarms(found: Sequence[Change], metrics: Mapping[str, Metric]) -> tuple[str, ...]:
    """A sentence for each change for the worse."""
    return tuple(sentence_of(change, metrics[change.metric]) for change in found if change.verdict == "worse")


def _change(
    metric: str, field: str, shared: Sequence[tuple[MotionScore, MotionScore]], baseline: Baseline, seed: int
) -> Change | None:
    """None where fewer than two prompts have the number in both runs."""
    rows = [(score.index, getattr(old, field), getattr(score, field)) for old, score in shared]
    rows = [row for row in rows if None not in row]
    if len({index for index, _, _ in rows}) < 2:
        return None
    index, old, new = (np.array(column, np.float64) for column in zip(*rows, strict=True))
    difference = paired_bootstrap(100 * old, 100 * new, rounds=ROUNDS, seed=seed, groups=index.astype(np.int64))
    return Change(
        metric=metric,
        against=baseline.against,
        before=float(100 * old.mean()),
        after=float(100 * new.mean()),
        low=difference.low,
        high=difference.high,
        verdict=_verdict(difference),
    )


def _verdict(difference: Difference) -> Verdict:
    if difference.worse:
        return "worse"
    return "better" if difference.better else "no difference found"
