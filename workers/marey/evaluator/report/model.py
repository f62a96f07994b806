"""Data of an evaluation report: numbers with intervals, changes, weak spots, and how to repeat it.

Statements that contradict each other are refused, so that no page ever shows them.
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
    HeatCell,
    Metric,
    Repeats,
    Row,
    Speed,
    TrendPoint,
    aware,
    distinct,
    finite,
)
from marey.measures.comparing import Verdict
from marey.measures.scores import MotionScore

Against = Literal["last run", "pinned baseline"]

GROUND_TRUTH, RECONSTRUCTION = "ground_truth", "reconstruction"
ALWAYS = (GROUND_TRUTH, RECONSTRUCTION)
"""Keys of the rows that every report has: without them a number of generated motion says nothing."""
MOST_EXHIBITS = 6
"""Of the best and of the worst clips each: what a person looks at, and under 1.5 MB a page with three.js."""
OWN_NUMBERS = (
    "These numbers compare runs of this evaluator on this data with each other. They are not comparable with the "
    "numbers that papers print for HumanML3D: other networks measured those, on other data."
)


@dataclass(frozen=True)
class Baseline:
    """An earlier evaluation to compare with: same evaluator, same data.

    Attributes:
        against: which of the two.
        evaluation: its identifier.
        bundle: what generated.
        finished: when.
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
        against: which earlier evaluation.
        before: there.
        after: here.
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
        created: when the report was made.
        generator: the bundle that generated.
        licence: of its weights.
        evaluator: the network that embedded; None where only joints were measured.
        source: split or file of prompts.
        comparability: a sentence under the numbers: with what they may be compared.
        prompts: distinct prompts.
        motions: generated and measured.
        failed: motions that could not be generated; they count in no number.
        repeats: what intervals are over.
        metrics: columns, in order.
        rows: in order; those of `ALWAYS` among them, marked where they could not be measured.
        judged: key of the row that changes and trend speak of: what users get.
        baselines: what it is compared with, one of each kind at most.
        changes: of the judged row.
        regressed: an alarm was raised; None = there was nothing to compare with.
        alarms: a sentence for each reason.
        trend: runs with the same evaluator and data, the oldest first, this one last.
        heat: prompt checks by action and style.
        ranked_by: what `best` and `worst` are ordered by.
        best: clips, the best first.
        worst: clips, the worst first.
        speed: of the generation.
        command: a line for a shell that repeats the evaluation.
        settings: of the generator and the evaluation; JSON.
        software: versions by name.
        notes: further remarks for the reader.
        scores: of each motion, for the comparison that a later run makes; in the JSON alone.
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
    rows: tuple[Row, ...]
    judged: str = "exported"
    baselines: tuple[Baseline, ...] = ()
    changes: tuple[Change, ...] = ()
    regressed: bool | None = None
    alarms: tuple[str, ...] = ()
    trend: tuple[TrendPoint, ...] = ()
    heat: tuple[HeatCell, ...] = ()
    ranked_by: str = ""
    best: tuple[Exhibit, ...] = ()
    worst: tuple[Exhibit, ...] = ()
    speed: Speed | None = None
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
            raise InvalidInput("a run has regressed when an alarm says why, and only then", where="regressed")
        if self.regressed is not None and not self.baselines:
            raise InvalidInput("nothing to have regressed against", where="regressed", hint="Give a baseline, or None.")
        if max(len(self.best), len(self.worst)) > MOST_EXHIBITS:
            raise InvalidInput(f"at most {MOST_EXHIBITS} clips of a kind", where="best, worst")
        try:
            json.dumps(dict(self.settings), allow_nan=False)
        except (TypeError, ValueError) as error:
            raise InvalidInput(f"are not JSON: {error}", where="settings") from None
        self._check_table()
        self._check_changes()

    def metric(self, key: str) -> Metric:
        """A column by its key."""
        return next(metric for metric in self.metrics if metric.key == key)

    def row(self, key: str) -> Row:
        """A row by its key."""
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
            raise InvalidInput("runs come the oldest first", where="trend")

    def _check_changes(self) -> None:
        distinct("baselines", [baseline.against for baseline in self.baselines])
        distinct("changes", [(change.metric, change.against) for change in self.changes])
        metrics, known = {m.key: m for m in self.metrics}, {b.against for b in self.baselines}
        for change in self.changes:
            where = f"change of {change.metric}"
            if change.metric not in metrics:
                raise InvalidInput(f"unknown metric {change.metric!r}", where=where)
            if change.against not in known:
                raise InvalidInput(f"there is no {change.against} among the baselines", where=where)
            if change.verdict == "no difference found":
                continue
            rise = {"higher": "better", "lower": "worse", "": ""}[metrics[change.metric].better]
            fall = {"better": "worse", "worse": "better", "": ""}[rise]
            moved = change.after - change.before
            if not rise or change.verdict == (fall if moved > 0 else rise if moved < 0 else ""):
                raise InvalidInput(f"{change.before:g} to {change.after:g} is not {change.verdict}", where=where)
