"""Distances between sets of generated and real motions: FID, KID, diversity, multimodality."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from marey.core.errors import InvalidInput
from marey.measures.inputs import Array, Integers, Numbers, at_least, embeddings

SAMPLES_PER_DIMENSION = 5
_FEW_PAIRS = 100  # pairs of `diversity` if there are no more motions than requested pairs


@dataclass(frozen=True, eq=False)
class GaussianStatistics:
    """Mean and covariance of a set of embeddings; those of the real motions are computed once.

    Attributes:
        count: embeddings.
        mean: (D,)
        factor: (D, D) upper triangular R with RᵀR = `np.cov(x, rowvar=False)`.
    """

    count: int
    mean: Array
    factor: Array

    @classmethod
    def of(cls, values: Numbers, *, name: str = "embeddings") -> GaussianStatistics:
        """Compute statistics of embeddings (N, D).

        Raises:
            InvalidInput: broken embeddings, or a single one.
        """
        array = embeddings(name, values)
        count, dimensions = array.shape
        at_least(name, count, 2, hint="one embedding has no covariance")
        mean = array.mean(axis=0)
        # Computed from the data, not from its covariance: squaring first would halve the digits of small directions.
        triangle = np.linalg.qr(array - mean, mode="r") / np.sqrt(count - 1)  # (min(N, D), D)
        factor = np.zeros((dimensions, dimensions))
        factor[: len(triangle)] = triangle
        return cls(count, mean, factor)


@dataclass(frozen=True)
class Fid:
    """A Fréchet distance with the sizes of its sets.

    Attributes:
        value: 0 or more.
        n_real: real embeddings.
        n_generated: generated embeddings.
        dimensions: of an embedding.
    """

    value: float
    n_real: int
    n_generated: int
    dimensions: int


@dataclass(frozen=True)
class Kid:
    """Kernel distance over random subsets.

    Attributes:
        mean: unbiased, so it may be slightly negative for similar sets.
        std: over the subsets, population.
    """

    mean: float
    std: float


def fid(real: Numbers | GaussianStatistics, generated: Numbers | GaussianStatistics) -> Fid:
    """Return the Fréchet distance of two Gaussians (Heusel et al. 2017, eq. 6): |μ₁ - μ₂|² + tr(S₁ + S₂ - 2 (S₁ S₂)^½).

    With factors S = RᵀR the trace of the root is the sum of the singular values U Σ Vᵀ of R₁R₂ᵀ, and the whole second
    term is |R₁ - U Vᵀ R₂|². As a sum of squares it is never negative or complex, also with fewer embeddings than
    dimensions, where the root of the singular product S₁S₂ is.

    Args:
        real: (N, D) embeddings or their statistics.
        generated: (M, D) embeddings of the same network, or their statistics.

    Raises:
        InvalidInput: broken embeddings, a single one, or sets of different dimensions.
    """
    one = real if isinstance(real, GaussianStatistics) else GaussianStatistics.of(real, name="real")
    two = generated if isinstance(generated, GaussianStatistics) else GaussianStatistics.of(generated, name="generated")
    _check_dimensions(len(one.mean), len(two.mean))
    left, _, right = np.linalg.svd(one.factor @ two.factor.T)
    covariances = ((one.factor - left @ (right @ two.factor)) ** 2).sum()
    value = ((one.mean - two.mean) ** 2).sum() + covariances
    return Fid(float(value), one.count, two.count, len(one.mean))


def kid(real: Numbers, generated: Numbers, *, subsets: int, subset_size: int, rng: np.random.Generator) -> Kid:
    """Return the kernel distance (Bińkowski et al. 2018, section 4): squared MMD, unbiased, with the kernel (xᵀy / D +
    1)³.

    Unlike FID its expectation does not depend on the number of embeddings.

    Args:
        real: (N, D) embeddings.
        generated: (M, D) embeddings of the same network.
        subsets: number of draws of `subset_size` from each set, without replacement within a draw.
        subset_size: 2 or more, at most the size of either set.

    Raises:
        InvalidInput: broken embeddings, sets of different dimensions, or fewer embeddings than a subset.
    """
    one, two = embeddings("real", real), embeddings("generated", generated)
    _check_dimensions(one.shape[1], two.shape[1])
    at_least("subsets", subsets, 1, hint="draw at least one")
    at_least("subset_size", subset_size, 2, hint="an unbiased estimate needs two embeddings of each set")
    for name, array in (("real", one), ("generated", two)):
        at_least(name, len(array), subset_size, hint="give more embeddings or take smaller subsets")
    found = [
        _squared_mmd(
            one[rng.choice(len(one), subset_size, replace=False)],
            two[rng.choice(len(two), subset_size, replace=False)],
        )
        for _ in range(subsets)
    ]
    return Kid(float(np.mean(found)), float(np.std(found)))


def diversity(motion: Numbers, *, pairs: int = 300, rng: np.random.Generator) -> float:
    """Return the mean Euclidean distance of random pairs (Guo et al. 2022); best near that of real motions.

    As in the public evaluator, first and second members are two draws without replacement, so a motion may be paired
    with itself, and if there are no more motions than pairs, 100 pairs are drawn.

    Args:
        motion: (N, D) embeddings, more than `pairs`.
        pairs: number of pairs to draw.

    Raises:
        InvalidInput: broken embeddings, or too few.
    """
    array = embeddings("motion", motion)
    drawn = pairs if len(array) > pairs else min(pairs, _FEW_PAIRS)
    first, second = _drawn_twice("motion", len(array), drawn, rng)
    return float(np.linalg.norm(array[first] - array[second], axis=1).mean())


def multimodality(motion: Numbers, *, pairs: int = 10, rng: np.random.Generator) -> float:
    """Return the mean Euclidean distance of random pairs of motions of the same prompt (Guo et al. 2022).

    As in the public evaluator, all prompts use the same drawn pairs of generations.

    Args:
        motion: (P, K, D) embeddings, K generations of each of P prompts; the protocol has K = 30.
        pairs: number of pairs to draw, under K.

    Raises:
        InvalidInput: broken embeddings, or too few generations.
    """
    array = embeddings("motion", motion, axes="PKD")
    first, second = _drawn_twice("generations of a prompt", array.shape[1], pairs, rng)
    return float(np.linalg.norm(array[:, first] - array[:, second], axis=2).mean())


def _drawn_twice(name: str, count: int, pairs: int, rng: np.random.Generator) -> tuple[Integers, Integers]:
    at_least("pairs", pairs, 1, hint="draw at least one")
    at_least(name, count, pairs + 1, hint=f"{pairs} pairs are drawn: give more motions or draw fewer")
    return rng.choice(count, pairs, replace=False), rng.choice(count, pairs, replace=False)


def _squared_mmd(one: Array, two: Array) -> float:
    """Return the unbiased squared MMD of (m, D) and (m, D): a motion is not compared to itself."""
    size = len(one)
    within = sum(k.sum() - np.trace(k) for k in (_kernel(one, one), _kernel(two, two))) / (size * (size - 1))
    return float(within - 2 * _kernel(one, two).mean())


def _kernel(one: Array, two: Array) -> Array:
    base = one @ two.T / one.shape[1] + 1
    return base * base * base  # five times as fast as a power


def _check_dimensions(real: int, generated: int) -> None:
    if real != generated:
        raise InvalidInput(
            f"embeddings of {real} and {generated} dimensions",
            where="real, generated",
            hint="embed both with the same network",
        )
