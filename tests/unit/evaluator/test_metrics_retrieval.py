"""Retrieval: R-precision in pools, all pairs, same-label hits, ties."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from marey.core.errors import InvalidInput
from marey.evaluator.metrics.intervals import redraw
from marey.evaluator.metrics.retrieval import all_ranks, clip_score, label_ceiling, matching_score, r_precision

SEEDS = st.integers(0, 2**32 - 1)
DISTANCES = ["euclidean", "cosine"]


def matched(seed=0, count=96, dimensions=8, noise=1.0):
    """Text, and motion near its text: neither always nor never found."""
    rng = np.random.default_rng(seed)
    text = rng.normal(size=(count, dimensions))
    return text, text + noise * rng.normal(size=text.shape)


def rng(seed=1):
    return np.random.default_rng(seed)


def first_of_sorted(text, motion, clips, pool, k, distance):
    """R@k as the public evaluator computes it: sort each row of a pool's distance matrix, look for the diagonal."""
    found = 0
    for members in clips.reshape(-1, pool):
        if distance == "cosine":
            one, two = (x[members] / np.linalg.norm(x[members], axis=1, keepdims=True) for x in (text, motion))
            apart = -one @ two.T
        else:
            apart = np.linalg.norm(text[members, None] - motion[members], axis=2)
        found += (np.argsort(apart, axis=1)[:, :k] == np.arange(pool)[:, None]).any(axis=1).sum()
    return found / len(clips)


# -- pools -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("distance", DISTANCES)
@pytest.mark.parametrize("pool", [32, 100])
def test_hits_are_those_of_the_sorted_distance_matrix_of_each_pool(pool, distance):
    text, motion = matched(count=300)
    motion *= np.linspace(0.2, 4.0, 300)[:, None]  # lengths that tell the two distances apart
    found = r_precision(text, motion, pool=pool, distance=distance, rng=rng())
    for k in (1, 2, 3):
        assert found.at(k) == pytest.approx(first_of_sorted(text, motion, found.clips, pool, k, distance))
    assert 0.02 < found.at(1) < 0.9


def test_the_incomplete_pool_is_dropped_and_its_clips_are_not_counted():
    text, motion = matched(count=3 * 32 + 31, noise=0.0)
    found = r_precision(text, motion, pool=32, rng=rng())
    assert len(set(found.clips)) == 96
    assert found.hits.shape == (96, 3)
    assert found.at(1) == 1.0  # and not 96 / 127


def test_pools_follow_the_generator_and_not_the_order_of_the_rows():
    text, motion = matched(count=128)
    drawn = [r_precision(text, motion, pool=32, rng=rng(seed)).clips for seed in (1, 1, 2)]
    assert (drawn[0] == drawn[1]).all()
    assert (drawn[0] != drawn[2]).any()
    assert (drawn[0] != np.arange(128)).any()


def test_a_larger_pool_is_harder():
    text, motion = matched(count=400)
    small, large = (r_precision(text, motion, pool=pool, rng=rng()).at(1) for pool in (32, 100))
    assert large < small - 0.1


# -- pairs -----------------------------------------------------------------------------------------------------------


def test_sorting_text_and_motion_together_changes_nothing():
    text, motion = matched()
    order = rng(5).permutation(96)
    together = r_precision(text[order], motion[order], pool=96, rng=rng())
    apart = r_precision(text, motion, pool=96, rng=rng())
    assert [together.at(k) for k in (1, 2, 3)] == pytest.approx([apart.at(k) for k in (1, 2, 3)])
    assert asdict(all_ranks(text[order], motion[order])) == asdict(all_ranks(text, motion))


def test_sorting_only_the_motions_drops_to_chance():
    text, motion = matched(count=960, noise=0.3)
    order = rng(5).permutation(960)
    assert r_precision(text, motion, pool=32, rng=rng()).at(1) > 0.9
    assert r_precision(text, motion[order], pool=32, rng=rng()).at(1) == pytest.approx(1 / 32, abs=0.02)
    assert all_ranks(text, motion[order]).text_to_motion.median > 300
    assert matching_score(text, motion[order]) > 3 * matching_score(text, motion)
    assert abs(clip_score(text, motion[order])) < 0.1


