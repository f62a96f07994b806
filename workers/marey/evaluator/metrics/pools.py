"""Retrieval pools: candidate sets drawn by a seeded generator.

The public T2M evaluator takes the batches of a shuffled loader that drops the last one as its pools, and SnapMoGen's
released code does the same with batches of 100.
"""

from __future__ import annotations

import numpy as np

from marey.measures.inputs import Integers, Numbers, at_least, integers

_LONE = "a match alone in its pool is always found"


def draw_pools(count: int, pool: int, rng: np.random.Generator) -> Integers:
    """Return row numbers (pools, pool): all rows shuffled and cut, the incomplete rest dropped.

    Raises:
        InvalidInput: fewer rows than a pool.
    """
    at_least("pool", pool, 2, hint=_LONE)
    at_least("pairs", count, pool, hint="give more pairs or take a smaller pool")
    return rng.permutation(count)[: count // pool * pool].reshape(-1, pool)


def draw_distinct_pools(labels: Numbers, pool: int, rng: np.random.Generator) -> Integers:
    """Return row numbers (pools, pool): as many disjoint pools as possible in which no label occurs twice.

    P pools take at most P rows of one label, so P is the largest for which the labels, each cut to P rows, still fill
    them. Surplus rows are dropped at random.

    Args:
        labels: (N,) integers.

    Raises:
        InvalidInput: fewer labels than a pool.
    """
    groups = integers("labels", labels)
    at_least("pool", pool, 2, hint=_LONE)
    _, group, sizes = np.unique(groups, return_inverse=True, return_counts=True)
    at_least("distinct labels", len(sizes), pool, hint="give clips of more labels or take a smaller pool")
    pools = max(p for p in range(1, len(groups) // pool + 1) if np.minimum(sizes, p).sum() >= p * pool)
    shuffled = rng.permutation(len(groups))
    turn = rng.permutation(len(sizes))[group]  # of a row: rank of its label
    dealt = shuffled[np.argsort(turn[shuffled], kind="stable")]  # label by label, its rows in random order
    _, begins, runs = np.unique(turn[dealt], return_index=True, return_counts=True)
    kept = dealt[np.arange(len(dealt)) - np.repeat(begins, runs) < pools]
    # Rows go to the pools in turn, so the up to `pools` adjacent rows of one label fall into different pools.
    return kept[: pools * pool].reshape(pool, pools).T
