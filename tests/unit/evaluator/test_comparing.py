"""Two runs motion against motion: pairing, verdicts, alarms."""

from __future__ import annotations

from datetime import UTC, datetime

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.evaluator.comparing import Earlier, alarms, changes
from marey.evaluator.report import Baseline, Metric, MotionScore
from marey.measures.comparing import OBEYED, RETRIEVED, TIMELINE_ROWS, compare

METRICS = {
    OBEYED: Metric(OBEYED, "Prompt adherence", "%", "higher", 1),
    RETRIEVED: Metric(RETRIEVED, "R-precision 3 of 32", "%", "higher", 1),
}
RNG = np.random.default_rng(0)


def run(share: float, *, retrieved: float | None = 0.5, prompts: int = 100) -> list[MotionScore]:
    """Two motions of each prompt, of which about `share` do what they should."""
    obeyed = np.random.default_rng(1).random((prompts, 2)) < share
    return [MotionScore(i, k, float(obeyed[i, k]), retrieved) for i in range(prompts) for k in range(2)]


def earlier(scores: list[MotionScore]) -> Earlier:
    return Earlier(Baseline("last run", "e1", "hgm3-starter@1", datetime(2026, 11, 23, tzinfo=UTC)), scores)


def test_a_run_that_obeys_clearly_less_is_worse_and_raises_an_alarm() -> None:
    found = changes(earlier(run(0.95)), run(0.7), seed=0)
    (obeyed, retrieved) = found
    assert (obeyed.metric, obeyed.verdict) == (OBEYED, "worse")
    assert obeyed.high < 0
    assert obeyed.before > obeyed.after
    assert (retrieved.metric, retrieved.verdict) == (RETRIEVED, "no difference found")
    (alarm,) = alarms(found, METRICS)
    assert alarm.startswith("Prompt adherence fell from ")


def test_a_run_that_obeys_clearly_more_is_better_and_raises_none() -> None:
    found = changes(earlier(run(0.7)), run(0.95), seed=0)
    assert found[0].verdict == "better"
    assert alarms(found, METRICS) == ()


def test_motions_are_paired_by_prompt_and_repeat_whatever_their_order() -> None:
    before, after = run(0.9), run(0.85)
    mixed = [after[k] for k in RNG.permutation(len(after))]
    assert changes(earlier(before), after, seed=3) == changes(earlier(before), mixed, seed=3)


def test_motions_that_one_run_lacks_count_in_neither() -> None:
    before, after = run(1.0), run(1.0)
    without = [score for score in before if score.index != 4]
    spoilt = [MotionScore(4, s.variant, 0.0, 0.0) if s.index == 4 else s for s in after]
    assert all(change.before == change.after for change in changes(earlier(without), spoilt, seed=0))


def test_a_metric_that_was_not_measured_in_both_runs_has_no_change() -> None:
    found = changes(earlier(run(0.9, retrieved=None)), run(0.9), seed=0)
    assert [change.metric for change in found] == [OBEYED]


def test_runs_of_other_prompts_are_refused() -> None:
    moved = [MotionScore(s.index + 1000, s.variant, s.obeyed, s.retrieved) for s in run(0.9)]
    with pytest.raises(InvalidInput, match="no prompts in common"):
        changes(earlier(moved), run(0.9), seed=0)


def test_timelines_are_paired_by_the_share_of_their_rows_that_show_their_prompts() -> None:
    shares = np.random.default_rng(2).integers(0, 4, (60, 2)) / 4
    before = [MotionScore(i, k, None, None, float(shares[i, k])) for i in range(60) for k in range(2)]
    after = [MotionScore(s.index, s.variant, None, None, min((s.rows_shown or 0.0) + 0.25, 1.0)) for s in before]
    (change,) = compare(before, after, seed=0, where="e1")
    assert (change.metric, change.verdict, change.prompts, change.motions) == (TIMELINE_ROWS, "better", 60, 120)
    assert change.after - change.before == pytest.approx(25.0)
    assert changes(earlier(before), after, seed=0) == ()  # a report has no column of them
    older = [MotionScore(s.index, s.variant, 1.0, None) for s in before]
    assert [each.metric for each in compare(older, after, seed=0, where="e1")] == []


def test_a_share_beyond_one_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"a score of 1\.5"):
        MotionScore(0, 0, None, None, 1.5)
