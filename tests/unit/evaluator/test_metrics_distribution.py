"""FID, KID, diversity and multimodality."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import sqrtm

from marey.core.errors import InvalidInput
from marey.evaluator.metrics.distribution import GaussianStatistics, diversity, fid, kid, multimodality

SEEDS = st.integers(0, 2**32 - 1)


def cloud(seed=0, count=400, dimensions=6):
    """Correlated, off the origin."""
    rng = np.random.default_rng(seed)
    mixed = rng.normal(size=(count, dimensions)) @ rng.normal(size=(dimensions, dimensions))
    return mixed + rng.normal(size=dimensions)


def public_formula(one, two):
    """FID as the public evaluator computes it, without its way out for singular covariances."""
    s1, s2 = (np.atleast_2d(np.cov(x, rowvar=False)) for x in (one, two))
    apart = one.mean(axis=0) - two.mean(axis=0)
    return apart @ apart + np.trace(s1 + s2 - 2 * sqrtm(s1 @ s2).real)


# -- FID -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimensions", [1, 6, 40])
def test_fid_is_the_public_formula(dimensions):
    one, two = cloud(1, dimensions=dimensions), cloud(2, 300, dimensions)
    assert fid(one, two).value == pytest.approx(public_formula(one, two), rel=1e-9)


def test_fid_of_independent_gaussians_by_hand():
    # four points on each axis: mean 0, diagonal covariance, n - 1 = 3
    axes = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    one, two = axes * [3.0, 1.0], axes * [1.0, 5.0] + [2.0, 1.0]
    spread = 2 / 3 * ((3 - 1) ** 2 + (1 - 5) ** 2)
    assert fid(one, two).value == pytest.approx(2.0**2 + 1.0**2 + spread)


def test_statistics_have_the_covariance_of_numpy_and_are_computed_once():
    one, two = cloud(1), cloud(2)
    real = GaussianStatistics.of(one)
    assert real.factor.T @ real.factor == pytest.approx(np.cov(one, rowvar=False))
    assert fid(real, two) == fid(one, two)
    assert fid(real, GaussianStatistics.of(two)) == fid(one, two)


@pytest.mark.parametrize(("real", "generated"), [(10, 12), (10, 400), (400, 10), (2, 2)])
def test_fid_of_fewer_samples_than_dimensions_is_real_and_finite(real, generated):
    one, two = cloud(1, real, 64), cloud(2, generated, 64)
    found = fid(one, two)
    # the trace of the root is the sum of the singular values of the two sets' products
    product = (one - one.mean(axis=0)) @ (two - two.mean(axis=0)).T / np.sqrt((real - 1) * (generated - 1))
    root = np.linalg.svd(product, compute_uv=False).sum()
    traces = one.var(axis=0, ddof=1).sum() + two.var(axis=0, ddof=1).sum()
    means = ((one.mean(axis=0) - two.mean(axis=0)) ** 2).sum()
    assert isinstance(found.value, float)
    assert found.value == pytest.approx(means + traces - 2 * root)
    assert (found.n_real, found.n_generated, found.dimensions) == (real, generated, 64)


def test_fid_of_embeddings_that_are_all_alike_is_the_distance_of_their_means():
    same = np.tile([1.0, 2.0, 3.0], (20, 1))
    assert fid(same, same + np.array([0.0, 3.0, 4.0])).value == pytest.approx(25.0)


def test_fid_of_two_samples_of_one_distribution_falls_with_their_size():
    found = [fid(cloud_of, other).value for cloud_of, other in (halves(n) for n in (20, 200, 2000))]
    assert found[0] > 3 * found[1] > 9 * found[2] > 0


def halves(count, dimensions=8):
    rng = np.random.default_rng(7)
    return rng.normal(size=(count, dimensions)), rng.normal(size=(count, dimensions))


@settings(deadline=None)
@given(SEEDS, st.integers(2, 40))
def test_fid_of_a_set_and_itself_in_another_order_is_0_and_never_negative(seed, count):
    one = 1e3 * cloud(seed, count, 12)
    found = fid(one, one[np.random.default_rng(seed).permutation(count)]).value
    assert 0 <= found < 1e-12 * (one**2).sum()


@settings(deadline=None)
@given(SEEDS, st.integers(2, 40), st.integers(2, 40))
def test_fid_is_symmetric_and_not_negative(seed, real, generated):
    one, two = cloud(seed, real, 12), cloud(seed + 1, generated, 12)
    assert fid(one, two).value == pytest.approx(fid(two, one).value, rel=1e-9)
    assert fid(one, two).value > 0


@settings(deadline=None)
@given(SEEDS, st.integers(2, 40))
def test_a_translation_adds_its_squared_length_to_fid(seed, count):
    one, two = cloud(seed, count, 5), cloud(seed + 1, count, 5)
    two += one.mean(axis=0) - two.mean(axis=0)
    shift = np.random.default_rng(seed).normal(size=5)
    assert fid(one, two + shift).value == pytest.approx(fid(one, two).value + shift @ shift)


@settings(deadline=None)
@given(SEEDS)
def test_a_common_rotation_changes_no_fid(seed):
    one, two = cloud(seed), cloud(seed + 1)
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(6, 6)))[0]
    assert fid(one @ rotation, two @ rotation).value == pytest.approx(fid(one, two).value, rel=1e-9)


# -- KID -------------------------------------------------------------------------------------------------------------


def test_kid_of_one_subset_is_the_double_sum():
    one, two = cloud(1, 7, 3), cloud(2, 7, 3)

    def mean(a, b, skip):
        values = [(x @ y / 3 + 1) ** 3 for i, x in enumerate(a) for j, y in enumerate(b) if not (skip and i == j)]
        return sum(values) / len(values)

    expected = mean(one, one, True) + mean(two, two, True) - 2 * mean(one, two, False)
    found = kid(one, two, subsets=1, subset_size=7, rng=np.random.default_rng(0))
    assert found.mean == pytest.approx(expected)
    assert found.std == 0.0


def test_kid_of_two_small_samples_of_one_distribution_is_0_on_average():
    rng = np.random.default_rng(3)
    found = np.array([kid(*rng.normal(size=(2, 20, 4)), subsets=1, subset_size=20, rng=rng).mean for _ in range(2000)])
    assert abs(found.mean()) < 3 * found.std() / np.sqrt(2000)
    assert (found < 0).any()


def test_kid_tells_distributions_apart_by_more_than_its_spread():
    rng = np.random.default_rng(3)
    one, two = rng.normal(size=(400, 8)), rng.normal(size=(300, 8)) + 0.5
    found = kid(one, two, subsets=20, subset_size=100, rng=rng)
    assert found.mean > 3 * found.std > 0


@pytest.mark.parametrize("turned", [False, True])
def test_subsets_of_kid_are_drawn_from_the_whole_of_both_sets(turned):
    rng = np.random.default_rng(3)
    alike, odd = rng.normal(size=(200, 4)), rng.normal(size=(200, 4))
    odd[50:] += 3.0  # the first rows would tell nothing
    found = kid(*((odd, alike) if turned else (alike, odd)), subsets=4, subset_size=50, rng=rng)
    assert found.mean > 10
    assert found.std > 0


def test_kid_follows_the_generator():
    one, two = cloud(1), cloud(2)
    found = [kid(one, two, subsets=3, subset_size=50, rng=np.random.default_rng(seed)) for seed in (1, 1, 2)]
    assert found[0] == found[1] != found[2]


# -- spread ----------------------------------------------------------------------------------------------------------


def test_diversity_is_the_mean_distance_of_two_draws_without_replacement():
    motion = cloud(count=500)
    expected = np.random.default_rng(5)
    first, second = (expected.choice(500, 300, replace=False) for _ in range(2))
    distances = [np.sqrt(((motion[i] - motion[j]) ** 2).sum()) for i, j in zip(first, second, strict=True)]
    assert diversity(motion, rng=np.random.default_rng(5)) == pytest.approx(np.mean(distances))


@pytest.mark.parametrize(("count", "pairs"), [(301, 300), (300, 100), (101, 100)])
def test_diversity_draws_300_pairs_or_100_of_not_more_than_300_motions(count, pairs):
    motion = cloud(count=count)
    found = diversity(motion, rng=np.random.default_rng(5))
    assert found == pytest.approx(diversity(motion, pairs=pairs, rng=np.random.default_rng(5)))


def test_diversity_grows_with_the_spread_and_is_0_without():
    motion = cloud()
    plain, wider = (diversity(s * motion, rng=np.random.default_rng(5)) for s in (1, 3))
    assert wider == pytest.approx(3 * plain)
    assert diversity(np.ones((400, 3)), rng=np.random.default_rng(5)) == 0.0


def test_multimodality_compares_generations_of_the_same_prompt_only():
    rng = np.random.default_rng(2)
    prompts = 100 * rng.normal(size=(20, 1, 4))
    generations = np.repeat(prompts, 30, axis=1)
    assert multimodality(generations, rng=rng) == 0.0
    apart = multimodality(generations + rng.normal(size=generations.shape), rng=rng)
    # |x - y| of 4-dimensional unit normals is √2 · 1.88; a thirtieth of the pairs is a motion and itself
    assert apart == pytest.approx(np.sqrt(2) * 1.88 * 29 / 30, rel=0.1)


def test_multimodality_is_the_mean_over_drawn_pairs_of_generations():
    motion = np.random.default_rng(2).normal(size=(3, 8, 4))
    expected = np.random.default_rng(5)
    first, second = (expected.choice(8, 6, replace=False) for _ in range(2))
    distances = [np.sqrt(((m[i] - m[j]) ** 2).sum()) for m in motion for i, j in zip(first, second, strict=True)]
    assert multimodality(motion, pairs=6, rng=np.random.default_rng(5)) == pytest.approx(np.mean(distances))


# -- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [np.nan, np.inf, -1e39])
def test_broken_embeddings_are_refused_by_every_metric(value):
    rng = np.random.default_rng(0)
    fine, broken = cloud(), cloud()
    broken[11, 0] = value
    for metric in (
        lambda: fid(fine, broken),
        lambda: kid(fine, broken, subsets=1, subset_size=10, rng=rng),
        lambda: diversity(broken, rng=rng),
        lambda: GaussianStatistics.of(broken),
        lambda: multimodality(broken.reshape(20, 20, 6), rng=rng),
    ):
        with pytest.raises(InvalidInput, match=r"row (11|0)"):
            metric()


@pytest.mark.parametrize(
    ("metric", "message"),
    [
        (lambda r: fid(cloud(), cloud(dimensions=5)), "6 and 5 dimensions"),
        (lambda r: fid(cloud(count=1), cloud()), "real: 1 is too few"),
        (lambda r: fid(cloud(), cloud()[0]), "generated: has the shape"),
        (lambda r: kid(cloud(), cloud(dimensions=5), subsets=1, subset_size=9, rng=r), "6 and 5 dimensions"),
        (lambda r: kid(cloud(), cloud(count=30), subsets=1, subset_size=31, rng=r), "generated: 30 is too few"),
        (lambda r: kid(cloud(), cloud(), subsets=1, subset_size=1, rng=r), "subset_size: 1 is too few"),
        (lambda r: kid(cloud(), cloud(), subsets=0, subset_size=9, rng=r), "subsets: 0 is too few"),
        (lambda r: diversity(cloud(count=100), rng=r), "motion: 100 is too few, 101"),
        (lambda r: diversity(cloud(count=40), pairs=40, rng=r), "motion: 40 is too few, 41"),
        (lambda r: diversity(cloud(), pairs=0, rng=r), "pairs: 0 is too few"),
        (lambda r: multimodality(np.ones((4, 10, 3)), rng=r), "generations of a prompt: 10 is too few, 11"),
        (lambda r: multimodality(cloud(), rng=r), "motion: has the shape"),
    ],
)
def test_too_few_or_unlike_embeddings_are_refused(metric, message):
    with pytest.raises(InvalidInput, match=message):
        metric(np.random.default_rng(0))
