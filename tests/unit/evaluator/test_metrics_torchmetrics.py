"""Metrics that torchmetrics implements too give equal values: FID, KID, and R-precision as a hit rate of retrieval.

Its import takes two seconds, which only the process that runs these tests spends.
"""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import nn

from marey.evaluator.metrics.distribution import fid, kid
from marey.evaluator.metrics.retrieval import r_precision

WIDTH, POOL = 16, 32


class Embedded(nn.Module):
    """In the place of Inception: embeddings go through as they are."""

    num_features = WIDTH

    def forward(self, embeddings: torch.Tensor) -> torch.Tensor:
        return embeddings


def clouds(count: int = 96) -> tuple[np.ndarray, np.ndarray]:
    """Two sets (count, WIDTH) of correlated embeddings, some way apart."""
    rng = np.random.default_rng(0)
    mix = rng.normal(size=(WIDTH, WIDTH)) / 4
    return rng.normal(size=(count, WIDTH)) @ mix, rng.normal(size=(count, WIDTH)) @ mix + 0.3


def test_fid_is_that_of_torchmetrics():
    from torchmetrics.image.fid import FrechetInceptionDistance

    real, generated = clouds()
    other = FrechetInceptionDistance(feature=Embedded(), input_img_size=(WIDTH,)).set_dtype(torch.float64)
    other.update(torch.from_numpy(real), real=True)
    other.update(torch.from_numpy(generated), real=False)
    assert fid(real, generated).value == pytest.approx(float(other.compute()), rel=1e-6)


@pytest.mark.filterwarnings("ignore:Metric `Kernel Inception Distance` will save")
def test_kid_of_whole_sets_is_that_of_torchmetrics():
    from torchmetrics.image.kid import KernelInceptionDistance

    real, generated = clouds()
    other = KernelInceptionDistance(feature=Embedded(), subsets=1, subset_size=len(real))
    other.update(torch.from_numpy(real), real=True)
    other.update(torch.from_numpy(generated), real=False)
    found = kid(real, generated, subsets=1, subset_size=len(real), rng=np.random.default_rng(0))
    assert found.mean == pytest.approx(float(other.compute()[0]), rel=1e-6)


@pytest.mark.parametrize("top", [1, 2, 3])
def test_r_precision_is_the_hit_rate_of_torchmetrics(top: int):
    from torchmetrics.retrieval import RetrievalHitRate

    text = np.random.default_rng(1).normal(size=(4 * POOL, WIDTH))
    motion = text + np.random.default_rng(2).normal(size=text.shape)
    found = r_precision(text, motion, pool=POOL, rng=np.random.default_rng(3))
    other = RetrievalHitRate(top_k=top)
    for pool in found.clips.reshape(-1, POOL):
        near = -np.linalg.norm(text[pool][:, None] - motion[pool][None], axis=-1)  # (query, candidate)
        queries = torch.from_numpy(pool).repeat_interleave(POOL)
        other.update(torch.from_numpy(near.ravel()), torch.eye(POOL, dtype=torch.bool).ravel(), indexes=queries)
    assert 0 < found.at(top) < 1
    assert found.at(top) == pytest.approx(float(other.compute()))