def test_the_text_asks_and_the_motion_answers():
    # Each motion's nearest text is its own; the second text has the first motion nearest.
    text, motion = np.array([[0.0], [3.0], [9.0]]), np.array([[1.0], [7.0], [8.5]])
    found = r_precision(text, motion, pool=3, top=(1, 2), rng=rng())
    assert found.at(1) == pytest.approx(2 / 3)
    assert found.at(2) == 1.0
    assert found.hits[found.clips == 1].tolist() == [[0.0, 1.0]]


def test_matching_score_and_clip_score_of_a_pair_by_hand():
    text, motion = np.array([[3.0, 4.0], [1.0, 0.0]]), np.array([[0.0, 2.0], [1.0, 2.0]])
    assert matching_score(text, motion) == pytest.approx((np.sqrt(13) + 2) / 2)
    assert clip_score(text, motion) == pytest.approx((0.8 + 1 / np.sqrt(5)) / 2)


# -- ties ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("distance", DISTANCES)
@pytest.mark.parametrize("apart", [0.0, 1.0])
def test_an_evaluator_that_embeds_everything_alike_scores_chance(distance, apart):
    # dimensions and values at which a product of matrices does round rows differently
    text = np.tile(rng(3).normal(size=(1, 257)), (200, 1))
    motion = np.tile(text[:1] + apart * rng(4).normal(size=(1, 257)), (200, 1))
    for pool in (32, 100):
        found = r_precision(text, motion, pool=pool, distance=distance, rng=rng())
        assert [found.at(k) for k in (1, 2, 3)] == pytest.approx([k / pool for k in (1, 2, 3)])
    found = all_ranks(text, motion, distance=distance)
    assert found.text_to_motion.recall == pytest.approx({k: k / 200 for k in (1, 2, 3, 5, 10)})
    assert found.motion_to_text.median == pytest.approx(100.5)


def test_a_match_that_ties_with_another_motion_is_half_a_hit():
    text, motion = matched(count=32, noise=0.1)
    motion[7], text[7] = motion[4], text[4]
    found = r_precision(text, motion, pool=32, top=(1, 2), rng=rng())
    at = {int(clip): row.tolist() for clip, row in zip(found.clips, found.hits, strict=True)}
    assert at[4] == at[7] == pytest.approx([0.5, 1.0])


def test_a_tie_behind_a_nearer_motion_shares_the_places_that_are_left():
    text = np.array([[0.0, 0.0], [50.0, 0.0], [60.0, 0.0], [70.0, 0.0]])
    motion = np.array([[2.0, 0.0], [1.0, 0.0], [0.0, 2.0], [-2.0, 0.0]])  # one nearer, then a tie of three
    found = r_precision(text, motion, pool=4, rng=rng())
    assert found.hits[found.clips == 0][0] == pytest.approx([0.0, 1 / 3, 2 / 3])


def test_distances_that_only_rounding_tells_apart_tie():
    direction = rng(3).normal(size=65)
    lengths = np.linspace(0.1, 7.0, 32)[:, None]
    found = r_precision(np.tile(direction, (32, 1)), lengths * direction, pool=32, distance="cosine", rng=rng())
    assert found.hits[:, 0] == pytest.approx(np.full(32, 1 / 32))
    around = np.stack([np.roll(direction, step) for step in range(32)])  # all as far from the origin
    found = r_precision(np.zeros((32, 65)), around, pool=32, rng=rng())
    assert found.hits[:, 0] == pytest.approx(np.full(32, 1 / 32))


def test_motions_that_float32_tells_apart_do_not_tie():
    text = np.ones((2, 64))
    motion = np.tile([[1 + 1e-6], [1 + 2e-6]], 64)
    found = r_precision(text, motion, pool=2, top=(1,), rng=rng())
    assert sorted(found.hits[:, 0].tolist()) == [0.0, 1.0]


# -- labels ----------------------------------------------------------------------------------------------------------


def test_a_candidate_of_the_same_label_is_a_match():
    text, motion = matched(count=64, noise=0.1)
    labels = np.arange(64) // 2
    swapped = motion.reshape(32, 2, -1)[:, ::-1].reshape(64, -1)  # each text's motion is its label's other one
    assert r_precision(text, swapped, pool=64, rng=rng()).at(1) < 0.1
    assert r_precision(text, swapped, pool=64, labels=labels, rng=rng()).at(1) > 0.9
    assert all_ranks(text, swapped).text_to_motion.recall[1] < 0.1
    for found in asdict(all_ranks(text, swapped, labels=labels)).values():
        assert found["recall"][1] > 0.9
        assert found["median"] == 1.0


