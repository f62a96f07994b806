"""The training objective and the decoding of HGM³, term by term: each test fails when its term is left out."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from marey.data.prepared import PreparedData
from marey.models.hgm3 import decoding
from marey.models.hgm3.conditions import ACTION, MOTION, SPECIFIC
from marey.models.hgm3.config import TINY, HGM3Config
from marey.models.hgm3.data import CaptionData
from marey.models.hgm3.decoding import DecodeOptions, Items
from marey.models.hgm3.generate import Generator
from marey.models.hgm3.model import MaskedTransformer
from marey.models.hgm3.stage_masked import MaskedSample, MaskedStage, _pieces
from marey.models.hgm3.stage_residual import ResidualSample, ResidualStage, piece_losses
from marey.models.hgm3.tokenizer import Tokenizer
from marey.training.motions import MotionData, TokenData
from marey.training.stages import StepContext
from marey.training.texts import CaptionTexts
from marey.training.tokenizing import TokenizerStage, tokenizer_loss
from tests.support.prepared import text_features
from tests.support.recording import assert_recordable

CPU = torch.device("cpu")
STILL = replace(TINY.condition, dropout=0.0, noise=0.0)
"""Conditions without draws of torch."""


def encoded(prepared: PreparedData, config: HGM3Config) -> tuple[Tokenizer, TokenData, CaptionData]:
    """A random tokenizer, the clips as its tokens, and their captions."""
    torch.manual_seed(0)
    tokenizer = Tokenizer(config)
    tokenizer.quantizer.codebooks.normal_()
    captions = CaptionData.of(CaptionTexts.load(prepared), prepared.caption_counts, config.condition, CPU)
    return tokenizer, TokenData.encode(tokenizer, MotionData.load(prepared.path, CPU)), captions


def masked_stage(prepared: PreparedData, config: HGM3Config = TINY) -> MaskedStage:
    _, tokens, captions = encoded(prepared, config)
    stage = MaskedStage(config, prepared.clips, tokens, captions)
    for parameter in stage.module.parameters():  # away from the zeros at which training starts
        parameter.data.add_(0.1 * torch.randn_like(parameter))
    return stage


def drawn_sample(stage: MaskedStage, batch: int = 4) -> MaskedSample:
    rng = np.random.default_rng(0)
    return stage.sample(stage.pairs.draw(rng, batch), rng)


def test_the_share_of_hard_tokens_rises_linearly_over_the_budget(prepared: PreparedData) -> None:
    """Eq. 8: alpha goes from its start to its end with the fraction of the budget used."""
    mining = replace(TINY.mining, mask="hard", alpha_start=0.1, alpha_end=0.7)
    stage = masked_stage(prepared, replace(TINY, mining=mining))
    used: list[float] = []
    masks = stage.masks

    def watched(sample: MaskedSample, nodes: torch.Tensor, alpha: float) -> torch.Tensor:
        used.append(alpha)
        return masks(sample, nodes, alpha)

    stage.masks = watched  # type: ignore[method-assign]
    for fraction, alpha in ((0.0, 0.1), (0.25, 0.25), (1.0, 0.7)):
        used.clear()
        stage.loss(StepContext(0, fraction, np.random.default_rng(0)))
        assert used == pytest.approx([alpha] * len(used))
        assert used


def test_a_step_trains_the_motion_action_and_specific_level(prepared: PreparedData) -> None:
    """Eq. 7 and 12: F reads one slot level more for each level of mining."""
    stage = masked_stage(prepared, replace(TINY, mining=replace(TINY.mining, levels_per_step=3)))
    condition = stage.module.masked.condition
    lowest = condition.config.max_actions
    seen: list[tuple[bool, bool]] = []
    forward = stage.module.masked.forward

    def watched(tokens: torch.Tensor, valid: torch.Tensor, text: torch.Tensor, visible: torch.Tensor, *rest, **trim):
        seen.append((bool(visible[:, 1 : 1 + lowest].any()), bool(visible[:, 1 + lowest :].any())))
        return forward(tokens, valid, text, visible, *rest, **trim)

    stage.module.masked.forward = watched  # type: ignore[method-assign]
    stage.config = replace(stage.config, condition=replace(stage.config.condition, drop=0.0))
    stage.loss(StepContext(0, 0.0, np.random.default_rng(0)))
    assert set(seen) == {(False, False), (True, False), (True, True)}


def test_one_level_a_step_is_drawn_evenly(prepared: PreparedData) -> None:
    levels = drawn_sample(masked_stage(prepared), 600).level
    counts = torch.bincount(levels, minlength=3).tolist()
    assert len(counts) == 3
    assert min(counts) > 150, counts


def test_the_predictor_is_dropped_with_the_transformer(prepared: PreparedData) -> None:
    """A dropped condition hides the graph from G too: its answer is the same for any other prompt."""
    stage = masked_stage(prepared)
    stage.module.eval()  # no dropout: equal inputs give equal bits
    sample = drawn_sample(stage).at_level(SPECIFIC)
    valid = sample.tokens >= 0
    one, other = torch.randn(2, 4, TINY.condition.slots, TINY.condition.text_width)
    for dropped in (True, False):
        asked = replace(sample, dropped=torch.full((4,), dropped))
        first = stage._predict(stage.module.predictor, asked, one, valid)
        second = stage._predict(stage.module.predictor, asked, other, valid)
        assert torch.equal(first, second) is dropped


def test_the_predictor_reads_the_tokens(prepared: PreparedData) -> None:
    """Eq. 5: G sees the unmasked tokens; other tokens, other difficulties."""
    stage = masked_stage(prepared)
    stage.module.eval()  # no dropout: equal inputs give equal bits
    sample = drawn_sample(stage).at_level(SPECIFIC)
    valid = sample.tokens >= 0
    nodes = torch.randn(4, TINY.condition.slots, TINY.condition.text_width)
    shifted = replace(sample, tokens=torch.where(valid, (sample.tokens + 1) % TINY.tokenizer.codes, sample.tokens))
    first = stage._predict(stage.module.predictor, sample, nodes, valid)
    assert not torch.allclose(first, stage._predict(stage.module.predictor, shifted, nodes, valid))


def test_the_residual_input_holds_nothing_of_the_level_it_predicts(prepared: PreparedData) -> None:
    """App. A.2: level v + 1 from the levels up to v; a higher level that changes leaves the input as it is."""
    tokenizer, tokens, captions = encoded(prepared, TINY)
    stage = ResidualStage(TINY, prepared.clips, tokens, captions, tokenizer.codebooks)
    mean, std = captions.statistics(stage.pairs.train.tolist(), TINY.condition)
    assert torch.equal(stage.module.normalizer.mean, mean)
    assert torch.equal(stage.module.normalizer.std, std)
    inputs: list[torch.Tensor] = []
    forward = stage.module.forward

    def watched(total: torch.Tensor, *rest: torch.Tensor, trim: bool) -> torch.Tensor:
        inputs.append(total)
        return forward(total, *rest, trim=trim)

    stage.module.forward = watched  # type: ignore[method-assign]
    codes = torch.randint(TINY.tokenizer.codes, (2, 8, TINY.tokenizer.levels))
    lengths, dropped = torch.full((2,), 8), torch.zeros(2, dtype=torch.bool)
    sentences = torch.randn(2, TINY.condition.text_width)
    for level in range(1, TINY.tokenizer.levels):
        levels = torch.full((2,), level)
        above, below = codes.clone(), codes.clone()
        above[..., level:] = (above[..., level:] + 1) % TINY.tokenizer.codes
        below[..., level - 1] = (below[..., level - 1] + 1) % TINY.tokenizer.codes
        inputs.clear()
        for given in (codes, above, below):
            piece_losses(stage.module, ResidualSample(given, lengths, sentences, levels, dropped))
        assert torch.equal(inputs[0], inputs[1])
        assert not torch.equal(inputs[0], inputs[2])


def test_the_commitment_is_part_of_the_tokenizers_objective() -> None:
    """Eq. 2, second term: beta times the distance to the chosen codes."""
    torch.manual_seed(0)
    model = Tokenizer(TINY).eval()
    model.quantizer.codebooks.normal_()
    features = torch.randn(2, 16, TINY.features)
    totals: list[float] = []
    for beta in (0.0, 2.0):
        config = replace(TINY, tokenizer=replace(TINY.tokenizer, commitment=beta))
        loss, quantized = tokenizer_loss(model, config, features)
        totals.append(float(loss.total.detach()))
    assert float(quantized.commitment.detach()) > 0
    assert totals[1] - totals[0] == pytest.approx(2 * float(quantized.commitment.detach()), rel=1e-3)
    assert TINY.tokenizer.commitment > 0


def test_the_commitment_pulls_the_encoder_towards_the_codes() -> None:
    torch.manual_seed(0)
    model = Tokenizer(TINY).eval()
    model.quantizer.codebooks.normal_()
    _, quantized = model(torch.randn(2, 16, TINY.features))
    quantized.commitment.backward()
    grads = [p.grad for p in model.encoder.parameters()]
    assert any(g is not None and bool(g.any()) for g in grads)


# ---- decoding


def test_without_guidance_the_null_branch_alone_decides_and_reads_no_prompt(generator: Generator) -> None:
    """Guidance 0 is the null branch: its tokens are the same whatever was asked for."""
    from marey.generation.port import Request

    unguided = replace(generator.settings({}), guidance=0.0, residual_guidance=0.0)
    made = [generator.generate([Request(text_features(k, 2, 3), 7, 40)], unguided)[0] for k in (0, 5)]
    guided = [generator.generate([Request(text_features(k, 2, 3), 7, 40)])[0] for k in (0, 5)]
    assert all(each is not None for each in (*made, *guided))
    assert np.array_equal(made[0].tokens, made[1].tokens)  # type: ignore[union-attr]
    assert not np.array_equal(guided[0].tokens, guided[1].tokens)  # type: ignore[union-attr]


@torch.inference_mode()
def test_the_null_branch_reads_its_one_slot(monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    model = MaskedTransformer(TINY).eval()
    asked: list[torch.Tensor] = []
    forward = model.forward
    monkeypatch.setattr(
        model, "forward", lambda *inputs, **named: (asked.append(inputs[3]), forward(*inputs, **named))[1]
    )
    items = _items(2, 8)
    base = torch.full((2, 8), model.mask_token)
    valid = torch.ones(2, 8, dtype=torch.bool)
    for level in (MOTION, ACTION, SPECIFIC):
        decoding._base_logits(model, items, base, valid, level, 4.0, DecodeOptions())
    for visible in asked:
        assert visible[2:].sum(1).tolist() == [1, 1]
        assert visible[2:, 0].all()
    assert [int(visible[:2].sum()) for visible in asked] == [2, 2 * (1 + 8), 2 * (1 + 8 + 16)]


@torch.inference_mode()
def test_a_pass_keeps_the_most_confident_tokens(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sec. 3.4: the least confident are masked again."""
    model = MaskedTransformer(TINY).eval()
    sure = torch.tensor([5.0, 1.0, 9.0, 3.0, 7.0, 2.0, 8.0, 4.0])
    logits = torch.zeros(1, 8, TINY.tokenizer.codes)
    logits[0, :, 3] = sure
    monkeypatch.setattr(decoding, "_base_logits", lambda *_: logits)
    config = replace(TINY.inference, temperature=0.0)
    base = torch.full((1, 8), model.mask_token)
    filled = decoding._base_pass(model, _items(1, 8), base, torch.tensor([5]), 1, MOTION, config, DecodeOptions())
    assert (filled[0] == 3).nonzero().flatten().tolist() == [2, 4, 6]
    assert int((filled == model.mask_token).sum()) == 5
    kept = decoding._base_pass(model, _items(1, 8), filled, torch.tensor([2]), 2, MOTION, config, DecodeOptions())
    assert (kept[0] == 3).nonzero().flatten().tolist() == [0, 2, 3, 4, 6, 7]


