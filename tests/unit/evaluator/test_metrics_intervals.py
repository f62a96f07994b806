"""Intervals over repeats and of paired differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.evaluator.metrics.intervals import redraw, repeated
from marey.measures.bootstrap import paired_bootstrap

# -- repeats ---------------------------------------------------------------------------------------------------------


def test_the_interval_is_1_96_population_deviations_over_the_root_of_n():
    found = repeated([1.0, 2.0, 3.0, 6.0])
    assert (found.mean, found.n) == (3.0, 4)
    assert found.half_width == pytest.approx(1.96 * np.sqrt(14 / 4) / 2)


def test_each_repeat_draws_its_own_numbers_and_the_seed_repeats_them():
    drawn = redraw(lambda rng: rng.random(4).tolist(), repeats=20, seed=8)
    assert len({tuple(d) for d in drawn}) == 20
    assert drawn == redraw(lambda rng: rng.random(4).tolist(), repeats=20, seed=8)
    assert drawn[:3] == redraw(lambda rng: rng.random(4).tolist(), repeats=3, seed=8)
    assert drawn != redraw(lambda rng: rng.random(4).tolist(), repeats=20, seed=9)


# -- paired bootstrap ------------------------------------------------------------------------------------------------


def scores(seed, count=80, gain=0.0):
    """Two runs whose prompts differ far more than the runs do."""
    rng = np.random.default_rng(seed)
    prompt = 10 * rng.normal(size=count)
    return prompt + rng.normal(size=count), prompt + gain + rng.normal(size=count)


@pytest.mark.parametrize(("gain", "worse", "better"), [(1.0, False, True), (-1.0, True, False), (0.0, False, False)])
def test_a_change_is_seen_beneath_the_differences_of_prompts(gain, worse, better):
    before, after = scores(3, gain=gain)
    found = paired_bootstrap(before, after, rounds=2000, seed=1)
    assert (found.worse, found.better) == (worse, better)
    assert found.mean == pytest.approx((after - before).mean())
    assert found.low < found.mean < found.high
    # unpaired, 80 prompts with a deviation of 10 would leave ± 3
    assert found.high - found.low < 1.0


def test_the_interval_is_that_of_the_normal_distribution_for_many_prompts():
    before, after = scores(4, count=2000, gain=0.1)
    found = paired_bootstrap(before, after, seed=1)
    half = 1.96 * (after - before).std() / np.sqrt(2000)
    assert found.low == pytest.approx(found.mean - half, abs=0.05 * half)
    assert found.high == pytest.approx(found.mean + half, abs=0.05 * half)


def test_without_a_change_about_one_alarm_in_forty_is_raised_on_either_side():
    found = [paired_bootstrap(*scores(seed), rounds=300, seed=seed) for seed in range(600)]
    assert 0.01 < np.mean([f.worse for f in found]) < 0.05
    assert 0.01 < np.mean([f.better for f in found]) < 0.05


def test_two_equal_runs_are_neither_worse_nor_better():
    before, _ = scores(3)
    found = paired_bootstrap(before, before, rounds=500, seed=1)
    assert (found.low, found.high, found.worse, found.better) == (0.0, 0.0, False, False)


def test_seeds_of_one_prompt_are_resampled_together():
    before, after = scores(5)
    once = paired_bootstrap(before, after, rounds=4000, seed=1)
    prompts = np.tile(np.arange(80), 9)
    order = np.random.default_rng(0).permutation(720)
    many = [np.tile(x, 9)[order] for x in (before, after)]  # nine seeds that came out alike
    grouped = paired_bootstrap(*many, rounds=4000, seed=1, groups=prompts[order])
    naive = paired_bootstrap(*many, rounds=4000, seed=1)
    assert grouped.n == once.n == 80
    assert grouped.high - grouped.low == pytest.approx(once.high - once.low)
    assert naive.high - naive.low < 0.5 * (once.high - once.low)


def test_a_prompt_weighs_as_many_scores_as_it_has():
    before, after = np.zeros(12), np.array([1.0] * 10 + [0.0, 0.0])
    found = paired_bootstrap(before, after, rounds=2000, seed=1, groups=np.array([7] * 10 + [2, 4]))
    assert found.mean == pytest.approx(10 / 12)
    assert (found.low, found.high) == (0.0, 1.0)
    assert found.n == 3


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_turning_the_runs_round_turns_the_interval_round(seed):
    before, after = scores(seed, count=20, gain=0.3)
    there, back = (paired_bootstrap(*runs, rounds=200, seed=1) for runs in ((before, after), (after, before)))
    assert (back.mean, back.low, back.high) == pytest.approx((-there.mean, -there.high, -there.low))


def test_more_prompts_than_are_drawn_at_once_have_the_same_kind_of_interval():
    before, after = scores(6, count=30_000, gain=0.1)
    found = paired_bootstrap(before, after, rounds=200, seed=1)  # three chunks of 66 rounds, and a short one
    half = 1.96 * (after - before).std() / np.sqrt(30_000)
    assert (found.high - found.low) / 2 == pytest.approx(half, rel=0.25)
    assert found.better


# -- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: repeated([1.0]), "values: 1 is too few"),
        (lambda: repeated([1.0, np.nan]), "values, row 1"),
        (lambda: repeated([[1.0, 2.0]]), "values: has the shape"),
        (lambda: redraw(lambda rng: 0, repeats=0, seed=1), "repeats: 0 is too few"),
        (lambda: paired_bootstrap(np.ones(4), np.ones(5), seed=1), "4 and 5 scores"),
        (lambda: paired_bootstrap(np.ones(4), np.array([1, 1, np.inf, 1]), seed=1), "after, row 2"),
        (lambda: paired_bootstrap(np.ones((4, 2)), np.ones((4, 2)), seed=1), "before: has the shape"),
        (lambda: paired_bootstrap(np.ones(4), np.ones(4), seed=1, groups=np.zeros(4, int)), "prompts: 1 is too few"),
        (lambda: paired_bootstrap(np.ones(4), np.ones(4), seed=1, groups=np.zeros(3, int)), "groups: has the shape"),
        (lambda: paired_bootstrap(np.ones(4), np.ones(4), seed=1, rounds=10), "rounds: 10 is too few"),
    ],
)
def test_what_has_no_interval_is_refused(call, message):
    with pytest.raises(InvalidInput, match=message):
        call()
