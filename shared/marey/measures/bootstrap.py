"""Paired bootstrap of the difference between two runs on the same prompts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marey.core.errors import InvalidInput
from marey.measures.inputs import Array, Numbers, at_least, embeddings, integers

_AT_ONCE = 2_000_000  # draws in memory: under 64 MB with their values


@dataclass(frozen=True)
class Difference:
    """Difference between two runs on the same prompts; higher scores are better.

    Attributes:
        mean: of after - before.
        low: 2.5 % percentile of the resampled means.
        high: 97.5 % percentile.
        n: prompts (groups) that were resampled.
    """

    mean: float
    low: float
    high: float
    n: int

    @property
    def worse(self) -> bool:
        """True if the whole interval is below 0."""
        return self.high < 0

    @property
    def better(self) -> bool:
        """True if the whole interval is above 0."""
        return self.low > 0


def paired_bootstrap(
    before: Numbers, after: Numbers, *, rounds: int = 10_000, seed: int, groups: Numbers | None = None
) -> Difference:
    """Percentile bootstrap of the mean difference of two runs (Efron and Tibshirani 1993, sections 8.4 and 13.3).

    Args:
        before: (n,) scores of the first run, higher is better.
        after: (n,) scores of the second run on the same prompts, paired by position.
        rounds: resamples.
        groups: (n,) integers, the prompt of each score: several seeds of one prompt are alike, and resampled
            together. Without them each score is its own group.

    Raises:
        InvalidInput: scores that are not finite or not paired, or a single prompt.
    """
    first, second = embeddings("before", before, axes="n"), embeddings("after", after, axes="n")
    if first.shape != second.shape:
        raise InvalidInput(
            f"{len(first)} and {len(second)} scores",
            where="before, after",
            hint="give one score of each run for each prompt and seed, in the same order",
        )
    differences = second - first
    prompts = np.arange(len(first)) if groups is None else integers("groups", groups, count=len(first))
    _, group, sizes = np.unique(prompts, return_inverse=True, return_counts=True)
    at_least("prompts", len(sizes), 2, hint="one prompt cannot be resampled")
    at_least("rounds", rounds, 100, hint="2.5 % percentiles need at least 100 resamples")
    sums = np.bincount(group, differences).astype(np.float64)
    low, high = np.percentile(_resampled_means(sums, sizes, rounds, np.random.default_rng(seed)), [2.5, 97.5])
    return Difference(float(differences.mean()), float(low), float(high), len(sizes))


def _resampled_means(sums: Array, sizes: Numbers, rounds: int, rng: np.random.Generator) -> Array:
    """Return means (rounds,) of as many groups as there are, drawn with replacement; `sums` (G,) and `sizes` (G,) of
    each."""
    means = np.empty(rounds)
    chunk = max(1, _AT_ONCE // len(sums))
    for begin in range(0, rounds, chunk):
        drawn = rng.integers(0, len(sums), (min(chunk, rounds - begin), len(sums)))
        means[begin : begin + chunk] = sums[drawn].sum(axis=1) / sizes[drawn].sum(axis=1)
    return means
