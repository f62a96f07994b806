"""Trends: the layout of a small plot for each key metric over the last runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from marey.evaluator.report.parts import Metric, TrendPoint
from marey.evaluator.report.words import MINUS, day, moment, number, with_unit

WIDTH, HEIGHT = 340, 170
LEFT, RIGHT, TOP, BOTTOM = 52, 328, 16, 136  # edges of the plot in the picture
HIT = 9  # radius of the area that reacts to a pointer
TINY = 1e-12  # smaller than the last printed digit of any metric


@dataclass(frozen=True)
class Dot:
    """A run in the picture; x and y in the units of its view box."""

    x: float
    y: float
    run: TrendPoint
    label: str


@dataclass(frozen=True)
class Plot:
    """One metric over runs, evenly spaced, as `plot.svg.jinja` draws it.

    Attributes:
        name: prefix of the ids in the picture.
        metric: the drawn metric.
        runs: the oldest first.
        description: description of the picture, in words.
        ticks: heights and labels of the grid.
        bundle_changes: positions where another bundle begins.
        path: the line through the runs; a run without the metric is a gap.
        dots: runs that have the metric.
    """

    name: str
    metric: Metric
    runs: Sequence[TrendPoint]
    description: str
    ticks: Sequence[tuple[float, str]]
    bundle_changes: Sequence[float]
    path: str
    dots: Sequence[Dot]


def plot_of(name: str, metric: Metric, runs: Sequence[TrendPoint]) -> Plot | None:
    """Lay out the plot of a metric; None if no run has it.

    Args:
        name: prefix of the ids in the picture; one a page.
        metric: the metric to draw.
        runs: the oldest first.
    """
    known = [run.values[metric.key] for run in runs if metric.key in run.values]
    if not known:
        return None
    ticks = ticks_of(known)
    count, dots = len(runs), list[Dot | None]()
    for k, run in enumerate(runs):
        value = run.values.get(metric.key)
        if value is None:
            dots.append(None)
            continue
        said = with_unit(number(value, metric), metric)
        label = f"{said} · {run.bundle} · {moment(run.finished)} · evaluation {run.evaluation}"
        dots.append(Dot(_across(k, count), _up(value, ticks[0], ticks[-1]), run, label))
    return Plot(
        name,
        metric,
        runs,
        describe(metric, runs),
        _labelled(ticks),
        [
            (_across(k, count) + _across(k + 1, count)) / 2
            for k, (before, run) in enumerate(pairwise(runs))
            if before.bundle != run.bundle
        ],
        _path(dots),
        [dot for dot in dots if dot],
    )


def ticks_of(values: Sequence[float]) -> list[float]:
    """Return three to five round numbers that enclose all values; equal values get a range too."""
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
    """Describe the picture in words."""
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


def _labelled(ticks: Sequence[float]) -> list[tuple[float, str]]:
    digits = max(0, -math.floor(math.log10(ticks[1] - ticks[0]) + 1e-6))
    labels = [f"{tick:.{digits}f}".replace("-", MINUS) if tick else "0" for tick in ticks]
    return [(_up(tick, ticks[0], ticks[-1]), label) for tick, label in zip(ticks, labels, strict=True)]


def _path(dots: Sequence[Dot | None]) -> str:
    path, drawn = list[str](), False
    for dot in dots:
        if dot:
            path.append(f"{'L' if drawn else 'M'}{dot.x:.1f} {dot.y:.1f}")
        drawn = dot is not None
    return " ".join(path)
