"""Compute the rows of a report from measured motions: retrieval, distances of distributions, prompt checks, quality.

Repeat k of 20 takes repeat k mod R of each prompt, of R that were generated, and draws pools, pairs and subsets anew
from the evaluation's seed: with R = 1 an interval shows the variance of the draws, not of another generation.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from marey.checks.quality import Quality
from marey.core.errors import InvalidInput
from marey.evaluations import COMPOSITIONAL
from marey.evaluator.measuring import EvaluatedMotions
from marey.evaluator.metrics import distribution
from marey.evaluator.metrics.distribution import GaussianStatistics, diversity, fid, kid
from marey.evaluator.metrics.intervals import redraw, repeated
from marey.evaluator.metrics.retrieval import (
    RPrecision,
    clip_score,
    label_ceiling,
    matching_score,
    r_precision,
)
from marey.evaluator.port import Embeddings, Evaluator, ProgressCallback, no_progress
from marey.evaluator.report import Metric, Value
from marey.measures.comparing import OBEYED

REPEATS = 20
POOLS = (32, 100)
"""Pools of T2M and of SnapMoGen."""
TOP = (1, 2, 3)
KID_SUBSETS, KID_SIZE = 50, 100
PAIRS_OF_A_PROMPT = 10
COMPOSITIONAL_COLUMNS = (OBEYED, *(f"r_precision_{k}_of_{POOLS[0]}" for k in TOP), "clip_score", "kid")
"""Metrics with columns of their own for the compositional split: those that 342 motions can support."""
EMBEDDED = ("clip_score", "mm_dist", "diversity", "fid", "kid")
"""Measures of embeddings besides R-precision."""
JOINTS = "joints, without a network"
QUALITY = {"skate": 100.0, "jerk": 1.0, "bone_drift": 1000.0, "penetration": 1000.0}
"""Numbers of `Quality`, and their factors to the printed unit: per cent, m/s³, mm, mm."""


@dataclass(frozen=True, eq=False)
class PoolDraw:
    """Retrieval of one repeat, twice in the same pools."""

    rows: NDArray[np.int64]  # of the repeat, in the set
    pair: RPrecision  # the prompt's own motion alone is a hit (Guo et al. 2022)
    label: RPrecision  # every motion of the prompt's label is


@dataclass(frozen=True, eq=False)
class EmbeddedSet:
    """Embeddings of one row: N motions with their prompts, R repeats of each."""

    motion: Embeddings  # (N, E)
    text: Embeddings  # (N, E)
    labels: NDArray[np.int64]  # (N,): motions of one label answer each other's prompts
    variants: NDArray[np.int64]  # (N,): the repeat that each was generated in
    progress: ProgressCallback = no_progress
    single: NDArray[np.bool_] | None = None  # (N,): motions with embeddings, those of one prompt; None = all
    _pools: dict[tuple[int, int], list[PoolDraw]] = field(
        default_factory=dict[tuple[int, int], list[PoolDraw]], repr=False
    )

    def only(self, rows: NDArray[np.bool_]) -> EmbeddedSet:
        """Return a subset of the motions."""
        return EmbeddedSet(self.motion[rows], self.text[rows], self.labels[rows], self.variants[rows], self.progress)

    def embedded(self) -> EmbeddedSet:
        """Return the motions with embeddings."""
        return self if self.single is None or self.single.all() else self.only(self.single)

    def repeats(self, seed: int) -> Iterator[tuple[NDArray[np.int64], np.random.Generator]]:
        """Return for each of the 20 repeats its rows and its random generator."""
        generated = repeats_of(self.variants)
        for number, rng in enumerate(redraw(lambda rng: rng, repeats=REPEATS, seed=seed)):
            yield np.flatnonzero(self.variants == number % generated), rng
            self.progress()

    def pools(self, evaluator: Evaluator, pool: int, seed: int) -> list[PoolDraw]:
        """Return for each repeat the retrieval among its rows; drawn once and cached.

        Raises:
            InvalidInput: fewer motions than a pool.
        """
        if (pool, seed) not in self._pools:
            self._pools[pool, seed] = [self._retrieved(evaluator, pool, rows, rng) for rows, rng in self.repeats(seed)]
        return self._pools[pool, seed]

    def _retrieved(
        self, evaluator: Evaluator, pool: int, rows: NDArray[np.int64], rng: np.random.Generator
    ) -> PoolDraw:
        pair, label = (
            r_precision(
                self.text[rows], self.motion[rows], pool=pool, top=TOP, distance=evaluator.distance, labels=labels,
                rng=same,
            )
            for labels, same in ((None, copy.deepcopy(rng)), (self.labels[rows], rng))
        )  # fmt: skip
        return PoolDraw(rows, pair, label)


def repeats_of(variants: NDArray[np.int64]) -> int:
    """Return the number of generated repeats of motions whose repeats are `variants` (N,)."""
    return int(variants.max(initial=0)) + 1


def metrics_of(evaluator: Evaluator, splits: Sequence[str]) -> tuple[Metric, ...]:
    """Return the columns in order: of all motions, then again of the compositional split alone if it is one of several.

    Args:
        evaluator: embeds the motions.
        splits: splits whose real motions distances refer to.
    """
    by, those = evaluator.name, f"the real motions of the split {' and '.join(splits)}"
    nearest = "How often {} is among the {} nearest of {}."
    pools = [
        Metric(key(pool, k), f"{title} {k} of {pool}", "%", "higher", 1, nearest.format(hit, k, pool), by)
        for key, title, hit in (
            (_pair_key, "R-precision", "the prompt's own motion"),
            (_key, "Same-label R-precision", "a motion of the prompt's content"),
        )
        for pool in POOLS
        for k in TOP
    ]
    whole = (
        Metric(
            OBEYED, "Prompt adherence", "%", "higher", 1, "Motions that show their prompt's actions, in order.", JOINTS
        ),
        *pools,
        Metric("clip_score", "CLIP score", "", "higher", 3, "Mean cosine of prompt and motion.", by),
        Metric("mm_dist", "MM-Dist", "", "lower", 3, "Mean Euclidean distance of prompt and motion.", by),
        Metric("fid", "FID", "", "lower", 4, f"Fréchet distance to {those}.", by),
        Metric("kid", "KID", "", "lower", 5, f"Kernel distance to {those}, unbiased where there are few.", by),
        Metric("diversity", "Diversity", "", "", 3, "Mean distance of random pairs; best as the real motions'.", by),
        Metric("multimodality", "MultiModality", "", "", 3, "Mean distance of motions of one prompt.", by),
        Metric("skate", "Foot skate", "%", "lower", 2, "Frames with a toe on the floor that slides.", JOINTS),
        Metric("jerk", "Jerk", "m/s³", "lower", 1, "Mean third derivative of the joints.", JOINTS),
        Metric("bone_drift", "Bone drift", "mm", "lower", 3, "How far bones leave their median length.", JOINTS),
        Metric("penetration", "Floor penetration", "mm", "lower", 1, "Deepest joint under the floor.", JOINTS),
        Metric("flagged", "Flagged", "%", "lower", 1, "Motions whose quality record has a flag.", JOINTS),
    )
    if len(splits) < 2 or COMPOSITIONAL not in splits:
        return whole
    columns = (metric for metric in whole if metric.key in COMPOSITIONAL_COLUMNS)
    return (
        *whole,
        *(replace(m, key=_compositional_key(m.key), measured_on="the compositional split") for m in columns),
    )


def compositional(values: Mapping[str, Value]) -> dict[str, Value]:
    """Return the values of the compositional split alone, under the keys of its own columns."""
    return {_compositional_key(key): value for key, value in values.items() if key in COMPOSITIONAL_COLUMNS}


def embedded(embeddings: EmbeddedSet, real: Embeddings | None, evaluator: Evaluator, seed: int) -> dict[str, Value]:
    """Return all values that come from embeddings; with `real` (M, E) None, without distances to real motions."""
    found: dict[str, Value] = {}
    embeddings = embeddings.embedded()
    if not len(embeddings.motion):
        keys = [key for pool in POOLS for key in keys_of(pool)]
        return dict.fromkeys([*keys, *EMBEDDED], Value.missing("every motion is a timeline, which has no embedding"))
    for pool in POOLS:
        found |= retrieval(embeddings, evaluator, pool, seed)
    pairs = {"clip_score": clip_score, "mm_dist": matching_score}
    for name, metric in pairs.items():
        found[name] = _drawn(
            embeddings,
            seed,
            lambda rows, rng, metric=metric: metric(embeddings.text[rows], embeddings.motion[rows]),
        )
    found["diversity"] = _drawn(embeddings, seed, lambda rows, rng: diversity(embeddings.motion[rows], rng=rng))
    if real is not None:
        found |= _distances(embeddings, real, seed)
    return found


def multimodality(measured: EvaluatedMotions, seed: int) -> Value:
    """Return MultiModality of the exported motions, over prompts with all repeats."""
    repeats = repeats_of(measured.variants)
    if repeats <= PAIRS_OF_A_PROMPT:
        return Value.missing(f"needs more than {PAIRS_OF_A_PROMPT} motions per prompt; there are {repeats}")
    _, counts = np.unique(measured.indices[measured.single], return_counts=True)
    exported = measured.exported[measured.single]
    whole = exported[np.repeat(counts == repeats, counts)].reshape(-1, repeats, exported.shape[1])
    if not len(whole):
        return Value.missing("no prompt has all of its motions")
    drawn = redraw(
        lambda rng: distribution.multimodality(whole, pairs=PAIRS_OF_A_PROMPT, rng=rng), repeats=REPEATS, seed=seed
    )
    return _interval(drawn, len(whole) * repeats)


def flagged(measured: EvaluatedMotions) -> Value:
    """Return the share of the delivered motions whose quality record has a flag."""
    known = np.array([motion.flags is not None for motion in measured.motions], bool)
    numbers = np.array([100.0 * bool(motion.flags) for motion in measured.motions])
    return _over_repeats(measured.variants, numbers, known, "no motion has a quality record")


def on_joints(found: Sequence[tuple[bool | None, Quality]], variants: NDArray[np.int64]) -> dict[str, Value]:
    """Return all values that come from joints alone; their intervals are over the generated repeats.

    Args:
        found: verdict (None = no expectation) and quality of N motions.
        variants: (N,) repeat of each motion.
    """
    checked = np.array([obeyed is not None for obeyed, _ in found], bool)
    passed = np.array([100.0 * bool(obeyed) for obeyed, _ in found])
    values = {OBEYED: _over_repeats(variants, passed, checked, "no prompt has an expectation")}
    for name, factor in QUALITY.items():
        numbers = np.array([factor * getattr(quality, name) for _, quality in found])
        values[name] = _over_repeats(variants, numbers, np.ones(len(numbers), bool), "there is no motion")
    return values


def retrieved(embeddings: EmbeddedSet, evaluator: Evaluator, seed: int) -> NDArray[np.float64]:
    """Return the share (N,) of draws in which a motion of its label was among the three nearest of its pool of 32; NaN
    = never drawn, as for all motions if there are fewer than a pool.

    Two runs of the same prompts, repeats and seed draw the same pools: their numbers are paired.
    """
    if embeddings.single is not None and not embeddings.single.all():
        shares = np.full(len(embeddings.motion), np.nan)
        shares[embeddings.single] = retrieved(embeddings.embedded(), evaluator, seed)
        return shares
    hits, drawn = np.zeros(len(embeddings.motion)), np.zeros(len(embeddings.motion))
    try:
        pools = embeddings.pools(evaluator, POOLS[0], seed)
    except InvalidInput:
        pools = []
    for each in pools:
        hits[each.rows[each.label.clips]] += each.label.hits[:, TOP.index(3)]
        drawn[each.rows[each.label.clips]] += 1
    return np.divide(hits, drawn, out=np.full(len(hits), np.nan), where=drawn > 0)


def retrieval(
    embeddings: EmbeddedSet, evaluator: Evaluator, pool: int, seed: int, *, of: NDArray[np.bool_] | None = None
) -> dict[str, Value]:
    """Return R-precision in pools of `pool`, by the pair alone and by labels; with `of` (N,) that of some of the
    motions in pools of all.

    A split of few labels must be judged in pools with others: alone, any motion finds its label there.
    """
    try:
        pools = embeddings.pools(evaluator, pool, seed)
    except InvalidInput as error:
        return dict.fromkeys(keys_of(pool), Value.missing(error.message))
    drawn = [slice(None) if of is None else of[each.rows[each.pair.clips]] for each in pools]
    found = [(each.pair.hits[some], each.label.hits[some]) for each, some in zip(pools, drawn, strict=True)]
    count = min(len(pair) for pair, _ in found)
    if count == 0:
        return dict.fromkeys(keys_of(pool), Value.missing("no such motion was drawn into a pool"))
    return {
        key(pool, k): _interval([100 * float(each[kind][:, column].mean()) for each in found], count)
        for kind, key in enumerate((_pair_key, _key))
        for column, k in enumerate(TOP)
    }


def _distances(embeddings: EmbeddedSet, real: Embeddings, seed: int) -> dict[str, Value]:
    """Return FID once per generated repeat, since it draws nothing; KID by subsets."""
    statistics, sizes = GaussianStatistics.of(real, name="real"), np.bincount(embeddings.variants, minlength=1)
    size = min(KID_SIZE, len(real), int(sizes.min()))
    try:
        rows = [np.flatnonzero(embeddings.variants == number) for number in range(len(sizes))]
        frechet = [fid(statistics, embeddings.motion[some]).value for some in rows]
    except InvalidInput as error:
        return {name: Value.missing(error.message) for name in ("fid", "kid")}
    return {
        "fid": _interval(frechet, min(len(real), int(sizes.min())), dimensions=real.shape[1]),
        "kid": _drawn(
            embeddings,
            seed,
            lambda rows, rng: kid(real, embeddings.motion[rows], subsets=KID_SUBSETS, subset_size=size, rng=rng).mean,
        ),
    }


def _drawn(
    embeddings: EmbeddedSet, seed: int, metric: Callable[[NDArray[np.int64], np.random.Generator], float]
) -> Value:
    try:
        found = [metric(rows, rng) for rows, rng in embeddings.repeats(seed)]
    except InvalidInput as error:
        return Value.missing(error.message)
    return _interval(found, int(np.bincount(embeddings.variants).min()))


def _over_repeats(
    variants: NDArray[np.int64], numbers: NDArray[np.float64], which: NDArray[np.bool_], why: str
) -> Value:
    """Return the mean of `numbers` (N,) where `which` (N,), in each generated repeat."""
    kinds = [which & (variants == k) for k in range(repeats_of(variants))]
    if not all(kind.any() for kind in kinds):
        return Value.missing(why)
    return _interval([float(numbers[kind].mean()) for kind in kinds], int(min(kind.sum() for kind in kinds)))


def _interval(found: Sequence[float], count: int, *, dimensions: int | None = None) -> Value:
    if len(found) < 2:
        return Value(found[0], None, count, dimensions=dimensions)
    interval = repeated(found)
    return Value(interval.mean, interval.half_width, count, dimensions=dimensions)


def label_ceilings(labels: NDArray[np.int64], pool: int, seed: int) -> dict[int, float]:
    """Return R-precision in per cent by k of an oracle that knows only the labels (N,), where only the pair counts;
    mean over the repeats.

    Raises:
        InvalidInput: fewer labels than a pool.
    """
    drawn = redraw(lambda rng: label_ceiling(labels, pool=pool, top=TOP, rng=rng), repeats=REPEATS, seed=seed)
    return {k: 100 * float(np.mean([found.at(k) for found in drawn])) for k in TOP}


def keys_of(pool: int) -> tuple[str, ...]:
    """Return the metrics of R-precision in pools of `pool`."""
    return tuple(key(pool, k) for key in (_pair_key, _key) for k in TOP)


def _pair_key(pool: int, k: int) -> str:
    return f"pair_precision_{k}_of_{pool}"


def _key(pool: int, k: int) -> str:
    """Return the key of same-label R-precision: reports have always had it under this name."""
    return f"r_precision_{k}_of_{pool}"


def _compositional_key(key: str) -> str:
    return f"{key}_{COMPOSITIONAL}"
