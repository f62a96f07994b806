"""The evaluator's metrics on 4,000 embeddings of 256: seconds for 20 repeats, and the largest memory held.

The bar is 60 s and 2 GB on two cores for all of them together. The baseline of FID is the public evaluator's way: the
root of the product of the covariances by `scipy.linalg.sqrtm`.

    OMP_NUM_THREADS=2 python -m benchmarks metrics
"""

from __future__ import annotations

import resource
from functools import partial

import numpy as np
from scipy.linalg import sqrtm

from benchmarks.harness import measure, table
from marey.evaluator.metrics.distribution import GaussianStatistics, diversity, fid, kid, multimodality
from marey.evaluator.metrics.intervals import redraw
from marey.evaluator.metrics.retrieval import all_ranks, matching_score, r_precision
from marey.measures.bootstrap import paired_bootstrap
from marey.measures.inputs import Array

CLIPS = 4000
DIMENSIONS = 256


def embedded() -> tuple[Array, Array, Array]:
    """Text, real motion and generated motion (N, D) with correlated dimensions."""
    rng = np.random.default_rng(0)
    text = rng.normal(size=(CLIPS, DIMENSIONS)) @ rng.normal(size=(DIMENSIONS, DIMENSIONS)) / 16
    real, generated = (text + rng.normal(size=text.shape) for _ in range(2))
    return text, real, generated


def public_fid(real: Array, generated: Array) -> float:
    """The baseline."""
    one, two = (np.cov(x, rowvar=False) for x in (real, generated))
    apart = real.mean(axis=0) - generated.mean(axis=0)
    return float(apart @ apart + np.trace(one + two - 2 * sqrtm(one @ two).real))


def main() -> None:
    """Print the tables."""
    text, real, generated = embedded()
    known = GaussianStatistics.of(real)
    repeated = {
        "R-precision, pools of 32": lambda rng: r_precision(text, generated, pool=32, rng=rng),
        "R-precision, pools of 100, cosine": lambda rng: r_precision(
            text, generated, pool=100, distance="cosine", rng=rng
        ),
        "MM-Dist": lambda rng: matching_score(text, generated),
        "diversity": lambda rng: diversity(generated, rng=rng),
        "FID": lambda rng: fid(known, generated),
        "KID, 50 subsets of 500": lambda rng: kid(real, generated, subsets=50, subset_size=500, rng=rng),
    }
    timings = measure(
        {name: partial(redraw, metric, repeats=20, seed=1) for name, metric in repeated.items()},
        repeats=3,
        warm_up=1,
    )
    total = sum(t.median for t in timings)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    note = f"all together: {total:.1f} s (60 allowed); largest memory held: {peak:.0f} MB (2,048 allowed)"
    print(table(f"20 repeats on {CLIPS:,} embeddings of {DIMENSIONS}", timings, note=note))
    generations = generated[:3000].reshape(100, 30, DIMENSIONS)
    scores = text[:, 0] > 0, generated[:, 0] > 0
    once = measure(
        {
            "all pairs, both directions": lambda: all_ranks(text, generated),
            "multimodality of 100 prompts": lambda: multimodality(generations, rng=np.random.default_rng(0)),
            "paired bootstrap, 10,000 rounds": lambda: paired_bootstrap(*scores, seed=0),
        },
        repeats=3,
        warm_up=1,
    )
    print(table("Once", once))
    ways = {"fid": lambda: fid(real, generated).value, "sqrtm": lambda: public_fid(real, generated)}
    apart = abs(ways["fid"]() / ways["sqrtm"]() - 1)
    note = f"the two differ by {apart:.0e} of their value"
    print(table("FID", measure(ways, repeats=5, warm_up=1), baseline="sqrtm", note=note))
