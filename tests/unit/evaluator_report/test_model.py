"""Values that a report refuses: non-finite numbers, and statements that contradict each other."""

from __future__ import annotations

import dataclasses
from datetime import UTC, datetime
from typing import Any

import pytest

from marey.core.errors import InvalidInput
from marey.evaluator.report import (
    Baseline,
    Change,
    Exhibit,
    GenerationSpeed,
    HeatCell,
    Metric,
    MetricRow,
    MotionScore,
    Repeats,
    Report,
    TrendPoint,
    Value,
    sentence_of,
)
from tests.support.reports import METRICS, sample_report

NOW = datetime(2026, 11, 23, tzinfo=UTC)
NAN, INFINITE = float("nan"), float("inf")


@pytest.mark.parametrize("number", [NAN, INFINITE, -INFINITE])
@pytest.mark.parametrize(
    "make",
    [
        lambda x: Value(x),
        lambda x: Value(1.0, x),
        lambda x: Change("r1", "last run", x, 1, 0, 0, "no difference found"),
        lambda x: Change("r1", "last run", 1, 1, x, x, "no difference found"),
        lambda x: TrendPoint(NOW, "1", "b", {"r1": x}),
        lambda x: Exhibit("p", 1, True, "", x),
        lambda x: GenerationSpeed(x, 1.0),
        lambda x: MotionScore(0, 0, None, x),
        lambda x: sample_report(settings={"guidance": x}),
    ],
)
def test_a_number_that_is_not_finite_is_refused(make: Any, number: float) -> None:
    with pytest.raises(InvalidInput):
        make(number)


def test_a_missing_value_has_to_say_why() -> None:
    with pytest.raises(InvalidInput, match="needs a note"):
        Value(None)
    with pytest.raises(InvalidInput, match="no interval"):
        Value(None, 0.1, note="no network")
    assert Value.missing("no network") == Value(None, note="no network")


@pytest.mark.parametrize(("n", "marked"), [(1279, True), (1280, False)])
def test_a_distance_is_marked_below_five_motions_a_dimension(n: int, marked: bool) -> None:
    assert Value(0.1, n=n, dimensions=256).too_few is marked
    assert not Value(0.1, n=n).too_few


@pytest.mark.parametrize("key", ["ground_truth", "reconstruction", "exported"])
def test_no_report_goes_without_real_motion_reconstruction_and_the_judged_row(report: Report, key: str) -> None:
    with pytest.raises(InvalidInput, match=f"missing row '{key}'"):
        dataclasses.replace(report, rows=tuple(row for row in report.rows if row.key != key))


def test_a_regression_needs_an_alarm_that_says_why_and_an_alarm_is_a_regression(report: Report) -> None:
    for regressed, alarms in ((True, ()), (False, ("it fell",)), (None, ("it fell",))):
        with pytest.raises(InvalidInput, match="alarm"):
            dataclasses.replace(report, regressed=regressed, alarms=alarms)
    with pytest.raises(InvalidInput, match="needs a baseline"):
        dataclasses.replace(report, regressed=False, alarms=(), changes=(), baselines=())


@pytest.mark.parametrize(
    ("metric", "after", "verdict"),
    [
        ("r1", 0.5, "worse"),
        ("r1", 0.3, "better"),
        ("fid", 0.5, "better"),
        ("fid", 0.3, "worse"),
        ("diversity", 1, "better"),
    ],
)
def test_a_verdict_against_the_metrics_direction_is_refused(
    report: Report, metric: str, after: float, verdict: Any
) -> None:
    with pytest.raises(InvalidInput, match=f"is not {verdict}"):
        dataclasses.replace(report, changes=(Change(metric, "last run", 0.4, after, -1, 1, verdict),))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"changes": (Change("nope", "last run", 1, 1, 0, 0, "no difference found"),)}, "unknown metric 'nope'"),
        ({"baselines": ()}, "needs a baseline"),
        ({"rows": (MetricRow("ground_truth", "", "", {"nope": Value(1.0)}),)}, "missing row 'reconstruction'"),
        ({"trend": (TrendPoint(NOW, "1", "b", {"nope": 1.0}),)}, "unknown metric 'nope'"),
        ({"trend": (TrendPoint(NOW, "2", "b", {}), TrendPoint(NOW.replace(year=2025), "1", "b", {}))}, "oldest first"),
        ({"metrics": (*METRICS, METRICS[0])}, "duplicate key"),
        ({"heat": (HeatCell("walk", "", 1, 1), HeatCell("walk", "", 2, 1))}, "duplicate key"),
        ({"scores": (MotionScore(1, 0, 1.0, None), MotionScore(1, 0, 0.0, None))}, "duplicate key"),
        ({"best": tuple(Exhibit("p", k, True, "", 0.1) for k in range(7))}, "at most 6"),
        ({"motions": -1}, "-1 motions"),
        ({"settings": {"path": object()}}, "not JSON"),
        ({"created": datetime(2026, 11, 23)}, "time zone"),
    ],
)
def test_what_does_not_fit_together_is_refused(report: Report, changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidInput, match=message):
        dataclasses.replace(report, **changed)


def test_parts_refuse_impossible_counts() -> None:
    with pytest.raises(InvalidInput, match="5 of 4"):
        HeatCell("walk", "", 4, 5)
    with pytest.raises(InvalidInput, match="3 of 2"):
        Repeats(2, 3)
    with pytest.raises(InvalidInput, match="interval from 2 to 1"):
        Change("r1", "last run", 1, 1, 2, 1, "no difference found")
    with pytest.raises(InvalidInput, match="time zone"):
        Baseline("last run", "1", "b", datetime(2026, 11, 23))


def test_a_sentence_says_what_moved_how_far_and_how_sure() -> None:
    obeyed = Metric("obeyed", "Prompt adherence", "%", "higher", 1)
    fell = Change("obeyed", "last run", 94.4, 88.1, -9.8, -2.9, "worse")
    assert sentence_of(fell, obeyed).replace("\u00a0", " ") == (
        "Prompt adherence fell from 94.4 % to 88.1 % against the last run "
        "(95 % interval of the difference: −9.8 to −2.9)."
    )
    same = Change("obeyed", "pinned baseline", 94.4, 94.8, -1.0, 1.9, "no difference found")
    assert sentence_of(same, obeyed).replace("\u00a0", " ") == (
        "Prompt adherence rose from 94.4 % to 94.8 % against the pinned baseline "
        "(95 % interval of the difference: −1.0 to +1.9; no difference found)."
    )
