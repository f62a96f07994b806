"""Wording of the report: the outcome, numbers, intervals."""

from __future__ import annotations

import dataclasses
from datetime import datetime, timedelta, timezone

import pytest

from marey.evaluator.report import Change, Metric, Repeats, Report
from marey.evaluator.report.words import headline, intervals_of, moment, number, signed

THREE = Metric("m", "M", digits=3)


def test_a_regressed_run_says_so_and_its_first_alarm_says_why(report: Report) -> None:
    head = headline(report)
    assert (head.word, head.kind, head.sentence) == ("Regressed", "worse", report.alarms[0])
    assert head.more[:-1] == report.alarms[1:]
    assert "Foot skate are better, Prompt adherence is worse" in head.more[-1]


def test_a_run_without_alarm_names_what_became_better_and_what_stayed(report: Report) -> None:
    changes = tuple(c for c in report.changes if c.verdict != "worse" and c.against == "last run")
    quiet = dataclasses.replace(report, regressed=False, alarms=(), changes=changes, baselines=report.baselines[:1])
    head = headline(quiet)
    assert (head.word, head.kind) == ("No regression found", "same")
    assert head.sentence == (
        "Against the last run R-precision top 1 on the compositional split and Foot skate are better and "
        "no difference was found in 3 of 5 metrics."
    )


def test_one_metric_without_a_difference_is_named(report: Report) -> None:
    same = tuple(c for c in report.changes if c.metric == "r3")
    quiet = dataclasses.replace(report, regressed=False, alarms=(), changes=same, baselines=report.baselines[:1])
    assert headline(quiet).sentence == "Against the last run no difference was found in R-precision top 3."


def test_a_fall_that_raised_no_alarm_is_named_all_the_same(report: Report) -> None:
    fid = Change("fid", "last run", 0.08, 0.0964, 0.01, 0.02, "worse")
    head = headline(dataclasses.replace(report, regressed=False, alarms=(), changes=(fid,)))
    assert head.sentence == ("Against the last run FID is worse; against the pinned baseline no metric was compared.")


def test_a_first_run_says_that_there_is_nothing_to_compare_with(report: Report) -> None:
    first = dataclasses.replace(report, regressed=None, alarms=(), changes=(), baselines=())
    assert (headline(first).word, headline(first).kind) == ("Not compared", "unknown")
    assert "no earlier evaluation" in headline(first).sentence


def test_a_run_whose_changes_may_raise_no_alarm_is_not_called_good(report: Report) -> None:
    head = headline(dataclasses.replace(report, regressed=None, alarms=()))
    assert (head.word, head.kind) == ("Not judged", "unknown")


def test_a_long_list_of_metrics_is_cut(report: Report) -> None:
    higher = [m for m in report.metrics if m.better == "higher"]
    changes = tuple(Change(m.key, "last run", 1, 2, 0.5, 1.5, "better") for m in higher)
    lower = tuple(Change(m.key, "last run", 2, 1, -1.5, -0.5, "better") for m in report.metrics if m.better == "lower")
    head = headline(dataclasses.replace(report, regressed=False, alarms=(), changes=(*changes, *lower)))
    assert f"and {len(changes) + len(lower) - 4} more are better" in head.sentence


@pytest.mark.parametrize(
    ("value", "text"), [(0.41249, "0.412"), (-0.5, "−0.500"), (-0.0001, "0.000"), (0.0, "0.000"), (1234.5, "1234.500")]
)
def test_a_number_has_the_metrics_digits_and_no_minus_zero(value: float, text: str) -> None:
    assert number(value, THREE) == text


@pytest.mark.parametrize(("value", "text"), [(0.03, "+0.030"), (-0.03, "−0.030"), (-0.0001, "±0.000")])
def test_a_difference_has_its_sign(value: float, text: str) -> None:
    assert signed(value, THREE) == text


@pytest.mark.parametrize(
    ("count", "anew", "said", "pools_only"),
    [
        (20, 20, "each of which generated every motion anew", False),
        (20, 1, "1 generated the motions anew, the others drew pools", True),
        (20, 0, "all drew pools out of the same motions", True),
        (1, 1, "no interval", False),
    ],
)
def test_an_interval_says_what_it_is_over(count: int, anew: int, said: str, pools_only: bool) -> None:
    text = intervals_of(Repeats(count, anew))
    assert said in text
    assert ("pools only" in text) is pools_only


def test_a_moment_is_told_in_utc() -> None:
    late = datetime(2026, 1, 1, 1, 5, tzinfo=timezone(timedelta(hours=2)))
    assert moment(late) == "31 Dec 2025, 23:05 UTC"
