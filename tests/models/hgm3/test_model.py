"""The networks: graph attention by hand, conditions, slots, tokenizer masks."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch

from marey.models.hgm3.conditions import (
    ACTION,
    LEVELS,
    MOTION,
    SPECIFIC,
    Condition,
    GraphAttention,
    TextNormalizer,
    graph_batch,
)
from marey.models.hgm3.config import PAPER, STARTER, TINY, named_config
from marey.models.hgm3.data import CaptionData
from marey.models.hgm3.model import LengthEstimator, LossPredictor, MaskedTransformer, ResidualTransformer
from marey.models.hgm3.tokenizer import Tokenizer
from marey.motion.features import HUMANML3D_263, layout
from marey.nn.motion_tokenizer import biased_std
from marey.nn.quantizer import Quantized
from marey.nn.ragged import pad_length
from marey.nn.sampling import guide
from marey.training.joints import heading_joints, world_joints
from marey.training.tokenizing import swing_weights, tokenizer_loss, world_share
from tests.support.prepared import graph, made_up_texts, swinging, text_features

CPU = torch.device("cpu")


def leaky(x: float) -> float:
    return x if x > 0 else 0.2 * x


def elu(x: float) -> float:
    return x if x > 0 else math.exp(x) - 1


def test_graph_attention_equals_equations_9_to_11_by_hand() -> None:
    torch.manual_seed(0)
    layer = GraphAttention(2, 0.0).eval().requires_grad_(False)
    nodes = torch.randn(1, 3, 2)
    # motion 0 – action 1 (type 11), action 1 – specific 2 (type 3), self-loops
    adjacency = torch.tensor([[[11, 11, -1], [11, 10, 3], [-1, 3, 10]]])
    found = layer(nodes, adjacency)
    w = layer.project.weight
    h = [(w @ nodes[0, i]).tolist() for i in range(3)]
    source, target = layer.source.weight.tolist(), layer.target.weight.tolist()

    def product(row: int, i: int, j: int) -> float:
        return sum(source[row][d] * h[i][d] + target[row][d] * h[j][d] for d in range(2))

    for i in range(3):
        logits = {
            j: leaky(product(0, i, j)) + leaky(product(1 + int(adjacency[0, i, j]), i, j))
            for j in range(3)
            if adjacency[0, i, j] >= 0
        }
        total = sum(math.exp(v) for v in logits.values())
        for d in range(2):
            mixed = sum(math.exp(v) / total * h[j][d] for j, v in logits.items())
            assert float(found[0, i, d]) == pytest.approx(elu(mixed) + float(nodes[0, i, d]), abs=1e-5)


def test_attention_sums_to_one_over_neighbours_and_ignores_others() -> None:
    torch.manual_seed(0)
    layer = GraphAttention(4, 0.0).eval()
    adjacency = torch.tensor([[[11, 11, -1], [11, 10, -1], [-1, -1, -1]]])
    attention = layer.attention(torch.randn(1, 3, 4), adjacency)
    torch.testing.assert_close(attention[0].sum(-1), torch.tensor([1.0, 1.0, 0.0]))
    assert attention[0, 0, 2] == 0


def test_the_type_of_an_edge_matters() -> None:
    torch.manual_seed(0)
    layer = GraphAttention(4, 0.0).eval()
    nodes = torch.randn(1, 2, 4)
    a = layer(nodes, torch.tensor([[[11, 0], [0, 10]]]))
    b = layer(nodes, torch.tensor([[[11, 4], [4, 10]]]))
    assert not torch.allclose(a, b)


def test_each_condition_reads_its_own_levels() -> None:
    condition = Condition(replace(TINY.condition, max_actions=2, max_specifics=3), 8)
    present = torch.tensor([[True, True, False, True, True, False]])
    seen = [condition.visible(present, level)[0].tolist() for level in (MOTION, ACTION, SPECIFIC)]
    assert seen[MOTION] == [True] + [False] * 5
    assert seen[ACTION] == [True, True] + [False] * 4
    assert seen[SPECIFIC] == [True, True, False, True, True, False]


def test_the_null_condition_is_one_token_and_the_same_at_all_levels() -> None:
    condition = Condition(TINY.condition, 8)
    torch.nn.init.normal_(condition.null)
    present = torch.ones(1, 25, dtype=torch.bool)
    dropped = torch.tensor([True])
    tokens = condition(torch.randn(1, 25, 384), dropped)
    assert torch.equal(tokens[0, 0], condition.null)
    for level in (MOTION, ACTION, SPECIFIC):
        assert condition.visible(present, level, dropped)[0].tolist() == [True] + [False] * 24


@pytest.mark.parametrize("name", ["masked", "predictor"])
@torch.inference_mode()
def test_a_prompt_without_actions_gives_no_nan_at_any_level(name: str) -> None:
    torch.manual_seed(0)
    graphs = graph_batch([text_features(0, 0), text_features(1, 3, 4)], TINY.condition, CPU)
    masked = MaskedTransformer(TINY).eval()
    model = masked if name == "masked" else LossPredictor(TINY).eval()
    nodes = masked.text(graphs)
    valid = torch.arange(8)[None] < torch.tensor([[8], [3]])
    for level in (MOTION, ACTION, SPECIFIC):
        visible = model.condition.visible(graphs.present, level)
        wanted = (valid,) if name == "masked" else ()
        output = model(torch.zeros(2, 8, dtype=torch.long), valid, model.condition(nodes), visible, *wanted)
        assert torch.isfinite(output[valid]).all()


@torch.inference_mode()
def test_absent_slots_and_tokens_beyond_the_clip_are_never_read() -> None:
    torch.manual_seed(0)
    model = MaskedTransformer(TINY).eval()
    valid = torch.arange(8)[None] < torch.tensor([[5]])
    visible = torch.zeros(1, 25, dtype=torch.bool)
    visible[0, [0, 1, 9]] = True
    tokens, condition = torch.randint(32, (1, 8)), torch.randn(1, 25, 32)
    first = model(tokens, valid, condition, visible, valid)[0, :5]
    condition[~visible] = 1000.0
    tokens[~valid] = 7
    assert torch.equal(model(tokens, valid, condition, visible, valid)[0, :5], first)
    assert torch.equal(model(tokens, valid, condition, visible, valid, trim=False)[0, :5], first)
    condition[0, 9] = torch.randn(32)
    assert not torch.equal(model(tokens, valid, condition, visible, valid)[0, :5], first)


@torch.inference_mode()
def test_padding_is_computed_only_without_trim() -> None:
    masked, residual = MaskedTransformer(TINY).eval(), ResidualTransformer(TINY).eval()
    valid, visible = torch.zeros(1, 40, dtype=torch.bool), torch.zeros(1, 25, dtype=torch.bool)
    valid[0, :5], visible[0, :3] = True, True
    lengths: list[int] = []
    for model in (masked, residual):
        transformer = model.sequence.transformer
        transformer.register_forward_pre_hook(lambda _, given: lengths.append(given[0].shape[1]))
    for options in ({}, {"trim": False}):
        masked(torch.zeros(1, 40, dtype=torch.long), valid, torch.randn(1, 25, 32), visible, valid, **options)
        residual(torch.randn(1, 40, 16), valid, torch.tensor([1]), residual.sentence(torch.randn(1, 384)), **options)
    multiple = masked.sequence.transformer.multiple
    assert lengths == [pad_length(size, multiple) for size in (5 + 3, 5 + 2, 40 + 25, 40 + 2)]


@torch.inference_mode()
def test_outputs_at_wanted_tokens_do_not_depend_on_how_many_are_wanted() -> None:
    torch.manual_seed(0)
    model = MaskedTransformer(TINY).eval()
    valid = torch.arange(24)[None] < torch.tensor([[20], [24]])
    wanted = torch.rand(2, 24) < 0.3
    visible = torch.zeros(2, 25, dtype=torch.bool)
    visible[:, :3] = True
    tokens, condition = torch.randint(33, (2, 24)), torch.randn(2, 25, 32)
    some = model(tokens, valid, condition, visible, wanted & valid)
    everything = model(tokens, valid, condition, visible, valid)
    torch.testing.assert_close(some[wanted & valid], everything[wanted & valid], atol=1e-5, rtol=1e-5)


@torch.inference_mode()
def test_a_slot_keeps_its_position_whatever_else_is_absent() -> None:
    torch.manual_seed(0)
    model = MaskedTransformer(TINY).eval()
    condition = torch.randn(1, 25, 32)
    condition[0, 2] = condition[0, 1]
    valid, tokens = torch.ones(1, 4, dtype=torch.bool), torch.zeros(1, 4, dtype=torch.long)
    outputs = []
    for slot in (1, 2):
        visible = torch.zeros(1, 25, dtype=torch.bool)
        visible[0, [0, slot]] = True
        outputs.append(model(tokens, valid, condition, visible, valid))
    assert not torch.allclose(outputs[0], outputs[1])


def test_residual_inputs_are_sums_of_lower_levels_and_nothing_above() -> None:
    torch.manual_seed(0)
    model = ResidualTransformer(TINY).eval()
    model.set_codebooks(torch.randn(3, 32, 16))
    tokens = torch.randint(32, (1, 4, 3))
    expected = sum(model.codebooks[v][tokens[..., v]] * model.code_std[v] / model.code_std[0] for v in (0, 1))
    torch.testing.assert_close(model.embed(tokens[..., 0], 0) + model.embed(tokens[..., 1], 1), expected)


def test_without_the_codes_of_the_tokenizer_each_level_has_an_embedding_of_its_own() -> None:
    model = ResidualTransformer(replace(TINY, compact=False)).eval()
    tokens = torch.randint(32, (1, 4))
    for level in (0, 1):
        torch.testing.assert_close(model.embed(tokens, level), model.embedding[level][tokens])
    assert not torch.equal(model.embed(tokens, 0), model.embed(tokens, 1))


@torch.inference_mode()
def test_a_sentence_is_standardised_by_the_statistics_of_sentences() -> None:
    normalizer = TextNormalizer(TINY.condition).eval()
    normalizer.mean.copy_(torch.arange(LEVELS)[:, None].expand(-1, 384) + 1.0)
    normalizer.std.fill_(2.0)
    torch.testing.assert_close(normalizer.sentence(torch.full((1, 384), 4.0)), torch.full((1, 384), (4.0 - 1.0) / 2.0))


@pytest.mark.parametrize("compact", [True, False])
@torch.inference_mode()
def test_the_residual_transformer_predicts_each_samples_own_level(compact: bool) -> None:
    torch.manual_seed(0)
    model = ResidualTransformer(replace(TINY, compact=compact)).eval()
    if compact:
        torch.nn.init.normal_(model.out_proj.weight)  # training starts at zero
    model.set_codebooks(torch.randn(3, 32, 16))
    total = torch.randn(1, 8, 16 if compact else 32).repeat(2, 1, 1)
    valid = torch.ones(2, 8, dtype=torch.bool)
    sentence = model.sentence(torch.randn(1, 384)).repeat(2, 1)
    both = model(total, valid, torch.tensor([1, 2]), sentence)
    assert both.shape == (2, 8, 32)
    torch.testing.assert_close(both[1:], model(total[:1], valid[:1], torch.tensor([2]), sentence[:1]))
    assert not torch.allclose(both[0], both[1])


def test_captions_in_slots_equal_the_graphs_own_slots_and_adjacency() -> None:
    texts = made_up_texts([2] * 6)
    data = CaptionData.of(texts, [(2,)] * 6, TINY.condition, CPU)
    for k in range(12):
        g = graph(k % 4, (k % 4 > 0) * (k % 5))
        slots = g.slots(8, 16)
        strings = [-1 if s < 0 else int(texts.node_string[texts.node_start[k] + s]) for s in slots]
        assert data.slots[k].tolist() == strings
        found = data.graphs(torch.tensor([k])).adjacency[0]
        assert found.tolist() == g.adjacency(8, 16).tolist()


def test_text_statistics_weigh_a_string_by_how_often_it_occurs() -> None:
    texts = made_up_texts([2] * 6)
    data = CaptionData.of(texts, [(2,)] * 6, TINY.condition, CPU)
    mean, std = data.statistics(range(6), TINY.condition)
    rows = texts.strings[texts.node_string[texts.node_level == 1]].astype("f8")
    torch.testing.assert_close(mean[ACTION], torch.from_numpy(rows.mean(0)).float(), atol=1e-5, rtol=1e-4)
    torch.testing.assert_close(std[ACTION], torch.from_numpy(rows.std(0)).float().clamp(min=1e-4), atol=1e-5, rtol=1e-4)


# ---- tokenizer


def tokenizer() -> Tokenizer:
    torch.manual_seed(0)
    model = Tokenizer(TINY).eval()
    model.quantizer.codebooks.normal_()
    return model


@torch.inference_mode()
def test_nothing_beyond_a_clips_own_length_leaks_into_it() -> None:
    model = tokenizer()
    features = torch.randn(1, 48, 263)
    other = features.clone()
    other[0, 20:] = 1000.0
    lengths = torch.tensor([20])
    tokens = model.encode(features, lengths)
    assert torch.equal(tokens, model.encode(other, lengths))
    assert (tokens[0, 5:] == -1).all()
    torch.testing.assert_close(tokens[:, :5], model.encode(features[:, :20]))


@torch.inference_mode()
def test_a_padded_clip_decodes_as_it_does_alone_and_is_zero_beyond() -> None:
    model = tokenizer()
    model.set_statistics(torch.randn(263), torch.rand(263) + 0.5)
    tokens = torch.randint(32, (1, 12, 3))
    alone = model.decode(tokens[:, :5])
    padded = model.decode(tokens, torch.tensor([5]))
    torch.testing.assert_close(padded[:, :20], alone, atol=1e-5, rtol=1e-5)
    assert not padded[:, 20:].any()


def test_the_loss_ignores_frames_beyond_the_clip() -> None:
    model = tokenizer()
    features = torch.randn(1, 48, 263)
    other = features.clone()
    other[0, 20:] = 1000.0
    lengths = torch.tensor([20])
    first, _ = tokenizer_loss(model, TINY, features, lengths)
    second, _ = tokenizer_loss(model, TINY, other, lengths)
    torch.testing.assert_close(first.total, second.total)


def test_the_term_in_space_rises_over_the_first_half_of_the_budget() -> None:
    model = tokenizer()
    features = torch.randn(2, 16, 263)
    shares = [world_share(fraction) for fraction in (0.0, 0.25, 0.5, 1.0)]
    totals = [float(tokenizer_loss(model, TINY, features, None, share)[0].total.detach()) for share in shares]
    assert totals[0] < totals[1] < totals[2]
    assert totals[2] == totals[3]


def test_joints_in_torch_equal_the_layouts_own_decoding() -> None:
    features = HUMANML3D_263.encode(swinging(50, 3))
    features[:, 0] += 0.02  # turning
    batch = torch.from_numpy(features)[None]
    torch.testing.assert_close(
        world_joints(batch, 22)[0], torch.from_numpy(HUMANML3D_263.decode(features)), atol=1e-4, rtol=1e-4
    )
    local = heading_joints(batch, 22)
    assert float(local[0, :, 0, [0, 2]].abs().max()) == 0


def test_the_bias_weighs_root_and_contacts_only() -> None:
    scaled = biased_std(torch.ones(263), 5.0)
    assert scaled[:4].tolist() == pytest.approx([0.2] * 4)
    assert scaled[-4:].tolist() == pytest.approx([0.2] * 4)
    assert (scaled[4:-4] == 1).all()


def test_paper_sizes_are_the_published_ones() -> None:
    t = PAPER.tokenizer
    assert (t.levels, t.codes, t.code_width, t.frames_per_token) == (6, 512, 512, 4)
    for c in (PAPER.masked, PAPER.predictor, PAPER.residual):
        assert (c.layers, c.heads, c.width, c.feedforward, c.dropout) == (6, 6, 384, 1024, 0.2)
    assert (PAPER.condition.max_actions, PAPER.condition.max_specifics) == (4, 8)
    i = PAPER.inference
    assert (i.steps, i.motion_steps, i.action_steps, i.guidance, i.top_k, i.residual_guidance) == (10, 2, 5, 4, 0.1, 5)
    assert PAPER.max_tokens == 49
    assert t.commitment == 0.02
    assert PAPER.condition.text_width == 512


def test_the_starter_bundle_fits_in_16_megabytes() -> None:
    from marey.models.hgm3.bundle import Networks
    from marey.nn.bundling import stored

    networks = Networks.build(STARTER).parts()
    kept = [v for n in networks.values() for k, v in n.state_dict().items() if stored(k)]
    assert sum(2 * v.numel() for v in kept) < 16e6


def test_every_configuration_builds() -> None:
    from marey.models.hgm3.bundle import Networks

    for name in ("starter", "tiny"):
        Networks.build(named_config(name))


@pytest.mark.parametrize("compact", [True, False])
@torch.inference_mode()
def test_guidance_in_front_of_the_last_matrix_equals_guidance_of_logits(compact: bool) -> None:
    torch.manual_seed(0)
    config = replace(TINY, compact=compact)
    masked, residual = MaskedTransformer(config).eval(), ResidualTransformer(config).eval()
    residual.set_codebooks(torch.randn(3, 32, 16))
    torch.nn.init.normal_(residual.bias)
    if compact:
        torch.nn.init.normal_(residual.out_proj.weight)
    valid = torch.arange(8)[None].repeat(4, 1) < torch.tensor([[5], [8], [5], [8]])
    visible = torch.zeros(4, 25, dtype=torch.bool)
    visible[:, 0] = True
    visible[:2, 1:3] = True  # the first half has more to read
    inputs = torch.randint(33, (2, 8)).repeat(2, 1), valid, torch.randn(4, 25, 32), visible, valid
    with_condition, without = masked(*inputs).chunk(2)
    found = masked(*inputs, guidance=4.0)
    torch.testing.assert_close(found[valid[:2]], guide(with_condition, without, 4.0)[valid[:2]])
    inputs = torch.randn(4, 8, 16 if compact else 32), valid, torch.full((4,), 2), torch.randn(4, 32)
    with_condition, without = residual(*inputs).chunk(2)
    found = residual(*inputs, guidance=5.0)
    torch.testing.assert_close(found[valid[:2]], guide(with_condition, without, 5.0)[valid[:2]], atol=1e-4, rtol=1e-4)


def test_logits_of_mixed_levels_are_those_of_each_level_alone() -> None:
    torch.manual_seed(0)
    model = ResidualTransformer(replace(TINY, compact=False)).eval().requires_grad_(False)
    model.bias.normal_()
    total, valid = torch.randn(1, 8, 32).repeat(2, 1, 1), torch.ones(2, 8, dtype=torch.bool)
    sentence = model.sentence(torch.randn(2, 384))
    both = model(total, valid, torch.tensor([1, 2]), sentence)
    for row, level in enumerate((1, 2)):
        alone = model(total[row : row + 1], valid[:1], torch.tensor([level]), sentence[row : row + 1])
        torch.testing.assert_close(both[row : row + 1], alone, rtol=1e-4, atol=1e-4)


def test_features_are_normalized_by_mean_and_deviation_and_restored() -> None:
    tokenizer = Tokenizer(TINY)
    mean, std = torch.randn(TINY.features), torch.rand(TINY.features) + 0.5
    tokenizer.set_statistics(mean, std)
    torch.testing.assert_close(tokenizer.normalize(mean + 2 * std), torch.full((TINY.features,), 2.0))
    torch.testing.assert_close(tokenizer.restore(tokenizer.normalize(mean + 3)), mean + 3)


def test_graph_attention_drops_neighbours_in_training_alone() -> None:
    torch.manual_seed(0)
    layer = GraphAttention(4, 0.5)
    nodes, adjacency = torch.randn(1, 3, 4), torch.full((1, 3, 3), 3)
    layer.eval()
    assert torch.equal(layer(nodes, adjacency), layer(nodes, adjacency))
    layer.train()
    assert not torch.equal(layer(nodes, adjacency), layer(nodes, adjacency))


def test_the_null_condition_replaces_the_first_token_of_dropped_samples() -> None:
    torch.manual_seed(0)
    condition = Condition(TINY.condition, 8).eval()
    condition.null.data.fill_(7.0)
    nodes = torch.randn(2, TINY.condition.slots, TINY.condition.text_width)
    plain, some = condition(nodes), condition(nodes, torch.tensor([True, False]))
    assert torch.equal(some[1], plain[1])
    assert torch.equal(some[0, 1:], plain[0, 1:])
    assert (some[0, 0] == 7.0).all()


def test_errors_of_swinging_joints_weigh_what_the_configuration_says() -> None:
    names = layout("humanml3d-263").skeleton.joint_names
    weights = swing_weights("humanml3d-263", torch.device("cpu"), 4.0)
    assert float(weights.mean()) == pytest.approx(1.0)
    assert float(weights[names.index("L_wrist")] / weights[names.index("L_knee")]) == pytest.approx(4.0)
    heavy = replace(TINY, tokenizer=replace(TINY.tokenizer, swing_weight=4.0))
    model, features = tokenizer().eval(), torch.randn(2, 16, 263)
    model.forward = lambda *_: (model.normalize(moved), quantized)  # type: ignore[method-assign]
    errors: dict[str, list[float]] = {}
    for joint in ("L_wrist", "L_knee"):
        moved = features.clone()
        moved[..., 4 + 3 * (names.index(joint) - 1)] += 1.0
        quantized = Quantized(features, torch.zeros(2, 4, 3).long(), torch.zeros(()), torch.ones(3))
        found = [tokenizer_loss(model, config, features)[0] for config in (TINY, heavy)]
        errors[joint] = [float(loss.position) for loss in found] + [float(loss.features) for loss in found]
    wrist, knee = errors["L_wrist"], errors["L_knee"]
    assert wrist[0] == pytest.approx(knee[0])
    assert wrist[1] == pytest.approx(4 * knee[1])
    assert wrist[3] == pytest.approx(4 * wrist[2], rel=0.5)
    assert knee[3] < knee[2]


def test_the_length_estimator_has_a_layer_for_each_width() -> None:
    config = replace(TINY, length_hidden=(24, 16, 8))
    network = LengthEstimator(config)
    widths = [layer.weight.shape[::-1] for layer in network.layers if isinstance(layer, torch.nn.Linear)]
    assert widths == [(config.condition.text_width, 24), (24, 16), (16, 8), (8, config.max_tokens)]
    assert network(torch.zeros(2, config.condition.text_width)).shape == (2, config.max_tokens)
