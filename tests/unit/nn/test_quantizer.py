"""Residual quantizer."""

from __future__ import annotations

import torch

from marey.nn.quantizer import NO_TOKEN, ResidualQuantizer, _draw


def quantizer(levels: int = 3, codes: int = 8, width: int = 4, **options: float) -> ResidualQuantizer:
    torch.manual_seed(0)
    made = ResidualQuantizer(levels, codes, width, **{"dropout": 0.0, **options})
    made.codebooks.normal_()
    made.sums.copy_(made.codebooks * 10)
    made.counts.fill_(10.0)
    made.initialized.fill_(True)
    return made


def test_each_level_takes_the_nearest_code_of_what_the_levels_below_left() -> None:
    q = quantizer(levels=2, codes=2, width=1)
    q.codebooks.copy_(torch.tensor([[[0.0], [10.0]], [[-1.0], [2.0]]]))
    tokens = q.eval().encode(torch.tensor([[[9.2], [1.9]]]))
    assert tokens.tolist() == [[[1, 0], [0, 1]]]  # 9.2 = 10 - 1 + .2; 1.9 = 0 + 2 - .1
    torch.testing.assert_close(q.decode(tokens), torch.tensor([[[9.0], [2.0]]]))


def test_decoding_what_was_encoded_equals_the_output_of_the_forward_pass() -> None:
    q = quantizer().eval()
    latent = torch.randn(2, 5, 4)
    result = q(latent)
    torch.testing.assert_close(result.output, q.decode(result.tokens))
    assert torch.equal(result.tokens, q.encode(latent))


def test_the_gradient_passes_straight_through_once_however_many_levels_there_are() -> None:
    q = quantizer().eval()
    latent = torch.randn(2, 5, 4, requires_grad=True)
    q(latent).output.sum().backward()
    torch.testing.assert_close(latent.grad, torch.ones_like(latent))


def test_commitment_pulls_latents_and_never_codes() -> None:
    q = quantizer().train()
    latent = torch.randn(2, 5, 4, requires_grad=True)
    q(latent).commitment.backward()
    assert latent.grad is not None
    assert latent.grad.abs().sum() > 0
    assert not q.codebooks.requires_grad


def test_codes_move_by_the_moving_average_of_what_chose_them() -> None:
    q = quantizer(levels=1, codes=2, width=1, decay=0.9, revive=0.0)
    q.codebooks.copy_(torch.tensor([[[0.0], [10.0]]]))
    q.sums.copy_(torch.tensor([[[0.0], [40.0]]]))
    q.counts.copy_(torch.tensor([[4.0, 4.0]]))
    q.train()(torch.tensor([[[9.0], [9.0], [1.0]]]))
    torch.testing.assert_close(q.counts, torch.tensor([[0.9 * 4 + 0.1 * 1, 0.9 * 4 + 0.1 * 2]]))
    torch.testing.assert_close(q.codebooks[0, 1], torch.tensor([(36 + 1.8) / (3.6 + 0.2)]))
    torch.testing.assert_close(q.codebooks[0, 0], torch.tensor([0.1 / 3.7]))


def test_a_dead_code_becomes_a_vector_of_the_batch() -> None:
    q = quantizer(levels=1, codes=3, width=2)
    q.codebooks[0] = torch.tensor([[0.0, 0.0], [100.0, 100.0], [1.0, 1.0]])
    q.sums[0] = q.codebooks[0] * q.counts[0][:, None]
    q.counts[0, 1] = 0.5  # under one vector a batch: dead
    q.sums[0, 1] = 50.0
    latent = torch.rand(1, 6, 2)
    q.train()(latent)
    assert (latent[0] == q.codebooks[0, 1]).all(-1).any()
    assert q.counts[0, 1] == 1.0


def test_the_first_batch_fills_empty_codebooks() -> None:
    q = ResidualQuantizer(2, 8, 4, dropout=0.0)
    latent = torch.randn(4, 16, 4)
    assert q.train()(latent).perplexity[0] > 4
    assert bool(q.initialized)


def test_dropped_levels_have_no_token_and_add_nothing() -> None:
    q = quantizer(dropout=1.0).train()
    result = q(torch.randn(64, 2, 4))
    dropped = result.tokens == NO_TOKEN
    assert not dropped[..., 0].any()
    assert dropped[..., 2].all()
    assert dropped[:, 0, 1].any()
    assert not dropped[:, 0, 1].all()
    assert (dropped[..., 2:] >= dropped[..., 1:2]).all()  # never a level above a dropped one


def test_positions_beyond_a_clip_come_out_as_zeros_and_train_nothing() -> None:
    valid = torch.tensor([[True, True, False]])
    latent = torch.randn(1, 3, 4)
    other = latent.clone()
    other[0, 2] = 1000.0
    a, b = quantizer().train(), quantizer().train()
    torch.manual_seed(1)
    first = a(latent, valid)
    torch.manual_seed(1)
    second = b(other, valid)
    assert torch.equal(first.output, second.output)
    assert not first.output[0, 2].any()
    assert first.tokens[0, 2].tolist() == [NO_TOKEN] * 3
    assert torch.equal(a.codebooks, b.codebooks)
    assert torch.equal(first.commitment, second.commitment)


def test_codes_drawn_from_too_few_vectors_differ_by_a_hundredth() -> None:
    torch.manual_seed(0)
    drawn = _draw(torch.ones(2, 64), torch.ones(2, dtype=torch.bool), 4000)
    assert 0.9 < float((drawn - 1).norm(dim=-1).mean() / 0.01) < 1.1


def test_a_revived_code_is_reset_again_unless_the_next_batch_chooses_it() -> None:
    q = quantizer(levels=1, codes=3, width=1, decay=0.5, revive=1.0)
    q.codebooks.copy_(torch.tensor([[[0.0], [50.0], [90.0]]]))
    q.sums.copy_(q.codebooks * 4)
    q.counts.copy_(torch.tensor([[4.0, 1.0, 1.0]]))
    q.train()(torch.zeros(1, 4, 1))
    assert q.counts[0].tolist() == [4, 1, 1]
    assert q.codebooks[0, 1:].abs().max() < 0.1, "both were far away, and are where the vectors are"
    q.codebooks[0, 1] = q.sums[0, 1] = 7.0
    q.codebooks[0, 2] = q.sums[0, 2] = 60.0
    q(torch.tensor([[[0.0], [0.0], [7.0], [7.0]]]))
    assert q.codebooks[0, 1] == 7, "chosen by two vectors"
    assert q.codebooks[0, 2] < 8, "chosen by none"
