"""Data of an evaluation report: numbers with intervals, changes, weak spots, and how to repeat it.

Contradictory statements are refused, so that no page shows them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, Literal

from marey.core.errors import InvalidInput
from marey.evaluator.report.parts import (
    ArtifactReference,
    Exhibit,
    GenerationSpeed,
    HeatCell,
    Metric,
    MetricRow,
    Repeats,
    TrendPoint,
    aware,
    distinct,
    finite,
)
from marey.evaluator.report.shots import ConstraintSection, TimelineSection
from marey.measures.comparing import Verdict
from marey.measures.scores import MotionScore

Against = Literal["last run", "pinned baseline"]

GROUND_TRUTH, RECONSTRUCTION = "ground_truth", "reconstruction"
ALWAYS = (GROUND_TRUTH, RECONSTRUCTION)
"""Keys of the rows that every report has: a number of generated motion has no meaning without them."""
MOST_EXHIBITS = 6
"""Number of best and of worst clips: enough for a reader, and under 1.5 MB per page with three.js."""
OWN_NUMBERS = (
    "These numbers compare runs of this evaluator on this data with each other. They are not comparable with the "
    "numbers that papers print for HumanML3D: other networks measured those, on other data."
)


@dataclass(frozen=True)
class Baseline:
    """An earlier evaluation to compare with: same evaluator, same data.

    Attributes:
        against: the kind of comparison.
        evaluation: its identifier.
        bundle: the bundle that generated.
        finished: time of its end.
    """

    against: Against
    evaluation: str
    bundle: str
    finished: datetime

    def __post_init__(self) -> None:
        aware("baseline.finished", self.finished)


@dataclass(frozen=True)
class Change:
    """Change of one metric of the judged row, by paired bootstrap.

    Attributes:
        metric: its key.
        against: the kind of the earlier evaluation.
        before: value of the earlier evaluation.
        after: value of this one.
        low: lower end of the 95 % interval of after - before.
        high: upper end.
        verdict: `no difference found` is a result.
    """

    metric: str
    against: Against
    before: float
    after: float
    low: float
    high: float
    verdict: Verdict

    def __post_init__(self) -> None:
        finite(f"change of {self.metric}", self.before, self.after, self.low, self.high)
        if self.low > self.high:
            raise InvalidInput(f"an interval from {self.low:g} to {self.high:g}", where=f"change of {self.metric}")


@dataclass(frozen=True, kw_only=True)
class Report:
    """One evaluation.

    Attributes:
        title: of the page.
        evaluation: identifier of the evaluation.
        created: time of the report.
        generator: the bundle that generated.
        licence: of its weights.
        evaluator: the network that embedded; None where only joints were measured.
        source: split or file of prompts.
        comparability: a sentence under the numbers on what they may be compared with.
        prompts: distinct prompts.
        motions: generated and measured.
        failed: motions that could not be generated; they count in no number.
        repeats: the repeats that intervals cover.
        metrics: columns, in order.
        rows: in order, including those of `ALWAYS`, marked if they could not be measured.
        judged: key of the row that changes and trend refer to: the motion that users get.
        baselines: earlier evaluations to compare with, at most one of each kind.
        changes: of the judged row.
        regressed: True if an alarm was raised; None = no baseline.
        alarms: a sentence for each reason.
        trend: runs with the same evaluator and data, the oldest first, this one last.
        heat: prompt checks by action and style.
        timelines: rows of timelines; None = there is no timeline.
        constraints: errors of constraints; None = no motion has any.
        ranked_by: order of `best` and `worst`.
        best: clips, the best first.
        worst: clips, the worst first.
        speed: of the generation.
        command: a shell command that repeats the evaluation.
        settings: of the generator and the evaluation; JSON.
        software: versions by name.
        notes: further remarks for the reader.
        scores: scores of each motion, for the comparison of a later run; in the JSON alone.
    """

    title: str
    evaluation: str
    created: datetime
    generator: ArtifactReference
    licence: str
    evaluator: ArtifactReference | None
    source: ArtifactReference
    comparability: str = OWN_NUMBERS
    prompts: int
    motions: int
    failed: int = 0
    repeats: Repeats
    metrics: tuple[Metric, ...]
    rows: tuple[MetricRow, ...]
    judged: str = "exported"
    baselines: tuple[Baseline, ...] = ()
    changes: tuple[Change, ...] = ()
    regressed: bool | None = None
    alarms: tuple[str, ...] = ()
    trend: tuple[TrendPoint, ...] = ()
    heat: tuple[HeatCell, ...] = ()
    timelines: TimelineSection | None = None
    constraints: ConstraintSection | None = None
    ranked_by: str = ""
    best: tuple[Exhibit, ...] = ()
    worst: tuple[Exhibit, ...] = ()
    speed: GenerationSpeed | None = None
    command: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    software: Mapping[str, str] = field(default_factory=dict[str, str])
    notes: tuple[str, ...] = ()
    scores: tuple[MotionScore, ...] = ()

    def __post_init__(self) -> None:
        aware("created", self.created)
        if min(self.prompts, self.motions, self.failed) < 0:
            raise InvalidInput(f"{self.prompts} prompts, {self.motions} motions, {self.failed} failed")
        if bool(self.regressed) != bool(self.alarms):
            raise InvalidInput("`regressed` needs an alarm, and an alarm needs `regressed`", where="regressed")
        if self.regressed is not None and not self.baselines:
            raise InvalidInput("`regressed` needs a baseline", where="regressed", hint="Give a baseline, or None.")
        if max(len(self.best), len(self.worst)) > MOST_EXHIBITS:
            raise InvalidInput(f"at most {MOST_EXHIBITS} clips of a kind", where="best, worst")
        try:
            json.dumps(dict(self.settings), allow_nan=False)
        except (TypeError, ValueError) as error:
            raise InvalidInput(f"are not JSON: {error}", where="settings") from None
        self._check_table()
        self._check_changes()

    def metric(self, key: str) -> Metric:
        """Return a column by its key."""
        return next(metric for metric in self.metrics if metric.key == key)

    def row(self, key: str) -> MetricRow:
        """Return a row by its key."""
        return next(row for row in self.rows if row.key == key)

    def _check_table(self) -> None:
        metrics, rows = [m.key for m in self.metrics], [r.key for r in self.rows]
        distinct("metrics", metrics)
        distinct("rows", rows)
        distinct("scores", [(score.index, score.variant) for score in self.scores])
        distinct("heat", [(cell.act, cell.style) for cell in self.heat])
        for key in (*ALWAYS, self.judged):
            if key not in rows:
                raise InvalidInput(f"missing row {key!r}", where="rows", hint="Give a marked one: Value.missing.")
        for where, keys in [
            *((f"row {r.key}", r.values) for r in self.rows),
            *(("trend", t.values) for t in self.trend),
        ]:
            if unknown := [key for key in keys if key not in metrics]:
                raise InvalidInput(f"unknown metric {unknown[0]!r}", where=where)
        if any(a.finished > b.finished for a, b in zip(self.trend, self.trend[1:], strict=False)):
            raise InvalidInput("runs must be ordered by age, the oldest first", where="trend")

    def _check_changes(self) -> None:
        distinct("baselines", [baseline.against for baseline in self.baselines])
        distinct("changes", [(change.metric, change.against) for change in self.changes])
        metrics, known = {m.key: m for m in self.metrics}, {b.against for b in self.baselines}
        for change in self.changes:
            where = f"change of {change.metric}"
            if change.metric not in metrics:
                raise InvalidInput(f"unknown metric {change.metric!r}", where=where)
            if change.against not in known:
                raise InvalidInput(f"the baselines lack the {change.against}", where=where)
            if change.verdict == "no difference found":
                continue
            rise = {"higher": "better", "lower": "worse", "": ""}[metrics[change.metric].better]
            fall = {"better": "worse", "worse": "better", "": ""}[rise]
            moved = change.after - change.before
            if not rise or change.verdict == (fall if moved > 0 else rise if moved < 0 else ""):
                raise InvalidInput(f"{change.before:g} to {change.after:g} is not {change.verdict}", where=where)
