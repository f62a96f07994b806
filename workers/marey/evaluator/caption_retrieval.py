"""Retrieval between the captions and the motions of a split, in the protocols that a bundle reports."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.evaluator.metrics.retrieval import ALL_TOP, Distance, all_ranks, r_precision

POOL = 32
TOP = (1, 2, 3)
REPEATS = 20
"""Number of new draws of captions and pools, as in the public protocol; the mean is reported."""


@dataclass(frozen=True)
class EmbeddedSplit:
    """Embeddings of N clips and their K captions."""

    motion: NDArray[np.float32]  # (N, E)
    text: NDArray[np.float32]  # (K, E), clip by clip
    counts: NDArray[np.int64]  # (N,) captions of each clip, at least one
    labels: NDArray[np.int64]  # (N,)

    def drawn(self, rng: np.random.Generator) -> NDArray[np.float32]:
        """Return embeddings (N, E) of one caption of each clip."""
        first = np.concatenate([[0], np.cumsum(self.counts)[:-1]])
        return self.text[first + np.floor(rng.random(len(self.counts)) * self.counts).astype(np.int64)]


def retrieval_scores(split: EmbeddedSplit, distance: Distance) -> dict[str, float]:
    """Compute R-precision and median ranks, text to motion unless stated.

    `pair_r1` … `pair_r3`: pools of 32, the pair alone is a hit, as in T2M. `label_r1` …: the same pools, a motion of
    the text's own label is a hit. `distinct_r1` …: pools in which no label occurs twice. `median_rank`,
    `median_rank_back`: among all N, only the pair is a hit (TMR's "all" protocol), and from motion to text. Metrics
    that need a larger split are left out: 32 clips, 32 labels, 11 clips.
    """
    rng = np.random.default_rng(0)
    clips, labels = len(split.labels), split.labels
    found: list[dict[str, float]] = []
    for _ in range(REPEATS):
        text, each = split.drawn(rng), {}
        if clips >= POOL:
            for name, groups, same in (("pair", None, copy.deepcopy(rng)), ("label", labels, rng)):
                hits = r_precision(text, split.motion, pool=POOL, top=TOP, distance=distance, labels=groups, rng=same)
                each |= {f"{name}_r{k}": hits.at(k) for k in TOP}
        if len(np.unique(labels)) >= POOL:
            hits = r_precision(
                text, split.motion, pool=POOL, top=TOP, distance=distance, labels=labels, distinct_pools=True, rng=rng
            )
            each |= {f"distinct_r{k}": hits.at(k) for k in TOP}
        if clips > max(ALL_TOP):
            ranks = all_ranks(text, split.motion, distance=distance)
            each |= {"median_rank": ranks.text_to_motion.median, "median_rank_back": ranks.motion_to_text.median}
        found.append(each)
    return {name: float(np.mean([each[name] for each in found])) for name in found[0]}
