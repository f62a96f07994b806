"""Retrieval between text and motion: R-precision, all-pairs ranks, distance and cosine of matched pairs.

Rows of `text` and `motion` are pairs. The public T2M evaluator returns both sorted by motion length; a caller that
sorts one must sort the other, and the labels, in the same way.

Sources: Guo et al. 2022 (T2M; pools of 32, Euclidean), SnapMoGen 2025 appendix B.2 (pools of 100; its released code
draws them as shuffled batches too, and ranks by cosine), Petrovich et al. 2023 (TMR; all pairs, same-label hits).

Ties count as their expectation under random order: of t candidates at the match's distance (itself included) with n
nearer ones, the match is among the first k with probability clip((k - n) / t, 0, 1). An evaluator that gives all inputs
one embedding scores chance, k / pool, where a stable sort would score 1 or depend on the row order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from marey.core.errors import InvalidInput
from marey.evaluator.metrics.pools import draw_distinct_pools, draw_pools
from marey.measures.inputs import Array, Integers, Numbers, integers, pairs

Distance = Literal["euclidean", "cosine"]
ALL_TOP = (1, 2, 3, 5, 10)
_TIE = 1e-12  # of the squared norms: float64 rounds at 1e-15 of them, float32 embeddings differ by 1e-7 or not at all
_ROWS = 512  # of the all-pairs matrix at a time: 16 MB for 4,000 clips


@dataclass(frozen=True, eq=False)
class RPrecision:
    """R-precision: how often the match is among the first k of its pool.

    Attributes:
        top: the k of each column of `hits`.
        clips: (used,) row of each query in the input, without those of an incomplete pool.
        hits: (used, len(top)) 1 if the match is in the first k, 0 if not, between them on ties. Two runs
            that draw with the same seed have the same `clips`, so their `hits` are paired, for `paired_bootstrap`.
    """

    top: tuple[int, ...]
    clips: Integers
    hits: Array

    def at(self, k: int) -> float:
        """Return R@k, 0 to 1: hits divided by the number of queries."""
        return float(self.hits[:, self.top.index(k)].mean())


@dataclass(frozen=True)
class Ranks:
    """Retrieval from all candidates in one direction.

    Attributes:
        recall: by k, the share (0 to 1) of queries whose match is in the first k.
        median: rank of the best match, 1 is first; a tie has its expected rank.
    """

    recall: dict[int, float]
    median: float


@dataclass(frozen=True)
class AllRanks:
    """Ranks of TMR's "all" protocol in both directions."""

    text_to_motion: Ranks
    motion_to_text: Ranks


@dataclass(frozen=True, eq=False)
class _Standing:
    """Rank of each query's best match: candidates `nearer`, those `tied` with it, and the `matches` in the tie."""

    nearer: Integers
    tied: Integers
    matches: Integers


def r_precision(
    text: Numbers,
    motion: Numbers,
    *,
    pool: int,
    top: Sequence[int] = (1, 2, 3),
    distance: Distance = "euclidean",
    labels: Numbers | None = None,
    distinct_pools: bool = False,
    rng: np.random.Generator,
) -> RPrecision:
    """Compute R-precision, text to motion, within randomly drawn pools.

    T2M is `pool=32, distance="euclidean"`; SnapMoGen is `pool=100, distance="cosine"`.

    Args:
        text: (N, D) embeddings.
        motion: (N, D) embeddings in the same space, row by row the matches of `text`.
        pool: candidates of a query, its match included. The last, incomplete pool is dropped.
        top: each k, 1 or more and under `pool`.
        distance: distance by which candidates are ranked.
        labels: (N,) integers; a candidate of the query's label is a match too (TMR's threshold protocol).
        distinct_pools: draw with `draw_distinct_pools`, so that no pool holds a label twice.

    Raises:
        InvalidInput: broken or unpaired embeddings, fewer pairs than a pool, distinct pools without enough labels,
            a k that always hits, a zero vector under cosine.
    """
    text, motion = pairs(text, motion)
    ks = _checked_top(top, pool)
    groups = _groups(labels, len(text))
    if distinct_pools and labels is None:
        raise InvalidInput("distinct pools need labels", where="labels", hint="give (N,) integers")
    drawn = draw_distinct_pools(groups, pool, rng) if distinct_pools else draw_pools(len(text), pool, rng)
    text, motion = _comparable(text, motion, distance)
    hits = [_hits(_standing(text[m], motion[m], groups[m], groups[m]), ks) for m in drawn]
    return RPrecision(ks, drawn.ravel(), np.concatenate(hits))


def label_ceiling(
    labels: Numbers, *, pool: int, top: Sequence[int] = (1, 2, 3), rng: np.random.Generator
) -> RPrecision:
    """Return the R-precision of an oracle that knows every label and nothing else, in pools where only the pair is a
    match.

    The oracle cannot distinguish clips of one label, so among c of them in a pool it finds the match in k tries with
    probability min(k / c, 1). With the same `rng` the pools are those of `r_precision`.

    Args:
        labels: (N,) integers.
        pool: candidates of a query.
        top: each k, under `pool`.

    Raises:
        InvalidInput: labels that are not (N,) integers, fewer than a pool, a k that always hits.
    """
    groups = integers("labels", labels)
    ks = _checked_top(top, pool)
    drawn = draw_pools(len(groups), pool, rng)
    members = groups[drawn]  # (pools, pool)
    alike = (members[:, :, None] == members[:, None]).sum(axis=2).ravel()
    standing = _Standing(np.zeros_like(alike), alike, np.ones_like(alike))
    return RPrecision(ks, drawn.ravel(), _hits(standing, ks))


