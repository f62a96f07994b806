"""The losses, and that networks trained on them do what they were taught."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
import torch.nn.functional as F

from marey.models.mogo.config import TINY, MOGOConfig
from marey.models.mogo.level_token import build_transformer
from marey.models.mogo.losses import LevelSums, ahead_loss, level_sums, scale_penalty
from marey.models.mogo.model import NOT_ASKED, next_targets
from marey.models.mogo.tokenizer import Tokenizer
from marey.training.tokenizing import tokenizer_loss

from .networks import TOLD_BY_TOKEN, columns, opened, prompts, transformer

LEVELS, CODES = TINY.tokenizer.levels, TINY.tokenizer.codes


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
    for _ in range(60):
        loss, _ = tokenizer_loss(model, TINY, clips, torch.tensor([24, 24, 20, 16]), world=0.0)
        optimizer.zero_grad()
        (loss.total + scale_penalty(model, TINY.tokenizer)).backward()
        optimizer.step()
        losses.append(float(loss.features))
    assert sum(losses[-10:]) < 0.75 * sum(losses[:10])


def test_sums_are_those_of_the_whole_forward_and_count_what_was_asked() -> None:
    model, tokens, lengths = transformer(), columns(12, 3), torch.tensor([12, 7, 10])
    skipped, ends = torch.tensor([0, 5, 0]), torch.tensor([True, True, False])
    targets = next_targets(tokens, lengths, model.end, ends=ends, skipped=skipped)
    logits = model(prompts(3), tokens, skipped=skipped)
    wanted = F.cross_entropy(logits.flatten(0, 2), targets.flatten(), ignore_index=NOT_ASKED, reduction="none")
    sums = level_sums(model, model.states(prompts(3), tokens, skipped=skipped), targets)
    torch.testing.assert_close(sums.losses, wanted.view(targets.shape).sum((0, 2)))
    assert sums.asked.tolist() == [30, *[28] * (LEVELS - 1)]  # two ends at level 0, no first frame of the second clip
    right = (logits.argmax(-1) == targets) & (targets != NOT_ASKED)
    assert torch.equal(sums.right, right.sum((0, 2)))


def test_asked_of_a_share_of_frames_level_0_is_the_same_and_the_others_have_fewer() -> None:
    model, tokens = transformer(), columns(20, 3)
    states = model.states(prompts(3), tokens)
    targets = next_targets(tokens, torch.tensor([20, 20, 16]), model.end)
    full, part, none = (level_sums(model, states, targets, share) for share in (1.0, 0.5, 0.0))
    for sums in (part, none):
        torch.testing.assert_close(sums.losses[0], full.losses[0])
        assert sums.asked[0] == full.asked[0]
    assert 0 < part.asked[1] == part.asked[-1] < full.asked[1]
    assert none.asked[1:].tolist() == none.losses[1:].tolist() == [0] * (LEVELS - 1)
    together = full + part
    assert torch.equal(together.asked, full.asked + part.asked)


def test_level_0_weighs_as_much_as_it_is_told() -> None:
    sums = LevelSums(torch.tensor([2.0, 6.0, 0.0]), torch.tensor([0, 0, 0]), torch.tensor([2, 3, 0]))
    assert sums.means.tolist() == [1, 2, 0]
    assert float(sums.loss(1.0)) == pytest.approx(1.0)
    assert float(sums.loss(4.0)) == pytest.approx((4 * 1 + 2) / 6)


def test_what_is_asked_ahead_lies_so_far_ahead_and_never_behind_a_steer() -> None:
    model = transformer(replace(TINY, ahead=(3,)))
    with torch.no_grad():  # a state whose number k is loud says code k
        model.ahead[0].weight.copy_(torch.eye(TINY.transformer.width))
        model.ahead[0].bias.zero_()
        model.head.weight.zero_()
        model.head.bias.zero_()
        model.head.weight[: CODES - 1].copy_(60 * torch.eye(TINY.transformer.width)[: CODES - 1])
    tokens = torch.arange(10)[None, :, None].repeat(1, 1, LEVELS)
    targets = next_targets(tokens, torch.tensor([10]), model.end)  # of state k: code k
    knows = torch.eye(TINY.transformer.width)[3:14].view(1, 11, 1, -1)  # state k: code k + 3
    assert float(ahead_loss(model, knows, targets, None, 1.0).detach()) < 1e-3
    assert float(ahead_loss(model, knows.roll(1, 1), targets, None, 1.0).detach()) > 10
    targets[:, :, 5:10] = 30  # behind the seam: unpredictable from before it
    assert float(ahead_loss(model, knows, targets, None, 1.0).detach()) > 10
    before = targets.clone()
    before[:, :, 8:] = NOT_ASKED  # what states behind the seam are asked
    assert float(ahead_loss(model, knows, before, torch.tensor([5]), 1.0)) < 1e-3
    assert float(ahead_loss(model, knows, before, None, 1.0)) > 10
    assert float(ahead_loss(model, knows[:, :3], targets[..., :3], None, 1.0)) == 0  # too short to ask anything


@pytest.mark.parametrize("base", [TINY, pytest.param(TOLD_BY_TOKEN, marks=pytest.mark.slow)])
def test_a_trained_network_streams_what_its_prompt_asks_for_and_ends(base: MOGOConfig) -> None:
    """Two prompts, two clips of different length, learnt by heart: training forward, cache, targets and END agree."""
    certain = replace(TINY.inference, temperature=0.0, upper_temperature=0.0)
    still = replace(base.transformer, dropout=0.0)
    config = replace(
        base, corruption=0.0, inference=certain, transformer=still, condition=replace(TINY.condition, drop=0.0)
    )
    torch.manual_seed(0)
    model = build_transformer(config).train()
    tokens, lengths = columns(18, 2), torch.tensor([18, 11])
    tokens[1, 11:] = -1
    targets = next_targets(tokens, lengths, model.end)
    optimizer = torch.optim.Adam(model.parameters(), lr=3e-3)
    for _ in range(150):
        loss = level_sums(model, model.states(prompts(2), tokens), targets).loss(1.0)
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
