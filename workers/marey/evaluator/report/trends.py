"""Trends: a small plot for each key metric over the last runs, as SVG of our own, and the same as a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

from marey.evaluator.report.markup import Markup, element, join
from marey.evaluator.report.model import Report
from marey.evaluator.report.parts import Metric, TrendPoint
from marey.evaluator.report.sections import section, wide
from marey.evaluator.report.tables import trended
from marey.evaluator.report.words import MINUS, day, direction, moment, number, with_unit

WIDTH, HEIGHT = 340, 170
LEFT, RIGHT, TOP, BOTTOM = 52, 328, 16, 136  # of the plot in the picture
HIT = 9  # radius that a pointer finds
TINY = 1e-12  # no metric is told to so many digits


def trends(report: Report) -> Markup:
    """The section; nothing when there is no run to draw."""
    runs, metrics = trended(report)
    if not metrics:
        return Markup("")
    figures = [_figure(index, metric, runs) for index, metric in enumerate(metrics)]
    label = report.row(report.judged).label
    said = f"The row “{label}” of {'one run' if len(runs) == 1 else f'{len(runs)} runs, the oldest left'}."
    if len({run.bundle for run in runs}) > 1:
        said += " A dotted line stands where another bundle begins."
    return section(
        "Trends",
        element("p", said, class_="remark"),
        element("div", *figures, class_="trends"),
        _table(metrics, runs),
        id="trends",
    )


def _figure(index: int, metric: Metric, runs: Sequence[TrendPoint]) -> Markup:
    way = direction(metric)
    unit = f"{metric.unit}, " if metric.unit and way else metric.unit
    heading = element("figcaption", element("b", metric.name), element("small", unit, way))
    return element("figure", heading, plot(f"trend-{index}", metric, runs))


def plot(name: str, metric: Metric, runs: Sequence[TrendPoint]) -> Markup:
    """One metric over runs, evenly spaced; a run without the metric is a gap.

    Args:
        name: prefix of the ids in the picture; one a page.
        metric: what is drawn.
        runs: the oldest first.
    """
    values = [run.values.get(metric.key) for run in runs]
    known = [value for value in values if value is not None]
    if not known:
        return Markup("")
    ticks = ticks_of(known)
    low, high = ticks[0], ticks[-1]
    places = [
        None if value is None else (_across(k, len(runs)), _up(value, low, high)) for k, value in enumerate(values)
    ]
    marks = [_mark(place, metric, run, last=run is runs[-1]) for place, run in zip(places, runs, strict=True) if place]
    return element(
        "svg",
        element("title", f"Trend of {metric.name}", id=f"{name}-title"),
        element("desc", describe(metric, runs), id=f"{name}-desc"),
        _axes(runs, ticks),
        _line(places),
        *marks,
        viewBox=f"0 0 {WIDTH} {HEIGHT}",
        role="img",
        aria_labelledby=f"{name}-title {name}-desc",
    )


def ticks_of(values: Sequence[float]) -> list[float]:
    """Three to five round numbers, the first under all values and the last over them; equal values have room too."""
    low, high = min(values), max(values)
    scale = max(abs(low), abs(high))
    if high - low <= max(1e-6 * scale, TINY):  # equal, or so close that steps would drown in rounding
        room = 0.1 * scale if scale > TINY else 1.0
        low, high = low - room, high + room
    rough = (high - low) / 3
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in (1, 2, 5, 10) if power * factor >= rough)
    first, last = math.floor(low / step), math.ceil(high / step)
    return [step * k for k in range(first, max(last, first + 1) + 1)]


def describe(metric: Metric, runs: Sequence[TrendPoint]) -> str:
    """What the picture shows, in words."""
    known = [(run.values[metric.key], run) for run in runs if metric.key in run.values]

    def said(value: float) -> str:
        return with_unit(number(value, metric), metric)

    (first, start), (last, end) = known[0], known[-1]
    if len(known) == 1:
        return f"One run, {day(end.finished)}: {said(last)}."
    values = [value for value, _ in known]
    return (
        f"{len(known)} runs from {day(start.finished)} to {day(end.finished)}: from {said(first)} to {said(last)}, "
        f"lowest {said(min(values))}, highest {said(max(values))}."
    )


def _across(index: int, count: int) -> float:
    return (LEFT + RIGHT) / 2 if count == 1 else LEFT + 8 + (RIGHT - LEFT - 16) * index / (count - 1)


def _up(value: float, low: float, high: float) -> float:
    return BOTTOM - (BOTTOM - TOP) * (value - low) / (high - low)


def _axes(runs: Sequence[TrendPoint], ticks: Sequence[float]) -> Markup:
    digits = max(0, -math.floor(math.log10(ticks[1] - ticks[0]) + 1e-6))
    lines: list[Markup] = []
    for tick in ticks:
        y = _up(tick, ticks[0], ticks[-1])
        label = f"{tick:.{digits}f}".replace("-", MINUS) if tick else "0"
        lines.append(element("line", x1=LEFT, x2=RIGHT, y1=f"{y:.1f}", y2=f"{y:.1f}", class_="grid"))
        lines.append(element("text", label, x=LEFT - 6, y=f"{y + 4:.1f}", class_="end"))
    for k, (before, run) in enumerate(pairwise(runs)):
        if before.bundle != run.bundle:
            x = f"{(_across(k, len(runs)) + _across(k + 1, len(runs))) / 2:.1f}"
            lines.append(element("line", x1=x, x2=x, y1=TOP, y2=BOTTOM, class_="bundle"))
    dates = [element("text", day(runs[-1].finished), x=RIGHT, y=HEIGHT - 14, class_="end")]
    if len(runs) > 1:
        dates.insert(0, element("text", day(runs[0].finished), x=LEFT, y=HEIGHT - 14))
    return join(*lines, *dates)


def _line(places: Sequence[tuple[float, float] | None]) -> Markup:
    path, drawn = list[str](), False
    for place in places:
        if place:
            path.append(f"{'L' if drawn else 'M'}{place[0]:.1f} {place[1]:.1f}")
        drawn = place is not None
    return element("path", d=" ".join(path), class_="trend")


def _mark(place: tuple[float, float], metric: Metric, run: TrendPoint, *, last: bool) -> Markup:
    x, y = (f"{v:.1f}" for v in place)
    value = with_unit(number(run.values[metric.key], metric), metric)
    told = element("title", f"{value} · {run.bundle} · {moment(run.finished)} · evaluation {run.evaluation}")
    dot = element("circle", cx=x, cy=y, r="4.5" if last else "2.6", class_="dot")
    return element("g", told, dot, element("circle", cx=x, cy=y, r=HIT, class_="hit"), class_="run")


def _table(metrics: Sequence[Metric], runs: Sequence[TrendPoint]) -> Markup:
    head = [element("th", title, scope="col") for title in ("run", "bundle", *(metric.name for metric in metrics))]
    rows = [
        element(
            "tr",
            element("th", f"{day(run.finished)} · {run.evaluation}", scope="row"),
            element("td", run.bundle),
            *(element("td", number(run.values[m.key], m) if m.key in run.values else "–") for m in metrics),
        )
        for run in reversed(runs)
    ]
    table = element("table", element("thead", element("tr", *head)), element("tbody", *rows), class_="runs")
    return element("details", element("summary", "The same as a table"), wide("Trends as a table", table))
