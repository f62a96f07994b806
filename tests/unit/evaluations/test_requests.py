"""Evaluations that are refused before anything is made."""

from __future__ import annotations

import pytest

from marey.core.errors import InvalidInput
from marey.evaluations.requests import _check_size  # pyright: ignore[reportPrivateUsage]
from marey.evaluations.types import EvaluationRequest
from marey.items.item import MAX_ITEMS
from marey.items.values import MAX_SEED


def test_an_evaluation_has_at_most_as_many_motions_as_a_job() -> None:
    _check_size(EvaluationRequest("hgm3", repeats=2), MAX_ITEMS // 2)
    with pytest.raises(InvalidInput, match="over the limit") as caught:
        _check_size(EvaluationRequest("hgm3", repeats=2), MAX_ITEMS // 2 + 1)
    assert caught.value.where == "repeats"


def test_the_seed_of_the_last_motion_is_within_its_range() -> None:
    _check_size(EvaluationRequest("hgm3", seed=MAX_SEED - 9), 10)
    with pytest.raises(InvalidInput) as caught:
        _check_size(EvaluationRequest("hgm3", seed=MAX_SEED - 8), 10)
    assert caught.value.where == "seed"
