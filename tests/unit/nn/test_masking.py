"""Masks of training and decoding."""

from __future__ import annotations

import itertools
import math

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from marey.nn.masking import cosine_schedule, easy_to_hard_mask, mask_counts, remaining_masks


def test_mask_counts_follow_the_cosine_of_a_clips_own_length() -> None:
    progress = torch.tensor([0.0, 2 / 3, 0.5, 1.0])
    assert mask_counts(progress, torch.tensor([49, 40, 10, 49])).tolist() == [49, 20, 7, 1]


def test_a_short_clip_keeps_at_least_one_mask() -> None:
    assert mask_counts(torch.tensor([0.999, 1.0]), torch.tensor([4, 1])).tolist() == [1, 1]


@given(
    n=st.integers(1, 20),
    extra=st.integers(0, 10),
    count=st.integers(1, 20),
    alpha=st.floats(0, 1),
    seed=st.integers(0, 1000),
)
def test_a_mask_has_exactly_its_count_and_stays_within_the_clip(
    n: int, extra: int, count: int, alpha: float, seed: int
) -> None:
    count = min(count, n)
    generator = torch.Generator().manual_seed(seed)
    difficulty = torch.randn(1, n + extra, generator=generator)
    noise = torch.rand(1, n + extra, generator=generator)
    valid = torch.arange(n + extra)[None] < n
    mask = easy_to_hard_mask(difficulty, noise, valid, torch.tensor([count]), alpha)
    assert int(mask.sum()) == count
    assert not mask[~valid].any()
    hard = math.floor(alpha * count + 1e-6)
    hardest = difficulty[0, :n].argsort(descending=True)[:hard]
    assert mask[0, hardest].all()


def test_without_hard_tokens_the_choice_is_the_order_of_the_noise() -> None:
    noise = torch.tensor([[0.1, 0.9, 0.5, 0.7]])
    mask = easy_to_hard_mask(
        torch.tensor([[9.0, 0, 0, 0]]), noise, torch.ones(1, 4, dtype=torch.bool), torch.tensor([2]), 0.0
    )
    assert mask.tolist() == [[False, True, False, True]]


def test_remaining_masks_follow_the_paper() -> None:
    # ⌈cos(πl/20)·49⌉ for l = 1 … 9, then 0
    assert remaining_masks(49, 10) == [49, 47, 44, 40, 35, 29, 23, 16, 8, 0]


def test_the_first_pass_keeps_nothing_up_to_81_tokens() -> None:
    assert remaining_masks(81, 10)[0] == 81
    assert remaining_masks(82, 10)[0] == 81


@pytest.mark.parametrize("min_progress", [False, True])
@given(n=st.integers(1, 60), steps=st.integers(1, 30))
def test_masks_only_fall_and_end_at_none(min_progress: bool, n: int, steps: int) -> None:
    schedule = [n, *remaining_masks(n, steps, min_progress=min_progress)]
    falls = [a - b for a, b in itertools.pairwise(schedule)]
    assert all(f >= 0 for f in falls)
    assert schedule[-1] == 0
    if min_progress:
        assert all(f >= 1 for f, left in zip(falls, schedule, strict=False) if left)


def test_the_schedule_starts_with_everything_and_ends_with_nothing() -> None:
    torch.testing.assert_close(cosine_schedule(torch.tensor([0.0, 1.0])), torch.tensor([1.0, 0.0]), atol=1e-6, rtol=0)