def test_with_labels_a_collapsed_evaluator_scores_the_chance_of_drawing_the_label():
    labels = np.repeat(np.arange(4), 8)
    same = np.ones((32, 3))
    found = r_precision(same, same, pool=32, labels=labels, rng=rng())
    miss = np.cumprod([24 / 32, 23 / 31, 22 / 30])
    assert [found.at(k) for k in (1, 2, 3)] == pytest.approx((1 - miss).tolist())
    assert all_ranks(same, same, labels=labels).text_to_motion.median == pytest.approx(33 / 9)


def test_each_pair_as_its_own_label_is_plain_retrieval():
    text, motion = matched()
    plain, labelled = (r_precision(text, motion, pool=32, labels=g, rng=rng()) for g in (None, np.arange(96) * 7))
    assert (plain.hits == labelled.hits).all()


def test_the_ceiling_is_what_a_perfect_label_level_model_scores_in_the_same_pools():
    labels = rng(9).integers(0, 85, 337)
    by_label = np.eye(85)[labels]
    ceiling = label_ceiling(labels, pool=100, top=(1, 3), rng=rng())
    model = r_precision(by_label, by_label, pool=100, top=(1, 3), rng=rng())
    assert (ceiling.clips == model.clips).all()
    assert ceiling.hits == pytest.approx(model.hits)
    assert ceiling.at(1) < 0.8


def test_the_ceiling_by_hand():
    labels = np.array([5, 5, 5, 5, 9, 9, 2, 2])
    assert label_ceiling(labels, pool=8, top=(1, 3), rng=rng()).hits.mean(axis=0) == pytest.approx([0.375, 0.875])


def test_without_repeated_labels_the_ceiling_is_1():
    assert label_ceiling(np.arange(64), pool=32, rng=rng()).at(1) == 1.0


def test_distinct_pools_lift_the_ceiling_of_a_perfect_label_level_model_to_1():
    labels = rng(9).integers(0, 85, 337)
    by_label = np.eye(85)[labels]
    assert r_precision(by_label, by_label, pool=32, labels=None, rng=rng()).at(1) < 0.95
    found = r_precision(by_label, by_label, pool=32, labels=labels, distinct_pools=True, rng=rng())
    assert found.at(1) == 1.0
    members = labels[found.clips].reshape(-1, 32)
    assert all(len(set(pool)) == 32 for pool in members.tolist())


# -- properties ------------------------------------------------------------------------------------------------------


@settings(deadline=None)
@given(SEEDS, st.sampled_from(DISTANCES), st.booleans())
def test_r_precision_grows_with_k(seed, distance, labelled):
    text, motion = matched(seed, count=40, dimensions=3)
    motion[10:20] = motion[:10]
    labels = np.arange(40) // 3 if labelled else None
    top = (1, 2, 3, 5, 9)
    found = r_precision(text, motion, pool=20, top=top, distance=distance, labels=labels, rng=rng(seed))
    assert (np.diff(found.hits, axis=1) >= 0).all()
    assert found.hits.min() >= 0
    assert found.hits.max() <= 1


@settings(deadline=None)
@given(SEEDS, st.sampled_from(DISTANCES))
def test_a_common_rotation_changes_no_hit(seed, distance):
    text, motion = matched(seed, count=40, dimensions=5)
    rotation = np.linalg.qr(np.random.default_rng(seed).normal(size=(5, 5)))[0]
    options = {"pool": 20, "distance": distance}
    plain = r_precision(text, motion, **options, rng=rng(seed))
    turned = r_precision(text @ rotation, motion @ rotation, **options, rng=rng(seed))
    assert (plain.hits == turned.hits).all()


@settings(deadline=None)
@given(SEEDS, st.floats(-1e5, 1e5))
def test_a_common_shift_changes_no_euclidean_hit(seed, shift):
    text, motion = matched(seed, count=40, dimensions=5)
    plain = r_precision(text, motion, pool=20, rng=rng(seed))
    assert (plain.hits == r_precision(text + shift, motion + shift, pool=20, rng=rng(seed)).hits).all()


