"""Residual quantizer with learnable scales (MoSA-VQ)."""

from __future__ import annotations

import pytest
import torch
from torch import nn

from marey.nn.quantizer import ResidualQuantizer
from marey.nn.scaled_quantizer import MIN_SCALE, Scale, ScaledQuantizer
from marey.training.loop import _decay_groups


def quantizer(scale: Scale = "elementwise", *, moved: bool = True) -> ScaledQuantizer:
    """Three levels of 8 codes, 4 wide; `moved` takes scales and biases away from identity."""
    torch.manual_seed(0)
    made = ScaledQuantizer(3, 8, 4, dropout=0.0, scale=scale)
    made.codebooks.normal_()
    made.sums.copy_(made.codebooks * 10)
    made.counts.fill_(10.0)
    made.initialized.fill_(True)
    if moved:
        for parameter in (*made.scales, *made.biases):
            parameter.data.add_(0.3 * torch.randn_like(parameter))
    return made


def loss_of(output: torch.Tensor) -> torch.Tensor:
    weight = torch.linspace(-1, 2, output.numel()).view(output.shape).to(output)
    return (weight * output).sum() + output.square().sum()


@pytest.mark.parametrize("scale", ["elementwise", "scalar"])
def test_scales_and_biases_get_the_gradient_of_decoding(scale: Scale) -> None:
    q = quantizer(scale).eval().double()
    latent = torch.randn(2, 5, 4, dtype=torch.float64)
    result = q(latent)
    loss_of(result.output).backward()
    for parameter in (*q.scales, *q.biases):
        assert parameter.grad is not None
        for i in range(parameter.numel()):
            at, step = float(parameter.data[i]), 1e-5
            values: list[torch.Tensor] = []
            for moved in (at + step, at - step):
                parameter.data[i] = moved
                values.append(loss_of(q.decode(result.tokens)))
            parameter.data[i] = at
            slope = float((values[0] - values[1]).detach()) / (2 * step)
            assert abs(slope) > 1e-3
            assert float(parameter.grad[i]) == pytest.approx(slope, rel=1e-3, abs=1e-3)


def test_the_latent_gets_the_gradient_of_the_output_once() -> None:
    q = quantizer().eval()
    latent = torch.randn(2, 5, 4, requires_grad=True)
    q(latent).output.sum().backward()
    torch.testing.assert_close(latent.grad, torch.ones_like(latent))


def test_commitment_reaches_every_level_of_the_latent_and_no_scale() -> None:
    q = quantizer().eval()
    latent = torch.randn(2, 5, 4, requires_grad=True)
    result = q(latent)
    result.commitment.backward()
    residual, expected = latent.detach(), torch.zeros(())
    for level in range(3):
        residual = residual - q.restored(q.codebooks[level][result.tokens[..., level]], level)
        expected = expected + residual.square().mean()
    torch.testing.assert_close(result.commitment, expected)
    assert latent.grad is not None
    assert latent.grad.abs().sum() > 0
    assert all(p.grad is None for p in q.parameters())


@pytest.mark.parametrize("scale", ["elementwise", "scalar", "none"])
def test_it_starts_as_the_plain_quantizer(scale: Scale) -> None:
    q = quantizer(scale, moved=False).train()
    plain = ResidualQuantizer(3, 8, 4, dropout=0.0)
    plain.load_state_dict({k: v for k, v in q.state_dict().items() if k.split(".")[0] not in {"scales", "biases"}})
    latent = torch.randn(2, 50, 4)
    for _ in range(3):
        torch.manual_seed(1)
        mine = q(latent)
        torch.manual_seed(1)
        theirs = plain.train()(latent)
        assert torch.equal(mine.tokens, theirs.tokens)
        assert torch.equal(mine.commitment, theirs.commitment)
        torch.testing.assert_close(mine.output, theirs.output)
    assert torch.equal(q.codebooks, plain.codebooks)


def test_without_scale_nothing_is_learnt_by_gradient() -> None:
    assert list(quantizer("none").parameters()) == []
    assert float(quantizer("none").regularizer().detach()) == 0


def test_a_scale_never_divides_by_less_than_its_floor() -> None:
    q = quantizer()
    q.scales[1].data.copy_(torch.tensor([0.0, -0.01, -2.0, 1.0]))
    restored = q.restored(q.biases[1] + torch.ones(4), 1)
    torch.testing.assert_close(restored, torch.tensor([1 / MIN_SCALE, 1 / MIN_SCALE, 0.5, 1.0]))


def test_the_regularizer_rests_at_identity() -> None:
    assert float(quantizer(moved=False).regularizer().detach()) == 0
    q = quantizer()
    expected = sum(
        float(((s - 1).square().mean() + b.square().mean()).detach()) for s, b in zip(q.scales, q.biases, strict=True)
    )
    assert float(q.regularizer().detach()) == pytest.approx(expected)


def test_the_training_loop_decays_neither_scales_nor_biases() -> None:
    parameters = list(quantizer().parameters())
    decayed, spared = _decay_groups(parameters, 0.01)
    assert decayed["params"] == []
    assert len(spared["params"]) == len(parameters) == 6


def test_scales_stay_near_one_over_a_training() -> None:
    torch.manual_seed(0)
    encoder, decoder = nn.Linear(6, 4), nn.Linear(4, 6)
    q = ScaledQuantizer(3, 16, 4).train()
    parameters = [*encoder.parameters(), *decoder.parameters(), *q.parameters()]
    optimizer = torch.optim.AdamW(_decay_groups(parameters, 0.01), lr=8e-3)
    spread = torch.tensor([3.0, 1.0, 1.0, 0.3, 0.1, 0.03])
    losses: list[float] = []
    for _ in range(500):
        features = torch.randn(4, 16, 6) * spread
        result = q(encoder(features))
        error = (decoder(result.output) - features).abs().mean()
        loss = error + 0.02 * result.commitment + 0.02 * q.regularizer()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(error.detach()))
        assert all(float(s.detach().min()) > 0.2 and float(s.detach().max()) < 5 for s in q.scales)
    assert sum(losses[-100:]) < 0.7 * sum(losses[:100])
    assert max(float((s.detach() - 1).abs().max()) for s in q.scales) > 0.02  # they do learn


def test_codebooks_decay_as_told() -> None:
    made = ScaledQuantizer(2, 8, 4, decay=0.61, dropout=0.37, revive=3.0)
    assert (made.decay, made.dropout, made.revive) == (0.61, 0.37, 3.0)
