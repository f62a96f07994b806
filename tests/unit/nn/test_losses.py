"""Losses of hard token mining."""

from __future__ import annotations

import math

import torch

from marey.nn.losses import hits, ranking_loss, token_losses


def test_token_loss_is_the_negative_log_likelihood() -> None:
    logits = torch.tensor([[[0.0, math.log(3.0)]]])
    torch.testing.assert_close(token_losses(logits, torch.tensor([[1]])), torch.tensor([[math.log(4 / 3)]]))


def test_ranking_loss_equals_the_sum_of_the_paper_over_ordered_pairs_divided_by_their_number() -> None:
    torch.manual_seed(0)
    predicted, losses = torch.randn(1, 5), torch.rand(1, 5)
    masked = torch.tensor([[True, True, False, True, True]])
    total, pairs = 0.0, 0
    for i in range(5):
        for j in range(5):
            if i == j or not (masked[0, i] and masked[0, j]):
                continue
            sigma = 1 / (1 + math.exp(-float(predicted[0, i] - predicted[0, j])))
            total -= math.log(sigma) if losses[0, i] > losses[0, j] else math.log(1 - sigma)
            pairs += 1
    assert pairs == 12
    torch.testing.assert_close(ranking_loss(predicted, losses, masked), torch.tensor([total / pairs]))


def test_ranking_loss_is_zero_where_fewer_than_two_tokens_are_masked() -> None:
    masked = torch.tensor([[True, False, False], [False, False, False]])
    predicted = torch.randn(2, 3, requires_grad=True)
    loss = ranking_loss(predicted, torch.rand(2, 3), masked)
    assert loss.tolist() == [0.0, 0.0]
    loss.sum().backward()
    assert torch.isfinite(predicted.grad).all()


def test_ranking_loss_falls_when_the_order_is_right_and_trains_the_prediction_only() -> None:
    losses = torch.tensor([[1.0, 2.0, 3.0]], requires_grad=True)
    masked = torch.ones(1, 3, dtype=torch.bool)
    right = torch.tensor([[-2.0, 0.0, 2.0]], requires_grad=True)
    wrong = ranking_loss(torch.tensor([[2.0, 0.0, -2.0]]), losses, masked)
    good = ranking_loss(right, losses, masked)
    assert good < wrong
    good.sum().backward()
    assert losses.grad is None
    assert right.grad is not None


def test_unmasked_tokens_do_not_matter() -> None:
    masked = torch.tensor([[True, True, False]])
    a = ranking_loss(torch.tensor([[0.0, 1.0, 5.0]]), torch.tensor([[1.0, 2.0, 0.0]]), masked)
    b = ranking_loss(torch.tensor([[0.0, 1.0, -5.0]]), torch.tensor([[1.0, 2.0, 9.0]]), masked)
    assert torch.equal(a, b)


def test_a_tie_counts_by_its_chance() -> None:
    logits = torch.tensor([[0.0, 2.0, 2.0, 1.0], [3.0, 1.0, 1.0, 1.0], [5.0, 5.0, 5.0, 5.0]])
    found = torch.stack([hits(logits, torch.full((3,), code)) for code in range(4)], 1)
    torch.testing.assert_close(found, torch.tensor([[0, 0.5, 0.5, 0], [1, 0, 0, 0], [0.25, 0.25, 0.25, 0.25]]))