def _items(batch: int, size: int) -> Items:
    slots = TINY.condition.slots
    return Items(
        lengths=torch.full((batch,), size),
        seeds=torch.arange(batch),
        condition=torch.randn(batch, slots, TINY.masked.width),
        present=torch.ones(batch, slots, dtype=torch.bool),
        sentence=torch.zeros(batch, TINY.residual.width),
        free=torch.zeros(batch, dtype=torch.bool),
        tokens=torch.full((batch, size, TINY.tokenizer.levels), -1),
        kept=torch.zeros(batch, size, dtype=torch.bool),
        decided=torch.zeros(batch, 3, dtype=torch.long),
    )


@pytest.mark.parametrize(
    ("random", "mask", "kinds"), [(0.0, 1.0, {"mask"}), (0.0, 0.5, {"mask", "same"}), (0.5, 1.0, {"mask", "other"})]
)
def test_masked_tokens_are_shown_as_mask_as_another_or_as_they_are(random: float, mask: float, kinds: set[str]) -> None:
    torch.manual_seed(0)
    config = replace(TINY, mining=replace(TINY.mining, replace_random=random, replace_mask=mask))
    stage = SimpleNamespace(
        config=config, module=SimpleNamespace(masked=SimpleNamespace(mask_token=config.tokenizer.codes))
    )
    targets = torch.zeros(4, 100, dtype=torch.long)
    masked = torch.arange(100).expand(4, 100) < 50
    shown = MaskedStage._shown(stage, targets, masked)  # pyright: ignore[reportArgumentType]
    assert not shown[~masked].any()
    names = {config.tokenizer.codes: "mask", 0: "same"}
    assert {names.get(int(token), "other") for token in shown[masked]} - ({"same"} if random else set()) == kinds