@settings(deadline=None)
@given(SEEDS, st.floats(0.01, 100.0))
def test_the_length_of_a_vector_does_not_matter_to_the_cosine(seed, scale):
    text, motion = matched(seed, count=40, dimensions=5)
    options = {"pool": 20, "distance": "cosine"}
    plain, longer = (r_precision(text, m, **options, rng=rng(seed)) for m in (motion, scale * motion))
    assert (plain.hits == longer.hits).all()
    assert clip_score(text, scale * motion) == pytest.approx(clip_score(text, motion))


# -- all pairs -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("distance", DISTANCES)
def test_all_ranks_are_those_of_the_sorted_matrix_in_both_directions(distance):
    text, motion = matched(count=700)  # more rows than are taken at a time
    motion *= np.linspace(0.2, 4.0, 700)[:, None]
    found = all_ranks(text, motion, distance=distance)
    if distance == "cosine":
        one, two = (x / np.linalg.norm(x, axis=1, keepdims=True) for x in (text, motion))
        apart = -one @ two.T
    else:
        apart = np.linalg.norm(text[:, None] - motion, axis=2)
    for ranks, matrix in ((found.text_to_motion, apart), (found.motion_to_text, apart.T)):
        places = np.argsort(np.argsort(matrix, axis=1), axis=1).diagonal()
        assert ranks.recall == pytest.approx({k: (places < k).mean() for k in (1, 2, 3, 5, 10)})
        assert ranks.median == np.median(places) + 1
    assert found.text_to_motion != found.motion_to_text


# -- refusals --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e39])
@pytest.mark.parametrize("metric", [matching_score, clip_score, all_ranks])
def test_a_broken_embedding_is_named_with_its_row(metric, value):
    text, motion = matched()
    motion[41, 2] = value
    with pytest.raises(InvalidInput, match="motion, row 41"):
        metric(text, motion)


def test_unpaired_embeddings_are_refused():
    text, motion = matched()
    for metric in (matching_score, clip_score, all_ranks, lambda t, m: r_precision(t, m, pool=32, rng=rng())):
        for other in (motion[:-1], motion[:, :-1], motion[0], motion[None], motion[:0]):
            with pytest.raises(InvalidInput, match="shape"):
                metric(text, other)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pool": 97}, "96 is too few, 97 are needed"),
        ({"pool": 3}, "of 3 candidates"),
        ({"pool": 32, "top": (0, 1)}, "of 32 candidates"),
        ({"pool": 32, "top": ()}, "of 32 candidates"),
        ({"pool": 32, "labels": np.zeros(95, int)}, "labels: has the shape"),
        ({"pool": 32, "labels": np.zeros(96)}, "float64"),
        ({"pool": 32, "distinct_pools": True}, "need labels"),
        ({"pool": 32, "labels": np.arange(96) % 31, "distinct_pools": True}, "distinct labels: 31 is too few"),
        ({"pool": 32, "distance": "manhattan"}, "unknown distance 'manhattan'"),
    ],
)
def test_r_precision_refuses_what_it_cannot_answer(options, message):
    with pytest.raises(InvalidInput, match=message):
        r_precision(*matched(), **options, rng=rng())


def test_a_zero_vector_has_no_cosine_but_a_distance():
    text, motion = matched()
    text[3] = 0.0
    with pytest.raises(InvalidInput, match="text, row 3"):
        clip_score(text, motion)
    with pytest.raises(InvalidInput, match="text, row 3"):
        r_precision(text, motion, pool=32, distance="cosine", rng=rng())
    assert r_precision(text, motion, pool=32, rng=rng()).at(1) > 0


def test_ten_pairs_have_no_recall_at_10():
    text, motion = matched(count=10)
    with pytest.raises(InvalidInput, match="of 10 candidates"):
        all_ranks(text, motion)


def test_repeats_over_pools_differ_but_little():
    text, motion = matched(count=960)
    found = [r.at(1) for r in redraw(lambda g: r_precision(text, motion, pool=32, rng=g), seed=3)]
    assert 0 < np.std(found) < 0.02
