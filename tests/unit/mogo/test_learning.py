"""The losses, and that networks trained on them do what they were taught."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from workers.mogo.config import TINY
from workers.mogo.losses import scale_penalty, sequence_loss
from workers.mogo.model import NOT_ASKED, RQHCTransformer, next_targets
from workers.mogo.tokenizer import Tokenizer
from workers.training.tokenizing import tokenizer_loss

from .networks import columns, opened, prompts

LEVELS = TINY.tokenizer.levels


def test_the_tokenizer_is_held_to_identity_by_gamma() -> None:
    torch.manual_seed(0)
    model = Tokenizer(TINY).eval()
    model.quantizer.codebooks.normal_()
    free = replace(TINY, tokenizer=replace(TINY.tokenizer, regularizer=0.0))
    held = replace(TINY, tokenizer=replace(TINY.tokenizer, regularizer=3.0))
    for scale in model.quantizer.scales:
        scale.data.fill_(1.5)
    gap = scale_penalty(model, held.tokenizer) - scale_penalty(model, free.tokenizer)
    assert float(gap.detach()) == pytest.approx(3 * LEVELS * 0.25, rel=1e-3)


def test_the_tokenizer_learns_to_give_motion_back() -> None:
    torch.manual_seed(0)
    model = Tokenizer(TINY).train()
    time = torch.arange(24)[:, None] / 5
    clips = torch.stack([torch.sin(time * (1 + 0.2 * i) + torch.arange(TINY.features) / 20) for i in range(4)])
    optimizer = torch.optim.Adam(model.parameters(), lr=2e-3)
    losses: list[float] = []
    for _ in range(120):
        loss, _ = tokenizer_loss(model, TINY, clips, torch.tensor([24, 24, 20, 16]), fraction=0.0)
        optimizer.zero_grad()
        (loss.total + scale_penalty(model, TINY.tokenizer)).backward()
        optimizer.step()
        losses.append(float(loss.features))
    assert sum(losses[-10:]) < 0.6 * sum(losses[:10])


def test_the_loss_of_a_sequence_counts_what_was_asked() -> None:
    targets = torch.full((2, LEVELS, 4), NOT_ASKED)
    targets[0, 0, 0], targets[1, 2, 3] = 5, 1
    logits = torch.zeros(2, LEVELS, 4, 33)
    logits[1, 2, 3, 1] = 4.0
    loss, levels = sequence_loss(logits, targets)
    certain = math.log(32 + math.exp(4)) - 4
    assert levels.tolist() == pytest.approx([math.log(33), 0, certain])
    assert float(loss) == pytest.approx((math.log(33) + certain) / 2)


def test_a_trained_network_streams_what_its_prompt_asks_for_and_ends() -> None:
    """Two prompts, two clips of different length, learnt by heart: training forward, cache, targets and END agree."""
    certain = replace(TINY.inference, temperature=0.0, upper_temperature=0.0)
    still = replace(TINY.transformer, dropout=0.0)
    config = replace(
        TINY, corruption=0.1, inference=certain, transformer=still, condition=replace(TINY.condition, drop=0.0)
    )
    torch.manual_seed(0)
    model = RQHCTransformer(config).train()
    tokens, lengths = columns(18, 2), torch.tensor([18, 11])
    tokens[1, 11:] = -1
    targets = next_targets(tokens, lengths, model.end)
    optimizer = torch.optim.Adam(model.parameters(), lr=3e-3)
    for _ in range(150):
        loss, _ = sequence_loss(model(prompts(2), tokens), targets)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    streams = opened(model, 2)
    for row in range(2):
        streams.start(prompts(2)[row, 0], row, ends_from=0)
    drawn = torch.stack([torch.stack(list(streams.step().values())) for _ in range(19)], 1)  # (2, 19, V)
    for row, length in enumerate((18, 11)):
        assert torch.equal(drawn[row, :length], tokens[row, :length])
        assert (drawn[row, length:] == -1).all()