def test_the_first_code_is_a_target_like_any_other(prepared: PreparedData) -> None:
    stage = masked_stage(prepared)
    stage.module.masked.head.bias.data.fill_(-50).index_fill_(0, torch.tensor([0]), 50.0)
    sample = drawn_sample(stage)
    valid = sample.tokens >= 0
    losses, masked, right, _ = stage.piece(replace(sample, tokens=torch.where(valid, 0, -1)), 0.0)
    assert masked.any()
    assert right[masked].all()
    assert float(losses[masked].detach().max()) < 1e-3


def test_validation_keeps_every_condition(prepared: PreparedData) -> None:
    """The share of dropped conditions is of training alone."""
    stage = masked_stage(prepared)
    stage.module.eval()
    kept = stage.validate()
    stage.config = replace(stage.config, condition=replace(stage.config.condition, drop=1.0))
    assert stage.validate() == kept


@pytest.mark.parametrize("size", [1, 3])
def test_gradients_of_parts_add_up_to_those_of_the_batch(prepared: PreparedData, size: int) -> None:
    plain = replace(TINY, condition=replace(TINY.condition, dropout=0.0), **{
        name: replace(getattr(TINY, name), dropout=0.0) for name in ("masked", "predictor", "residual")
    })  # fmt: skip
    stage = masked_stage(prepared, replace(plain, train_masked=replace(TINY.train_masked, batch=7)))
    found: list[dict[str, torch.Tensor]] = []
    for split in (False, True):
        stage.module.zero_grad()
        drawn = StepContext(0, 0.5, np.random.default_rng(0))
        for loss, _ in stage.parts(drawn, size) if split else [stage.loss(drawn)]:
            loss.backward()
        found.append({name: each.grad for name, each in stage.module.named_parameters() if each.grad is not None})
    whole, parts = found
    assert whole.keys() == parts.keys()
    for name, wanted in whole.items():
        torch.testing.assert_close(parts[name], wanted, atol=1e-6, rtol=1e-4, msg=name)


