"""Retrieval scores of a split, in each protocol."""

from __future__ import annotations

import numpy as np
import pytest

from marey.evaluator.caption_retrieval import EmbeddedSplit, retrieval_scores


def split(clips: int, labels: np.ndarray, seed: int = 0, noise: float = 0.0) -> EmbeddedSplit:
    """Two captions a clip that lie where the motion is, but for noise."""
    rng = np.random.default_rng(seed)
    motion = rng.normal(size=(clips, 24)).astype(np.float32)
    text = np.repeat(motion, 2, axis=0) + noise * rng.normal(size=(2 * clips, 24)).astype(np.float32)
    return EmbeddedSplit(motion, text.astype(np.float32), np.full(clips, 2), labels)


def test_a_perfect_space_scores_one_in_every_protocol() -> None:
    scores = retrieval_scores(split(80, np.arange(80)), "cosine")
    assert {name: scores[name] for name in scores if "rank" not in name} == dict.fromkeys(
        [f"{kind}_r{k}" for kind in ("pair", "label", "distinct") for k in (1, 2, 3)], 1.0
    )
    assert scores["median_rank"] == scores["median_rank_back"] == 1


def test_a_motion_of_the_same_label_counts_by_labels_but_neither_by_pairs_nor_in_the_ranks_of_all() -> None:
    labels = np.repeat(np.arange(40), 2)
    of_labels = np.random.default_rng(0).normal(size=(40, 24)).astype(np.float32)[labels]
    blurred = of_labels + 1e-3 * np.random.default_rng(1).normal(size=(80, 24)).astype(np.float32)
    scores = retrieval_scores(EmbeddedSplit(blurred, of_labels, np.ones(80, np.int64), labels), "cosine")
    assert scores["label_r1"] == scores["distinct_r1"] == 1
    assert 0.5 < scores["pair_r1"] < 0.95 < scores["pair_r2"], "two clips cannot be told apart where both are in a pool"
    assert 1 < scores["median_rank"] < 2.1


def test_an_uninformed_space_scores_chance() -> None:
    scores = retrieval_scores(split(320, np.arange(320), noise=1e6), "cosine")
    assert scores["pair_r1"] == scores["label_r1"] == pytest.approx(1 / 32, abs=0.02)
    assert scores["median_rank"] == pytest.approx(160, abs=25)


def test_each_repeat_draws_one_caption_of_each_clip() -> None:
    given = split(50, np.arange(50), noise=1.0)
    rng = np.random.default_rng(3)
    first, second = given.drawn(rng), given.drawn(rng)
    owner = [int(np.flatnonzero((given.text == row).all(1))[0]) // 2 for row in first]
    assert owner == list(range(50))
    assert not np.array_equal(first, second)


def test_what_a_split_is_too_small_for_is_left_out() -> None:
    assert set(retrieval_scores(split(20, np.arange(20)), "cosine")) == {"median_rank", "median_rank_back"}
    assert retrieval_scores(split(5, np.arange(5)), "cosine") == {}
    few = retrieval_scores(split(40, np.arange(40) % 4), "cosine")
    assert {"pair_r1", "label_r1"} <= set(few)
    assert "distinct_r1" not in few
