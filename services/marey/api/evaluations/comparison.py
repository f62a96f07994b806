"""Comparison of two evaluations, from the scores in their stored reports."""

from __future__ import annotations

from typing import Literal
from uuid import UUID

from pydantic import Field

from marey import db, evaluations, jobs
from marey.api.context import Context
from marey.core.errors import NotFound
from marey.http.schemas import View
from marey.measures.comparing import MetricChange, compare
from marey.measures.scores import MotionScore, read_scores


class ComparedView(View):
    """One of the two evaluations."""

    id: UUID
    name: str | None
    bundle: str
    motions: int = Field(description="With scores.")


class MetricChangeView(View):
    """Change of a metric that each motion has: in per cent, over the motions of both runs."""

    metric: str
    before: float
    after: float
    low: float = Field(
        description="Lower end of the 95 % interval of after - before, by paired bootstrap over the prompts."
    )
    high: float
    prompts: int
    motions: int
    verdict: Literal["better", "worse", "no difference found"]


class MetricPairView(View):
    """A metric of the whole run: both reported numbers, without a verdict."""

    metric: str
    before: float
    after: float


class ComparisonView(View):
    """Changes from one evaluation to another."""

    before: ComparedView
    after: ComparedView
    regressed: bool | None = Field(description="Some metric is worse; null = nothing could be paired.")
    changes: list[MetricChangeView]
    others: list[MetricPairView]


def compare_runs(shared: Context, tenant: str, before: UUID, after: UUID) -> ComparisonView:
    """Compare `before` with `after`.

    Raises:
        NotFound: there is no such evaluation, or the report of one is gone.
        InvalidInput: one is not done, or prompts or evaluators differ.
        InvalidFile: a report cannot be read.
        Unreachable: the store does not answer.
    """
    with db.transaction(shared.engine) as conn:
        rows = [evaluations.get_evaluation(conn, tenant, each) for each in (before, after)]
    earlier, later = rows
    prompts, evaluator = later.prompts, later.request.evaluator
    evaluations.check_comparable(later, prompts=prompts, evaluator=evaluator, where="evaluation")
    evaluations.check_comparable(earlier, prompts=prompts, evaluator=evaluator, where="before")
    scores = [_scores(shared, tenant, row) for row in rows]
    found = compare(*scores, seed=later.request.seed, where=f"evaluation {before}")
    return ComparisonView(
        before=_compared(earlier, scores[0]),
        after=_compared(later, scores[1]),
        regressed=any(change.verdict == "worse" for change in found) if found else None,
        changes=[_change(change) for change in found],
        others=_others(earlier, later, {change.metric for change in found}),
    )


def _scores(shared: Context, tenant: str, row: evaluations.EvaluationRow) -> tuple[MotionScore, ...]:
    where = f"evaluation {row.id}"
    report = next((file for file in row.reports if file.format == "json"), None)
    if report is None:
        raise NotFound("has no report as JSON any more", where=where, hint="Measure the bundle again.")
    return read_scores(shared.store.get(jobs.asset_key(tenant, report.sha256)), where)


def _compared(row: evaluations.EvaluationRow, scores: tuple[MotionScore, ...]) -> ComparedView:
    return ComparedView(id=row.id, name=row.name, bundle=row.request.bundle, motions=len(scores))


def _change(change: MetricChange) -> MetricChangeView:
    return MetricChangeView(**{name: getattr(change, name) for name in MetricChangeView.model_fields})


def _others(
    earlier: evaluations.EvaluationRow, later: evaluations.EvaluationRow, paired: set[str]
) -> list[MetricPairView]:
    old, new = earlier.summary or {}, later.summary or {}
    pairs = ((metric, old.get(metric), value) for metric, value in new.items() if metric not in paired)
    return [
        MetricPairView(metric=metric, before=before, after=after)
        for metric, before, after in pairs
        if before is not None and after is not None
    ]
