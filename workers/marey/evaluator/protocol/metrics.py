"""Metrics of one repeat (Guo et al. 2022; sizes of the public evaluation in momask-codes, utils/eval_t2m.py)."""

from __future__ import annotations

import numpy as np

from marey.evaluator.metrics.distribution import diversity, fid, multimodality
from marey.evaluator.metrics.retrieval import Distance, clip_score, matching_score, r_precision
from marey.evaluator.port import Embeddings

TOP = (1, 2, 3)
RETRIEVAL = tuple(f"r{k}" for k in TOP)
METRICS = (*RETRIEVAL, "fid", "mm_dist", "clip_score", "diversity", "mmodality")
"""In the order of the papers' tables; `clip_score` for evaluators that compare by cosine alone."""
PAIRS = 300
"""Pairs of motions of the diversity; 100 of up to 300 motions, as published, and fewer of under 101."""
FEW = 100


def measure(
    text: Embeddings,
    motion: Embeddings,
    real: Embeddings | None,
    *,
    pool: int,
    distance: Distance,
    rng: np.random.Generator,
) -> dict[str, float]:
    """Measure motions against their captions and against real motions.

    Args:
        text: (N, E) of the captions.
        motion: (N, E) of the motions, row by row.
        real: (N, E) of the real motions; None = these are real, and have no distance from themselves.
        pool: candidates of a retrieval; the pair alone is a hit.
        distance: of the evaluator's space.
        rng: for pools and pairs.
    """
    hits = r_precision(text, motion, pool=pool, top=TOP, distance=distance, rng=rng)
    found = {name: hits.at(k) for name, k in zip(RETRIEVAL, TOP, strict=True)}
    if real is not None:
        found["fid"] = fid(real, motion).value
    if distance == "cosine":
        found["clip_score"] = clip_score(text, motion)
    drawn = PAIRS if len(motion) > FEW else len(motion) - 1
    return found | {"mm_dist": matching_score(text, motion), "diversity": diversity(motion, pairs=drawn, rng=rng)}


def measure_variety(motion: Embeddings, many: int, pairs: int, rng: np.random.Generator) -> float:
    """Return the MModality of (P · K, E): `many` (K) motions of each of P captions, caption by caption."""
    return multimodality(motion.reshape(-1, many, motion.shape[1]), pairs=pairs, rng=rng)