def test_both_transformers_learn_the_phases_and_speeds_that_are_asked_for(prepared: PreparedData) -> None:
    """One sequence of tokens a clip, from its first frame, and no clips at other speeds than captured."""
    tokenizer, tokens, captions = encoded(prepared, TINY)
    slower = [clip.model_copy(update={"speed": 0.85}) if k % 2 else clip for k, clip in enumerate(prepared.clips)]
    for phases, speeds in ((1, False), (4, True)):
        config = replace(TINY, phases=phases, speeds=speeds)
        masked = MaskedStage(config, slower, tokens, captions)
        residual = ResidualStage(config, slower, tokens, captions, tokenizer.codebooks)
        for stage in (masked, residual):
            assert bool(np.any(stage.pairs.train % 2)) == speeds
            assert stage.tokens.phases == phases
            assert torch.equal(stage.tokens.starts, tokens.starts[:, :phases])


def test_random_masks_do_not_train_the_loss_predictor(prepared: PreparedData) -> None:
    for mask, trained in (("random", False), ("hard", True)):
        stage = masked_stage(prepared, replace(TINY, mining=replace(TINY.mining, mask=mask)))
        loss, logs = stage.loss(StepContext(0, 0.5, np.random.default_rng(0)))
        loss.backward()
        assert all((p.grad is not None) == trained for p in stage.module.predictor.parameters())
        assert (float(logs["ranking"]) > 0) == trained


