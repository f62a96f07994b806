"""RQHC-Transformer: relative positions by hand, causality, levels, prompts, targets."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from marey.core.errors import InvalidInput
from marey.models.mogo.attention import RelativeAttention
from marey.models.mogo.config import PAPER, STARTER, TINY, MOGOConfig
from marey.models.mogo.model import (
    NOT_ASKED,
    DurationRegression,
    RQHCTransformer,
    Trunk,
    corrupt,
    in_force,
    next_targets,
)
from marey.models.mogo.packed_model import PackedModel, sessions_of_product
from marey.models.mogo.plan import EARLIEST, NEVER, ActionPlan

from .networks import columns, prompts, transformer

LEVELS, CODES = TINY.tokenizer.levels, TINY.tokenizer.codes
FLAT = replace(TINY, depth=replace(TINY.depth, layers=0))
JOINT = replace(TINY, transformer=replace(TINY.transformer, joint=True))


def test_attention_equals_equation_9_by_hand() -> None:
    torch.manual_seed(0)
    attention = RelativeAttention(6, 2).requires_grad_(False)
    torch.nn.init.normal_(attention.u)
    torch.nn.init.normal_(attention.v)
    trunk = Trunk(replace(TINY.transformer, width=6, heads=2), 9)
    model = transformer()
    reach = model.reach(3)
    x = torch.randn(1, 4, 6)
    found = attention(x, attention.terms(trunk.sinusoids), reach)
    query, key, value = (part[0] for part in attention.project(x))  # (4, 2, 3)
    phi = attention.relative(trunk.sinusoids).view(10, 2, 3)
    u, v = attention.u.view(2, 3), attention.v.view(2, 3)
    for i in range(4):
        mixed = torch.zeros(2, 3)
        for h in range(2):
            seen = range(i + 1)  # position 0 is the prompt, and every frame may read it
            scores = [
                float(query[i, h] @ key[j, h] + query[i, h] @ phi[i - j, h] + u[h] @ key[j, h] + v[h] @ phi[i - j, h])
                / math.sqrt(3)
                for j in seen
            ]
            weights = torch.tensor(scores).softmax(0)
            mixed[h] = sum(weights[j] * value[j, h] for j in seen)
        torch.testing.assert_close(found[0, i], attention.out(mixed.flatten()), atol=1e-5, rtol=1e-4)


def test_a_frame_is_predicted_from_earlier_frames_alone() -> None:
    model, tokens = transformer(), columns(20)
    other = tokens.clone()
    other[:, 12:] = (other[:, 12:] + 1) % CODES
    first, second = model(prompts(1), tokens), model(prompts(1), other)
    # the depth head reads the frame it predicts, so frame 13 differs on the levels above 0
    torch.testing.assert_close(first[:, :, :12], second[:, :, :12])
    torch.testing.assert_close(first[:, 0, 12], second[:, 0, 12])
    assert not torch.allclose(first[:, :, 13], second[:, :, 13])


def test_level_l_reads_levels_up_to_l_of_the_past() -> None:
    model, tokens = transformer(FLAT), columns(10)
    for level in range(1, LEVELS):
        other = tokens.clone()
        other[:, 4, level] = (other[:, 4, level] + 1) % CODES
        first, second = model(prompts(1), tokens), model(prompts(1), other)
        assert torch.equal(first[:, :level], second[:, :level])
        assert not torch.allclose(first[:, level, 5:], second[:, level, 5:])


def test_with_a_depth_head_level_l_reads_the_codes_below_it_and_no_other() -> None:
    model, tokens = transformer(), columns(6)
    at = 3  # codes of frame 4 change; the logits of frame 4 stand at index 3
    for level in range(LEVELS):
        other = tokens.clone()
        other[:, at, level] = (other[:, at, level] + 1) % CODES
        first, second = model(prompts(1), tokens)[:, :, at], model(prompts(1), other)[:, :, at]
        torch.testing.assert_close(first[:, : level + 1], second[:, : level + 1])
        for above in range(level + 1, LEVELS):
            assert not torch.allclose(first[:, above], second[:, above])


def test_one_lane_for_all_levels_reads_whole_frames_of_the_past_and_nothing_later() -> None:
    model, tokens = transformer(JOINT), columns(10)
    for level in range(LEVELS):
        other = tokens.clone()
        other[:, 4, level] = (other[:, 4, level] + 1) % CODES
        first, second = model(prompts(1), tokens), model(prompts(1), other)
        torch.testing.assert_close(first[:, :, :4], second[:, :, :4])
        torch.testing.assert_close(first[:, : level + 1, 4], second[:, : level + 1, 4])
        for any_level in range(LEVELS):
            assert not torch.allclose(first[:, any_level, 5:], second[:, any_level, 5:])


def test_until_trained_later_frames_are_predicted_as_the_next_one() -> None:
    assert TINY.ahead
    for layer in RQHCTransformer(TINY).ahead:
        torch.testing.assert_close(layer.weight, torch.eye(TINY.transformer.width))


def test_the_usual_duration_is_learned_whatever_the_features_are() -> None:
    regression = DurationRegression(TINY)
    regression.fit(torch.zeros(2, TINY.condition.text_width), torch.tensor([21, 21]))
    assert regression(torch.zeros(1, TINY.condition.text_width)).tolist() == [21]


def test_one_lane_for_all_levels_needs_a_depth_head() -> None:
    with pytest.raises(InvalidInput, match="needs a depth head"):
        replace(JOINT, depth=replace(JOINT.depth, layers=0))


def test_an_untrained_depth_head_leaves_levels_independent() -> None:
    model = RQHCTransformer(TINY)
    states = torch.randn(2, LEVELS, TINY.transformer.width)
    torch.testing.assert_close(model.refine(states, columns(2)[0, :, :-1]), states)


def test_level_gains_tell_which_level_a_code_came_from() -> None:
    swapped = torch.tensor([[[3, 5, 7]], [[5, 3, 7]]])
    plain = transformer(replace(TINY, transformer=replace(TINY.transformer, level_gain=False)))
    torch.testing.assert_close(*plain.columns(swapped)[:, -1])
    told = transformer().columns(swapped)[:, -1]
    assert not torch.allclose(told[0], told[1])


def test_only_level_0_can_end_a_clip() -> None:
    probability = transformer()(prompts(2), columns(5, 2)).softmax(-1)[..., -1]
    assert (probability[:, 0] > 0).all()
    assert not probability[:, 1:].any()


def test_position_0_is_prompt_plus_level() -> None:
    model = transformer()
    text = prompts(2)[:, 0]
    expected = model.prompt.project((text - model.prompt.mean) / model.prompt.std)
    found, told = model.prompt(text)
    for level in range(LEVELS):
        torch.testing.assert_close(found[:, level], expected + model.prompt.level.weight[level])
    assert told.shape == (2, TINY.transformer.width)


def test_a_dropped_prompt_is_the_same_whatever_it_said() -> None:
    model = transformer()
    dropped = torch.tensor([True, True])
    found, told = model.prompt(prompts(2)[:, 0], dropped)
    assert torch.equal(found[0], found[1])
    assert not told.any()
    never = replace(TINY, condition=replace(TINY.condition, drop=1.0), corruption=0.0)
    trained = transformer(replace(never, transformer=replace(TINY.transformer, dropout=0.0))).train()
    tokens = columns(5).expand(2, -1, -1)
    logits = trained(prompts(2), tokens)
    torch.testing.assert_close(logits[0], logits[1])


def test_the_second_prompt_takes_over_at_the_seam_and_reaches_nothing_before() -> None:
    # without a clock: that begins anew at the seam
    model, tokens = transformer(replace(TINY, condition=replace(TINY.condition, clock=False))), columns(12, 2)
    old, new = prompts(2), prompts(2, seed=1)
    both = model(torch.cat([old, new], 1), tokens, seam=torch.tensor([5, 9]))
    alone, after = model(old, tokens), model(new, tokens)
    for row, seam in enumerate((5, 9)):
        torch.testing.assert_close(both[row, :, :seam], alone[row, :, :seam])
        assert not torch.allclose(both[row, :, seam], alone[row, :, seam])
        assert not torch.allclose(both[row, :, seam], after[row, :, seam])  # the past was made under the old prompt
    first = model(torch.cat([old, new], 1), tokens, seam=torch.tensor([1, 1]))
    torch.testing.assert_close(first[:, :, 1:], after[:, :, 1:])


def test_frames_cut_off_move_the_prompt_away_and_no_further_than_was_trained() -> None:
    model, tokens = transformer(), columns(6, 2)
    near = model(prompts(2), tokens)
    cut = model(prompts(2), tokens, skipped=torch.tensor([0, 7]))
    torch.testing.assert_close(cut[0], near[0])
    assert not torch.allclose(cut[1, :, 1:], near[1, :, 1:])
    far = [model(prompts(2), tokens, skipped=torch.tensor([n, n])) for n in (TINY.max_frames, 10**6)]
    assert torch.equal(*far)


def test_longer_sequences_than_were_trained_are_refused() -> None:
    with pytest.raises(ValueError, match="25 frames exceed the 24"):
        transformer()(prompts(1), columns(25))


def test_a_prompt_that_only_position_0_carries_adds_nothing_to_the_frames() -> None:
    model = transformer(replace(TINY, condition=replace(TINY.condition, every_frame=False)))
    assert model.prompt.tell is None
    assert not model.prompt(prompts(2)[:, 0])[1].any()


def test_each_frame_is_told_the_prompt_of_the_frame_that_it_predicts() -> None:
    told = [torch.tensor([[1.0], [1.0]]), torch.tensor([[2.0], [2.0]])]
    found = in_force(told, 4, torch.tensor([1, 3]))[..., 0]
    assert found.tolist() == [
        [2, 2, 2, 2],
        [1, 1, 2, 2],
    ]  # frames 1 to 4; behind frame 3 comes the second prompt's first
    assert in_force(told[:1], 4, None).shape == (2, 1, 1)


def test_some_samples_lose_single_frames_and_others_whole_stretches() -> None:
    torch.manual_seed(0)
    hit = (corrupt(columns(200, 400), CODES, 0.8) != columns(200, 400)).any(-1)
    changes = (hit[:, 1:] != hit[:, :-1]).sum(1)
    share = hit.float().mean(1)
    some = (share > 0.3) & (share < 0.7)
    assert int((changes[some] > 60).sum()) > 20  # one by one: about 2 p (1 - p) of 200
    assert int((changes[some] < 30).sum()) > 20


def test_corruption_replaces_whole_columns_at_a_rate_of_each_sample() -> None:
    torch.manual_seed(0)
    tokens = columns(200, 400)
    tokens[:, 150:] = -1
    changed = corrupt(tokens, CODES, 0.5) != tokens
    assert not changed[:, 150:].any()
    rates = changed[:, :150].any(-1).float().mean(1)
    assert 0.23 < float(rates.mean()) < 0.27
    assert float(rates.std()) > 0.1  # U(0, 0.5) has 0.14, a flat rate of single frames 0.04
    hit = changed.any(-1)
    assert float(changed[hit].float().mean()) == pytest.approx(1 - 1 / CODES, abs=0.01)


def test_training_corrupts_inputs_and_running_does_not() -> None:
    still = replace(TINY, condition=replace(TINY.condition, drop=0.0))
    model = transformer(replace(still, transformer=replace(TINY.transformer, dropout=0.0)))
    tokens = columns(20)
    quiet = model(prompts(1), tokens)
    assert torch.equal(quiet, model(prompts(1), tokens))
    assert not torch.allclose(model.train()(prompts(1), tokens), quiet)


def test_targets_ask_for_the_next_frame_and_for_the_end_of_whole_clips() -> None:
    tokens = torch.arange(2 * 4 * 3).view(2, 4, 3)
    lengths, ends = torch.tensor([4, 2]), torch.tensor([False, True])
    targets = next_targets(tokens, lengths, 99, ends=ends)
    assert targets[0, 0].tolist() == [0, 3, 6, 9, NOT_ASKED]
    assert targets[1, 0].tolist() == [12, 15, 99, NOT_ASKED, NOT_ASKED]
    assert targets[1, 2].tolist() == [14, 17, NOT_ASKED, NOT_ASKED, NOT_ASKED]
    cropped = next_targets(tokens, lengths, 99, ends=ends, skipped=torch.tensor([30, 0]))
    assert (cropped[0, :, 0] == NOT_ASKED).all()
    assert torch.equal(cropped[0, :, 1:], targets[0, :, 1:])
    assert torch.equal(cropped[1], targets[1])


def test_padding_changes_no_logit() -> None:
    model, tokens = transformer(), columns(9)
    padded = torch.cat([tokens, tokens.new_full((1, 6, LEVELS), -1)], 1)
    torch.testing.assert_close(model(prompts(1), padded)[:, :, :9], model(prompts(1), tokens)[:, :, :9])


def test_every_weight_learns() -> None:
    model = transformer().train()
    tokens = columns(12, 4)
    logits = model(torch.cat([prompts(4), prompts(4, seed=1)], 1), tokens, seam=torch.tensor([3, 4, 5, 6]))
    targets = next_targets(tokens, torch.tensor([12, 9, 12, 5]), model.end)
    torch.nn.functional.cross_entropy(logits.flatten(0, 2), targets.flatten(), ignore_index=NOT_ASKED).backward()
    silent = {n for n, p in model.named_parameters() if p.grad is None or not p.grad.any()}
    assert silent <= {"prompt.null", "ahead.0.weight", "ahead.0.bias"}  # 10 % of the samples; a loss of their own


@pytest.mark.parametrize(("config", "millions"), [(PAPER, 226), (STARTER, 2.1)])
def test_the_trunk_has_the_size_it_is_named_for(config: MOGOConfig, millions: float) -> None:
    with torch.device("meta"):
        trunk = Trunk(config.transformer, config.max_frames)
    read = sum(p.numel() for n, p in trunk.named_parameters() if "relative" not in n)  # φ is computed once
    assert read / 1e6 == pytest.approx(millions, rel=0.01)


def test_an_act_takes_as_long_as_acts_that_were_said_alike() -> None:
    torch.manual_seed(0)
    pace, features = DurationRegression(TINY), torch.randn(2000, TINY.condition.text_width)
    assert pace(features[:2]).tolist() == [TINY.max_frames] * 2  # 4 s, before it has learnt; no longer than is trained
    pace.fit(features, 20 * torch.exp(0.1 * features[:, 0]))
    said = torch.zeros(3, TINY.condition.text_width)
    said[:, 0] = torch.tensor([0.0, -1.0, 50.0])
    assert pace(said).tolist() == [20, 18, TINY.max_frames]


def test_a_clock_begins_without_effect_and_may_be_left_out() -> None:
    torch.manual_seed(0)
    with_clock = RQHCTransformer(TINY)
    assert with_clock.clock is not None
    assert not with_clock.clock.project.weight.any()
    assert RQHCTransformer(replace(TINY, condition=replace(TINY.condition, clock=False))).clock is None


def test_large_models_take_several_sessions_in_one_product(monkeypatch: pytest.MonkeyPatch) -> None:
    model = transformer()
    assert sessions_of_product(model, 5) == 1
    monkeypatch.setattr("marey.nn.packed.SMALL", 1)
    assert [sessions_of_product(model, sessions) for sessions in (5, 20)] == [5, 8]


def test_an_action_may_end_some_time_after_it_began() -> None:
    plan = ActionPlan.of(torch.zeros(2, 4), 0, [40, NEVER])
    plan.take(100)
    assert plan.until == 140
    assert plan.earliest == 100 + int(EARLIEST * 40) > 100
    plan.take(150)
    assert plan.earliest == 150


@pytest.mark.parametrize("exact", [True, False])
def test_logits_of_a_large_head_are_rounded_only_in_bundles_of_earlier_releases(
    exact: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    try:
        torch.ops.mkldnn._reorder_linear_weight(torch.zeros(8, 8, dtype=torch.bfloat16), None)
    except RuntimeError:
        pytest.skip("this processor has no instructions for matrices in bfloat16")
    monkeypatch.setattr("marey.nn.packed.SMALL", 1)
    packed = PackedModel(transformer(replace(TINY, float_logits=exact)), dtype=torch.bfloat16)
    logits = packed.network.head(torch.randn(1, 6, TINY.transformer.width))
    assert logits.dtype == torch.float32
    assert torch.equal(logits, logits.bfloat16().float()) is not exact


def test_a_configuration_without_the_field_draws_as_before() -> None:
    values = TINY.to_dict()
    del values["float_logits"]
    assert "split_actions" not in values  # at its default earlier releases need not know it
    assert MOGOConfig(split_actions=False).to_dict()["split_actions"] is False
    read = MOGOConfig.from_dict(values)
    assert (read.float_logits, read.split_actions) == (False, True)
