"""Wording of numbers, changes and the outcome, shared by page and Markdown."""

from __future__ import annotations

import json
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Literal

from marey.evaluator.metrics.distribution import SAMPLES_PER_DIMENSION
from marey.evaluator.report.model import Against, Change, Report
from marey.evaluator.report.parts import Exhibit, Metric, Repeats, Value

MINUS, SPACE = "\u2212", "\u00a0"
SUBJECTS: dict[Against, str] = {"last run": "the last run", "pinned baseline": "the pinned baseline"}
MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
NOTHING_EARLIER = "There is no earlier evaluation of this model with this evaluator and this data to compare with."
LEGEND = "↑ higher is better, ↓ lower is better."
CHANGES = (
    "A change has the difference, its direction, and its 95\u00a0% interval, by paired bootstrap over the prompts of "
    "both runs. No difference found means that the interval holds 0."
)
MOST_NAMED = 4  # metrics that the sentence names


@dataclass(frozen=True)
class Headline:
    """The headline of a report: outcome, reason and further remarks."""

    word: str
    sentence: str
    kind: Literal["worse", "same", "unknown"]
    more: tuple[str, ...] = ()


def headline(report: Report) -> Headline:
    """Return regressed or not, with the reason, in one sentence."""
    if not report.baselines:
        return Headline("Not compared", NOTHING_EARLIER, "unknown")
    tally = "; ".join(
        _tally(report, baseline.against, [c for c in report.changes if c.against == baseline.against])
        for baseline in report.baselines
    )
    tally = f"{tally[:1].upper()}{tally[1:]}."
    if report.regressed:
        return Headline("Regressed", report.alarms[0], "worse", (*report.alarms[1:], tally))
    if report.regressed is None:
        return Headline("Not judged", f"No measured metric can raise an alarm. {tally}", "unknown")
    return Headline("No regression found", tally, "same")


def _tally(report: Report, against: Against, changes: list[Change]) -> str:
    if not changes:
        return f"against {SUBJECTS[against]} no metric was compared"
    parts: list[str] = []
    for verdict in ("better", "worse"):
        names = [report.metric(c.metric).name for c in changes if c.verdict == verdict]
        if names:
            more = [f"{len(names) - MOST_NAMED} more"] if len(names) > MOST_NAMED else []
            parts.append(f"{_listed([*names[:MOST_NAMED], *more])} {'is' if len(names) == 1 else 'are'} {verdict}")
    same = [report.metric(c.metric).name for c in changes if c.verdict == "no difference found"]
    if len(same) == 1:
        parts.append(f"no difference was found in {same[0]}")
    elif same:
        of = "any" if len(same) == len(changes) else len(same)
        parts.append(f"no difference was found in {of} of {len(changes)} metrics")
    return f"against {SUBJECTS[against]} {_listed(parts)}"


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def sentence_of(change: Change, metric: Metric) -> str:
    """Describe a change: `Prompt adherence fell from 94.4 % to 88.1 % against the last run (95 % interval of the
    difference: …).`"""
    before, after = (with_unit(number(v, metric), metric) for v in (change.before, change.after))
    verb = "rose" if change.after > change.before else "fell"
    moved = f"{verb} from {before} to {after}" if change.after != change.before else f"stayed at {after}"
    found = "; no difference found" if change.verdict == "no difference found" else ""
    interval = f"95{SPACE}% interval of the difference: {interval_of(change, metric)}{found}"
    return f"{metric.name} {moved} against {SUBJECTS[change.against]} ({interval})."


def number(value: float, metric: Metric) -> str:
    """Format a number with the metric's digits and a real minus; never `−0`."""
    text = f"{value:.{metric.digits}f}"
    return text.lstrip("-") if not text.strip("-0.") else text.replace("-", MINUS)


def signed(value: float, metric: Metric) -> str:
    """Format a difference, always with its sign."""
    text = number(value, metric)
    return text if text.startswith(MINUS) else f"+{text}" if text.strip("0.") else f"±{text}"


def with_unit(text: str, metric: Metric) -> str:
    """Format a number for a sentence."""
    return f"{text}{SPACE}{metric.unit}" if metric.unit else text


def interval_of(change: Change, metric: Metric) -> str:
    """Format the interval of a difference: `−9.8 to −2.9`."""
    return f"{signed(change.low, metric)} to {signed(change.high, metric)}"


def arrow(change: Change) -> str:
    """Return the direction of the change as an arrow; the word beside it tells if it is an improvement."""
    return "↑" if change.after > change.before else "↓" if change.after < change.before else "="


def direction(metric: Metric) -> str:
    """Return `higher is better`; empty for a metric without a better direction."""
    return f"{metric.better} is better" if metric.better else ""


def counts_of(value: Value) -> str:
    """Return N and D of a distance of distributions, and the mark if N < 5·D; empty for other numbers."""
    if value.dimensions is None or value.mean is None:
        return ""
    mark = f": N{SPACE}<{SPACE}{SAMPLES_PER_DIMENSION}·D" if value.too_few else ""
    return f"N{SPACE}{value.n}, D{SPACE}{value.dimensions}{mark}"


def too_few_note(value: Value) -> str:
    """Return the explanation of the mark for too few motions."""
    wanted = SAMPLES_PER_DIMENSION * (value.dimensions or 0)
    return (
        f"N = {value.n} motions are fewer than {SAMPLES_PER_DIMENSION}·D = {wanted} for embeddings of D = "
        f"{value.dimensions} dimensions: mostly sampling noise, and never a reason for an alarm."
    )


def intervals_of(repeats: Repeats) -> str:
    """Return the explanation of ±; intervals without regeneration are labelled."""
    count, anew = repeats.count, repeats.regenerated
    if count == 1:
        return "One repeat: numbers have no interval."
    said = f"± is half of the 95{SPACE}% interval over {count} repeats"
    if anew == count:
        return f"{said}, each of which generated every motion anew."
    if anew == 0:
        return f"{said}, pools only: all drew pools out of the same motions."
    return f"{said}, pools only: {anew} generated the motions anew, the others drew pools out of the same motions."


def moment(time: datetime) -> str:
    """Format a time: `22 Nov 2026, 07:05 UTC`, with English months on every machine."""
    utc = time.astimezone(UTC)
    return f"{day(time)}, {utc:%H:%M} UTC"


def day(time: datetime) -> str:
    """Format a day: `22 Nov 2026`."""
    utc = time.astimezone(UTC)
    return f"{utc.day} {MONTHS[utc.month - 1]} {utc.year}"


def score_of(exhibit: Exhibit) -> str:
    """Format a score with three digits, which distinguish clips."""
    return f"{exhibit.score:.3f}".replace("-", MINUS)


def speed_of(report: Report) -> str:
    """Format a speed: `1.42 motions a second, 9.80 s a motion (median), 1 worker`; empty if it was not measured."""
    if report.speed is None:
        return ""
    rate, median = report.speed.motions_per_second, report.speed.median_seconds_per_motion
    note = f", {report.speed.note}" if report.speed.note else ""
    return f"{rate:.3g} motions a second, {median:.3g} s a motion (median){note}"


def plain(value: object) -> str:
    """Format a setting as a user types it."""
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