def test_steps_of_both_transformers_and_the_tokenizer_can_be_recorded(prepared: PreparedData) -> None:
    config = replace(TINY, mining=replace(TINY.mining, mask="random"))
    tokenizer, tokens, captions = encoded(prepared, config)
    assert_recordable(MaskedStage(config, prepared.clips, tokens, captions))
    codebooks = tokenizer.quantizer.codebooks
    assert_recordable(ResidualStage(config, prepared.clips, tokens, captions, codebooks))
    assert_recordable(TokenizerStage(config, MotionData.load(prepared.path, CPU), tokenizer))


@pytest.mark.parametrize("conditions", ["all", "specific"])
def test_a_padded_batch_has_the_loss_of_its_pieces(prepared: PreparedData, conditions: str) -> None:
    mining = replace(TINY.mining, mask="random", conditions=conditions)
    config = replace(TINY, mining=mining, masked=replace(TINY.masked, dropout=0.0), condition=STILL)
    stage = masked_stage(prepared, config)
    batch = stage.batch(StepContext(0, 0.0, np.random.default_rng(0)))
    losses, masked, right, _ = zip(*(stage.piece(piece, 0.0) for each in batch for piece in _pieces(each)), strict=True)
    asked = sum(each.sum() for each in masked)
    loss, logs = stage.batch_loss(batch)
    assert batch[0].tokens.shape[1] == config.max_tokens > int(batch[0].lengths.max())
    torch.testing.assert_close(loss, sum((a * b).sum() for a, b in zip(losses, masked, strict=True)) / asked)
    assert float(logs["accuracy"]) == pytest.approx(
        float(sum((a * b).sum() for a, b in zip(right, masked, strict=True)) / asked)
    )


def test_a_padded_batch_of_the_residual_stage_has_the_loss_of_its_pieces(prepared: PreparedData) -> None:
    config = replace(TINY, residual=replace(TINY.residual, dropout=0.0))
    tokenizer, tokens, captions = encoded(prepared, config)
    stage = ResidualStage(config, prepared.clips, tokens, captions, tokenizer.quantizer.codebooks)
    (loss, logs), (padded, shown) = (
        make(StepContext(0, 0.0, np.random.default_rng(0)))
        for make in (stage.loss, lambda context: stage.batch_loss(stage.batch(context)))
    )
    torch.testing.assert_close(padded, loss)
    assert float(shown["accuracy"]) == pytest.approx(float(logs["accuracy"]))


def test_both_transformers_learn_parts_of_walks_and_are_judged_by_whole_ones(prepared: PreparedData) -> None:
    config = replace(TINY, crops=1.0)
    tokenizer, tokens, captions = encoded(prepared, config)
    masked = MaskedStage(config, prepared.clips, tokens, captions)
    residual = ResidualStage(config, prepared.clips, tokens, captions, tokenizer.codebooks)
    walks = [int(c) for c in masked.pairs.train if prepared.clips[c].content == "walk" and not prepared.clips[c].seams]
    longest = max(walks, key=lambda c: int(tokens.lengths[c, 0]))
    clips, whole = np.full(64, longest), set(tokens.lengths[longest].tolist())
    rng = np.random.default_rng(0)
    for learned, judged in (
        (masked.sample(clips, rng).lengths, masked.sample(clips, rng, drop=False).lengths),
        (residual._draw(clips, rng, None).lengths, residual._draw(clips, rng, 1).lengths),
    ):
        assert min(learned.tolist()) == config.min_tokens
        assert len(set(learned.tolist())) > 10
        assert set(judged.tolist()) == whole
