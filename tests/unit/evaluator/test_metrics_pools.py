"""Pools whose labels are distinct."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.evaluator.metrics.pools import draw_distinct_pools, draw_pools


@settings(deadline=None)
@given(st.lists(st.integers(1, 9), min_size=4, max_size=12), st.integers(2, 4), st.integers(0, 2**32 - 1))
def test_no_pool_holds_a_label_twice_and_no_row_is_drawn_twice(sizes, pool, seed):
    labels = np.repeat(np.arange(len(sizes)) * 5 - 7, sizes)
    rng = np.random.default_rng(seed)
    rng.shuffle(labels)
    drawn = draw_distinct_pools(labels, pool, rng)
    assert drawn.shape[1] == pool
    assert len(set(drawn.ravel().tolist())) == drawn.size
    assert all(len(set(row)) == pool for row in labels[drawn].tolist())
    # one pool more has not enough rows, at one row a label and pool
    more = len(drawn) + 1
    assert sum(min(size, more) for size in sizes) < more * pool


def test_all_rows_are_used_where_labels_are_as_many_each():
    labels = np.repeat(np.arange(32), 6)
    drawn = draw_distinct_pools(labels, 32, np.random.default_rng(0))
    assert sorted(drawn.ravel()) == list(range(192))


def test_every_clip_of_a_label_is_as_likely():
    labels = np.array([0] * 20 + [1, 1, 2, 2, 3, 3])  # label 0 has far more clips than there are pools
    rng = np.random.default_rng(4)
    counts = np.zeros(26)
    for _ in range(2000):
        counts[draw_distinct_pools(labels, 3, rng)] += 1
    assert counts[:20].max() / counts[:20].min() < 1.5
    assert counts[20:].max() / counts[20:].min() < 1.1


def test_labels_meet_others_from_draw_to_draw():
    labels = np.repeat(np.arange(64), 2)
    rng = np.random.default_rng(4)
    beside = {tuple(sorted(labels[draw_distinct_pools(labels, 32, rng)[0]])) for _ in range(20)}
    assert len(beside) == 20


@pytest.mark.parametrize("pool", [-1, 0, 1])
def test_a_pool_of_the_match_alone_is_refused(pool):
    rng = np.random.default_rng(0)
    with pytest.raises(InvalidInput, match="always found"):
        draw_pools(10, pool, rng)
    with pytest.raises(InvalidInput, match="always found"):
        draw_distinct_pools(np.arange(10), pool, rng)
