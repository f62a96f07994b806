"""The terms of the loss, against numbers computed by hand."""

from __future__ import annotations

import math

import pytest
import torch
from torch.distributions import Normal, kl_divergence

from marey.evaluator.losses import divergence, divergences, info_nce, latent_distance, reconstruction
from marey.evaluator.model import Gaussian


def gaussian(mean: float, log_variance: float) -> Gaussian:
    return Gaussian(torch.full((2, 3), mean), torch.full((2, 3), log_variance))


def test_reconstruction_is_smooth_l1_summed_over_frames_that_exist() -> None:
    target = torch.zeros(1, 3, 2)
    predicted = torch.tensor([[[0.5, 2.0], [0.0, -1.0], [100.0, 100.0]]])
    mask = torch.tensor([[True, True, False]])
    # 0.5²/2 + (2 - 1/2) + 0 + 1/2
    assert float(reconstruction(predicted, target, mask)) == pytest.approx(0.125 + 1.5 + 0.5)


def test_the_divergence_from_the_unit_gaussian_is_known() -> None:
    assert float(divergence(gaussian(0, 0))) == 0
    assert float(divergence(gaussian(2, 0))) == pytest.approx(0.5 * 4)
    assert float(divergence(gaussian(0, 1))) == pytest.approx(0.5 * (math.e - 1 - 1))


def test_divergences_are_those_of_torchs_distributions_in_all_four_directions() -> None:
    torch.manual_seed(0)
    motion, text = (Gaussian(torch.randn(4, 5), torch.randn(4, 5)) for _ in range(2))
    p, q = (Normal(each.mean, (0.5 * each.log_variance).exp()) for each in (motion, text))
    unit = Normal(torch.zeros(4, 5), torch.ones(4, 5))
    pairs = ((p, unit), (q, unit), (p, q), (q, p))
    torch.testing.assert_close(divergences(motion, text), sum(kl_divergence(a, b).mean() for a, b in pairs))


def test_the_latent_term_compares_means_and_ignores_variances() -> None:
    assert float(latent_distance(gaussian(0, 5), gaussian(0, -5))) == 0
    assert float(latent_distance(gaussian(3, 0), gaussian(0, 0))) == pytest.approx(2.5)


def test_info_nce_of_orthogonal_pairs_is_known() -> None:
    vectors = torch.tensor([[2.0, 0.0], [0.0, 7.0]])  # lengths must not matter
    loss = info_nce(vectors, torch.eye(2), torch.tensor([0, 1]), 1.0)
    assert float(loss) == pytest.approx(math.log(1 + math.exp(-1)))
    sharper = info_nce(vectors, torch.eye(2), torch.tensor([0, 1]), 0.1)
    assert float(sharper) == pytest.approx(math.log(1 + math.exp(-10)), rel=1e-3)


def test_info_nce_is_the_mean_of_both_directions() -> None:
    text, motion = torch.tensor([[1.0, 0.0], [1.0, 0.0]]), torch.eye(2)
    # text to motion: both sentences are the first motion's; motion to text: neither can be told apart
    forward = (math.log(1 + math.exp(-1)) + math.log(1 + math.exp(1))) / 2
    assert float(info_nce(text, motion, torch.tensor([0, 1]), 1.0)) == pytest.approx((forward + math.log(2)) / 2)


def test_a_negative_of_the_same_label_is_left_out() -> None:
    text = motion = torch.tensor([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    labels = torch.tensor([4, 4, 9])
    # for rows 0 and 1 the other one is no negative: one negative at cosine 0 is left; row 2 has two
    pair, lone = math.log(1 + math.exp(-1)), math.log(1 + 2 * math.exp(-1))
    assert float(info_nce(text, motion, labels, 1.0)) == pytest.approx((2 * pair + lone) / 3)
    unmasked = info_nce(text, motion, torch.tensor([0, 1, 2]), 1.0)
    assert float(unmasked) > float(info_nce(text, motion, labels, 1.0)) + 0.2
    assert float(info_nce(text, motion, None, 1.0)) == float(unmasked)


def test_a_batch_of_one_label_alone_teaches_nothing_and_breaks_nothing() -> None:
    text = torch.randn(3, 4, requires_grad=True)
    loss = info_nce(text, torch.randn(3, 4), torch.zeros(3, dtype=torch.long), 0.1)
    loss.backward()
    assert float(loss.detach()) == 0
    assert text.grad is not None
    assert float(text.grad.abs().max()) == 0


def test_cosines_keep_their_precision_under_autocast() -> None:
    torch.manual_seed(0)
    text, motion, labels = torch.randn(32, 64), torch.randn(32, 64), torch.arange(32)
    exact = info_nce(text, motion, labels, 0.1)
    with torch.autocast("cpu", dtype=torch.bfloat16):
        assert float(info_nce(text, motion, labels, 0.1)) == float(exact)