def all_ranks(
    text: Numbers, motion: Numbers, *, distance: Distance = "cosine", labels: Numbers | None = None
) -> AllRanks:
    """Rank every text against every motion, and back: R@1, 2, 3, 5, 10 and the median rank (TMR's "all" protocol).

    Args:
        text: (N, D) embeddings, more than 10.
        motion: (N, D) embeddings in the same space, row by row the matches of `text`.
        distance: distance by which candidates are ranked.
        labels: (N,) integers; a candidate of the query's label is a match too, and the best of them has the rank
            (TMR's threshold protocol).

    Raises:
        InvalidInput: broken or unpaired embeddings, 10 pairs or fewer, a zero vector under cosine.
    """
    text, motion = pairs(text, motion)
    groups = _groups(labels, len(text))
    _checked_top(ALL_TOP, len(text))
    text, motion = _comparable(text, motion, distance)
    return AllRanks(_ranks(text, motion, groups), _ranks(motion, text, groups))


def matching_score(text: Numbers, motion: Numbers) -> float:
    """Return MM-Dist (Guo et al. 2022): mean Euclidean distance of the pairs of (N, D) text and motion; lower is
    better.

    Raises:
        InvalidInput: broken or unpaired embeddings.
    """
    text, motion = pairs(text, motion)
    return float(np.linalg.norm(text - motion, axis=1).mean())


def clip_score(text: Numbers, motion: Numbers) -> float:
    """Return the mean cosine of the pairs of (N, D) text and motion in the evaluator's own joint space, -1 to 1.

    This is SnapMoGen's "CLIP score" (section 5: "the cosine similarity between text and motion features"). It uses no
    CLIP network, so scores of different evaluators are different quantities.

    Raises:
        InvalidInput: broken or unpaired embeddings, a zero vector.
    """
    text, motion = pairs(text, motion)
    return float((_unit("text", text) * _unit("motion", motion)).sum(axis=1).mean())


def _checked_top(top: Sequence[int], candidates: int) -> tuple[int, ...]:
    if not top or min(top) < 1 or max(top) >= candidates:
        raise InvalidInput(
            f"{tuple(top)} of {candidates} candidates",
            where="top",
            hint="each k is 1 or more and under the number of candidates: the first k of k always hold the match",
        )
    return tuple(top)


def _groups(labels: Numbers | None, count: int) -> Integers:
    """Return labels, or without any, each pair as a label of its own."""
    return np.arange(count) if labels is None else integers("labels", labels, count=count)


def _comparable(text: Array, motion: Array, distance: Distance) -> tuple[Array, Array]:
    """Return vectors whose Euclidean distances have the requested order: for unit vectors it is that of the cosine."""
    if distance not in get_args(Distance):
        known = ", ".join(get_args(Distance))
        raise InvalidInput(f"unknown distance {distance!r}", where="distance", hint=f"Known: {known}.")
    if distance == "cosine":
        return _unit("text", text), _unit("motion", motion)
    # |a|² + |b|² - 2ab cancels if the vectors are long compared with their differences; a shift keeps distances
    middle = (text.mean(axis=0) + motion.mean(axis=0)) / 2
    return text - middle, motion - middle


def _unit(name: str, vectors: Array) -> Array:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    zero = np.flatnonzero(lengths == 0)
    if zero.size:
        raise InvalidInput(
            "a zero vector has no cosine",
            where=f"{name}, row {zero[0]}",
            hint="check the network that produced it",
        )
    return vectors / lengths


def _standing(queries: Array, candidates: Array, labels: Integers, among: Integers) -> _Standing:
    """Return the ranks of each query (n, D) of `labels` (n,) among candidates (m, D) of labels `among` (m,)."""
    scale = (queries**2).sum(axis=1)[:, None] + (candidates**2).sum(axis=1)  # (n, m)
    distances = scale - 2 * queries @ candidates.T
    match = labels[:, None] == among
    best = np.where(match, distances, np.inf).min(axis=1, keepdims=True)
    tied = np.abs(distances - best) <= _TIE * scale
    nearer = (distances < best) & ~tied
    return _Standing(nearer.sum(axis=1), tied.sum(axis=1), (tied & match).sum(axis=1))


def _hits(standing: _Standing, top: tuple[int, ...]) -> Array:
    """Return the probability (n, len(top)) that a match is in the first k, ties in random order."""
    miss = np.ones(len(standing.nearer))
    hits = []
    for place in range(max(top)):
        before = place - standing.nearer  # tied ones before this place
        left = standing.tied - before
        other = np.maximum(left - standing.matches, 0) / np.maximum(left, 1)  # no match here, given none before
        miss = np.where((before >= 0) & (left > 0), miss * other, miss)
        hits.append(1 - miss)
    return np.stack([hits[k - 1] for k in top], axis=1)


def _ranks(queries: Array, candidates: Array, labels: Integers) -> Ranks:
    hits, ranks = [], []
    for begin in range(0, len(queries), _ROWS):
        rows = slice(begin, begin + _ROWS)
        standing = _standing(queries[rows], candidates, labels[rows], labels)
        hits.append(_hits(standing, ALL_TOP))
        # the first of m matches among t in random order is expected at (t + 1) / (m + 1)
        ranks.append(standing.nearer + (standing.tied + 1) / (standing.matches + 1))
    shares = np.concatenate(hits).mean(axis=0)
    recall = {k: float(share) for k, share in zip(ALL_TOP, shares, strict=True)}
    return Ranks(recall, float(np.median(np.concatenate(ranks))))
