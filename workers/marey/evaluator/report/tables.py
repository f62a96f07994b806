"""The numbers as tables of text, shared by the page and Markdown.

Columns of different evaluators never share a table, and a column on other data is labelled. The columns of one
evaluator are split into several tables where one would be wider than a window. Changes since the last run and since the
pinned baseline are listed under the judged row.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

from marey.evaluator.report.model import ALWAYS, Baseline, Report
from marey.evaluator.report.parts import HeatCell, Metric, MetricRow, TrendPoint
from marey.evaluator.report.words import (
    SUBJECTS,
    arrow,
    counts_of,
    day,
    interval_of,
    number,
    signed,
    too_few_note,
)

Kind = Literal["value", "missing", "blank", "better", "worse", "same"]
NOT_AVAILABLE = "not available"
MOST_COLUMNS = 6
"""Largest number of columns of a table with intervals and row names in 1,000 pixels. R-precision in both pools is
six."""
MOST_RUNS = 30
"""Largest number of runs of a trend: half a year of weekly runs."""
MOST_STYLES = 8
"""Columns of the heat map with normal width; more columns are narrower, their names upright."""
RAMP = (0.2, 0.4, 0.6, 0.8, 0.95)
"""Shares passed at which a cell of the heat map gets paler; the last step begins at the 95 % target."""
LEAST_TRIALS = 3
"""Smallest number of trials of a cell that may be named among the weakest: fewer would be chance."""


@dataclass(frozen=True)
class Cell:
    """One place of a table: `0.412`, `± 0.008`, `N 337, D 512: N < 5·D`, with the numbers of its footnotes."""

    kind: Kind
    text: str = ""
    interval: str = ""
    detail: str = ""
    marks: tuple[int, ...] = ()


@dataclass(frozen=True)
class Line:
    """One row; `of` is the kind: values, or changes of the row above."""

    of: Literal["values", "changes"]
    label: str
    note: str
    cells: tuple[Cell, ...]
    judged: bool = False


@dataclass(frozen=True)
class Table:
    """Columns measured by one evaluator."""

    measured_by: str
    metrics: tuple[Metric, ...]
    lines: tuple[Line, ...]
    footnotes: tuple[tuple[int, str], ...]


@dataclass
class _Footnotes:
    """Numbers of footnotes; equal texts share one number."""

    numbers: dict[str, int] = field(default_factory=dict[str, int])

    def of(self, text: str) -> tuple[int, ...]:
        return (self.numbers.setdefault(text, len(self.numbers) + 1),) if text else ()


def tables_of(report: Report) -> tuple[Table, ...]:
    """Return the tables of each evaluator, in the order of the metrics; footnotes are numbered across them."""
    groups: dict[str, list[Metric]] = {}
    for metric in report.metrics:
        groups.setdefault(metric.measured_by, []).append(metric)
    footnotes, tables = _Footnotes(), list[Table]()
    for metrics in (columns for group in groups.values() for columns in _cut(group)):
        lines = tuple(_lines(report, metrics, footnotes))
        used = {mark for line in lines for cell in line.cells for mark in cell.marks}
        notes = tuple((mark, text) for text, mark in footnotes.numbers.items() if mark in used)
        tables.append(Table(metrics[0].measured_by, tuple(metrics), lines, notes))
    return tuple(tables)


def _cut(metrics: Sequence[Metric]) -> Iterator[Sequence[Metric]]:
    """Split columns into tables of about equal width."""
    size = math.ceil(len(metrics) / math.ceil(len(metrics) / MOST_COLUMNS))
    for begin in range(0, len(metrics), size):
        yield metrics[begin : begin + size]


def _lines(report: Report, metrics: Sequence[Metric], footnotes: _Footnotes) -> list[Line]:
    lines: list[Line] = []
    for row in report.rows:
        if row.key not in ALWAYS and not any(metric.key in row.values for metric in metrics):
            continue
        judged = row.key == report.judged
        cells = tuple(_value(row, metric, footnotes) for metric in metrics)
        lines.append(Line("values", row.label, row.note, cells, judged))
        if judged:
            compared = (_change_line(report, baseline, metrics) for baseline in report.baselines)
            lines += [line for line in compared if any(cell.kind != "blank" for cell in line.cells)]
    return lines


def _value(row: MetricRow, metric: Metric, footnotes: _Footnotes) -> Cell:
    value = row.values.get(metric.key)
    if value is None:
        return Cell("blank")
    if value.mean is None:
        return Cell("missing", NOT_AVAILABLE, marks=footnotes.of(value.note))
    interval = "" if value.half_width is None else f"± {number(value.half_width, metric)}"
    marks = footnotes.of(value.note) + (footnotes.of(too_few_note(value)) if value.too_few else ())
    return Cell("value", number(value.mean, metric), interval, counts_of(value), marks)


def _change_line(report: Report, baseline: Baseline, metrics: Sequence[Metric]) -> Line:
    changes = {change.metric: change for change in report.changes if change.against == baseline.against}
    cells: list[Cell] = []
    for metric in metrics:
        change = changes.get(metric.key)
        if change is None:
            cells.append(Cell("blank"))
            continue
        kind: Kind = "same" if change.verdict == "no difference found" else change.verdict
        text = f"{arrow(change)} {signed(change.after - change.before, metric)}"
        cells.append(Cell(kind, text, interval_of(change, metric), change.verdict))
    note = f"{baseline.bundle}, evaluation {baseline.evaluation}, {day(baseline.finished)}"
    return Line("changes", f"change against {SUBJECTS[baseline.against]}", note, tuple(cells))


@dataclass(frozen=True)
class Heat:
    """Prompt checks by action (rows) and style (columns), with sums; untried places are None."""

    acts: tuple[str, ...]
    styles: tuple[str, ...]
    cells: Mapping[tuple[str, str], HeatCell]

    def cell(self, act: str, style: str) -> HeatCell | None:
        """Return one place; None without trials."""
        found = self.cells.get((act, style))
        return found if found and found.trials else None

    def total(self, act: str | None = None, style: str | None = None) -> HeatCell:
        """Return the sum of a row, of a column, or of all."""
        chosen = [c for c in self.cells.values() if act in (None, c.act) and style in (None, c.style)]
        return HeatCell(act or "", style or "", sum(c.trials for c in chosen), sum(c.passed for c in chosen))

    @property
    def weakest(self) -> tuple[HeatCell, ...]:
        """Return up to three places with the highest failure rates, the worst first."""
        tried = [c for c in self.cells.values() if c.trials >= LEAST_TRIALS and c.passed < c.trials]
        return tuple(sorted(tried, key=lambda c: (share(c), -c.trials))[:3])


def heat_of(report: Report) -> Heat:
    """Build the heat map; actions and styles in the order of their first occurrence."""
    cells = {(cell.act, cell.style): cell for cell in report.heat}
    return Heat(tuple(dict.fromkeys(a for a, _ in cells)), tuple(dict.fromkeys(s for _, s in cells)), cells)


def share(cell: HeatCell) -> float:
    """Return the share of trials that passed, 0 to 1."""
    return cell.passed / cell.trials


def heat_step(cell: HeatCell) -> int:
    """Return the step of the colour ramp: 0 where most fails, 5 where nearly all passes."""
    return sum(share(cell) >= bound for bound in RAMP)


def in_percent(cell: HeatCell) -> str:
    """Format whole percent; 0 and 100 only if none or all passed."""
    percent = round(100 * share(cell))
    if cell.passed not in (0, cell.trials):
        percent = min(max(percent, 1), 99)
    return f"{percent} %"


def weakest_of(heat: Heat) -> str:
    """Return one sentence on the highest failure rates; empty if no check failed."""
    named = [f"{place_of(c)} {c.passed} of {c.trials}" for c in heat.weakest]
    return f"Weakest: {', '.join(named)}." if named else ""


def place_of(cell: HeatCell) -> str:
    """Name a cell: `kick (exhausted)`."""
    return f"{cell.act} ({cell.style})" if cell.style else cell.act


def trended(report: Report) -> tuple[tuple[TrendPoint, ...], tuple[Metric, ...]]:
    """Return the last runs, and the metrics that any of them has."""
    runs = report.trend[-MOST_RUNS:]
    return runs, tuple(m for m in report.metrics if any(m.key in run.values for run in runs))
