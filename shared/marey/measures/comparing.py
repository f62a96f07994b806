"""Comparison of two evaluations of the same prompts, motion by motion.

Motions are paired by prompt and repeat, and the repeats of a prompt are resampled together. Only metrics with a
value per motion can be paired; a distance of distributions has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from marey.core.errors import InvalidInput
from marey.measures.bootstrap import Difference, paired_bootstrap
from marey.measures.scores import MotionScore

OBEYED, RETRIEVED, TIMELINE_ROWS = "obeyed", "r_precision_3_of_32", "timeline_rows"
COMPARED = {OBEYED: "obeyed", RETRIEVED: "retrieved", TIMELINE_ROWS: "rows_shown"}
"""Metrics with a value per motion, and the field of `MotionScore` that holds it. All of them raise alarms."""
ROUNDS = 10_000

Verdict = Literal["better", "worse", "no difference found"]


@dataclass(frozen=True)
class MetricChange:
    """Change of one metric, in per cent.

    Attributes:
        metric: its key.
        before: mean over the pairs in the earlier run.
        after: mean over the pairs in the later run.
        low: lower end of the 95 % interval of after - before.
        high: upper end.
        prompts: number of resampled prompts.
        motions: number of pairs.
        verdict: `no difference found` is a result: the interval holds 0.
    """

    metric: str
    before: float
    after: float
    low: float
    high: float
    prompts: int
    motions: int
    verdict: Verdict


def compare(
    before: Sequence[MotionScore], after: Sequence[MotionScore], *, seed: int, where: str
) -> tuple[MetricChange, ...]:
    """Return the change of each paired metric; metrics with fewer than two prompts in both runs are left out.

    Args:
        before: scores of the earlier run.
        after: scores of the later run.
        seed: seed of the resampling.
        where: the earlier run, for the error.

    Raises:
        InvalidInput: the runs have no motions in common.
    """
    earlier = {(score.index, score.variant): score for score in before}
    shared = [(earlier[key], score) for score in after if (key := (score.index, score.variant)) in earlier]
    if not shared:
        raise InvalidInput(
            "the two runs have no prompts in common", where=where, hint="Compare runs of the same prompts."
        )
    found = (_change(metric, field, shared, seed) for metric, field in COMPARED.items())
    return tuple(change for change in found if change is not None)


def _change(
    metric: str, field: str, shared: Sequence[tuple[MotionScore, MotionScore]], seed: int
) -> MetricChange | None:
    rows = [(score.index, getattr(old, field), getattr(score, field)) for old, score in shared]
    rows = [row for row in rows if None not in row]
    if len({index for index, _, _ in rows}) < 2:
        return None
    index, old, new = (np.array(column, np.float64) for column in zip(*rows, strict=True))
    difference = paired_bootstrap(100 * old, 100 * new, rounds=ROUNDS, seed=seed, groups=index.astype(np.int64))
    return MetricChange(
        metric=metric,
        before=float(100 * old.mean()),
        after=float(100 * new.mean()),
        low=difference.low,
        high=difference.high,
        prompts=difference.n,
        motions=len(rows),
        verdict=_verdict(difference),
    )


def _verdict(difference: Difference) -> Verdict:
    if difference.worse:
        return "worse"
    return "better" if difference.better else "no difference found"
