"""Training: every stage runs on tiny data, resumes bit for bit, and ends in a bundle that generates."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from marey.bundles import Bundle
from marey.core.errors import InvalidInput, NotFound
from marey.data.prepared import PreparedData
from marey.generation.port import Request
from marey.models.hgm3.assembly import RECIPE, assemble, unpack
from marey.models.hgm3.config import TINY, HGM3Config, named_config
from marey.models.hgm3.data import CaptionData
from marey.models.hgm3.generate import Generator
from marey.models.hgm3.memory import masked_memory, residual_memory
from marey.models.hgm3.stage_masked import MaskedStage
from marey.models.hgm3.tokenizer import Tokenizer
from marey.models.hgm3.train import train_stage
from marey.nn.devices import fast_bf16
from marey.nn.growing import grow
from marey.training.budget import Budget
from marey.training.loop import RunOptions, train
from marey.training.motions import MotionData, TokenData
from marey.training.parts import load_part
from marey.training.stages import StepContext
from marey.training.staging import MemoryOf, TrainOptions
from marey.training.texts import CaptionTexts
from marey.training.tokenizing import TokenizerStage
from tests.support.device_memory import device_with_room_for
from tests.support.prepared import farthest_move, text_features

CPU = torch.device("cpu")


def options(prepared: PreparedData, run: Path, steps: int, config: HGM3Config = TINY) -> TrainOptions[HGM3Config]:
    return TrainOptions(prepared.path, run, config, Budget(steps=steps), device="cpu", bf16=False, quiet=True)


def masked_stage(prepared: PreparedData, config: HGM3Config = TINY) -> MaskedStage:
    data = MotionData.load(prepared.path, CPU)
    torch.manual_seed(0)
    tokenizer = Tokenizer(config)
    tokenizer.quantizer.codebooks.normal_()
    tokens = TokenData.encode(tokenizer, data)
    for start, length in zip(tokens.starts.flatten().tolist(), tokens.lengths.flatten().tolist(), strict=True):
        tokens.tokens[start : start + length, 0] = torch.arange(length) * 3 % config.tokenizer.codes  # can be learnt
    captions = CaptionData.of(CaptionTexts.load(prepared), prepared.caption_counts, config.condition, CPU)
    return MaskedStage(config, prepared.clips, tokens, captions)


def context(step: int = 0, fraction: float = 1.0) -> StepContext:
    torch.manual_seed(step)
    return StepContext(step, fraction, np.random.default_rng(step))


@pytest.fixture(scope="module")
def run(prepared: PreparedData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    for stage in ("tokenizer", "masked", "residual", "length"):
        train_stage(stage, options(prepared, folder, 4))
    return folder


def test_all_stages_end_in_a_bundle_that_generates(prepared: PreparedData, run: Path, tmp_path: Path) -> None:
    bundle = assemble(prepared.path, run, tmp_path / "trained", TINY, card="# card")
    assert not bundle.manifest.random
    assert bundle.manifest.data[0].name == "synthetic"
    assert "tokenizer/test/error_mm" in bundle.manifest.metrics
    generator = Generator.load(Bundle.open(tmp_path / "trained"), device="cpu")
    (made,) = generator.generate([Request(text_features(0), 1, 40)])
    assert made is not None
    assert made.features.shape == (40, 263)


def test_training_all_stages_again_after_a_kill_does_only_what_is_left(prepared: PreparedData, tmp_path: Path) -> None:
    whole = replace(options(prepared, tmp_path, 2), budget=Budget(steps=2, minutes=60))
    metrics = train_stage("all", whole)
    assert {name.split("/")[0] for name in metrics} == {"tokenizer", "masked", "residual", "length"}
    (tmp_path / "length" / "part" / "part.json").unlink()
    assert {name.split("/")[0] for name in train_stage("all", whole)} == {"length"}
    with pytest.raises(InvalidInput, match="minutes"):
        train_stage("all", options(prepared, tmp_path, 2))


@pytest.mark.parametrize(("stage", "memory"), [("masked", masked_memory), ("residual", residual_memory)])
def test_auto_splits_batches_by_the_memory_of_the_device(
    stage: str, memory: MemoryOf[HGM3Config], prepared: PreparedData, run: Path, tmp_path: Path
) -> None:
    shutil.copytree(run / "tokenizer", tmp_path / "tokenizer")
    auto = replace(options(prepared, tmp_path, 1), micro_batch="auto")
    with device_with_room_for(3, memory(TINY, bf16=False)) as chosen:
        train_stage(stage, auto)
    assert chosen == [3]
    with pytest.raises(InvalidInput, match="auto is for stages whose memory is estimated"):
        train_stage("length", auto)


def test_a_bundle_of_another_configuration_is_refused(prepared: PreparedData, run: Path, tmp_path: Path) -> None:
    other = replace(TINY, masked=replace(TINY.masked, layers=1))
    with pytest.raises(InvalidInput, match="another masked"):
        assemble(prepared.path, run, tmp_path / "x", other)


def test_a_bundle_taken_apart_and_assembled_again_is_the_same_and_trains_on(
    prepared: PreparedData, run: Path, tmp_path: Path
) -> None:
    bundle = assemble(prepared.path, run, tmp_path / "first", TINY)
    again = tmp_path / "run"
    assert unpack(bundle, again) == TINY
    copy = assemble(prepared.path, again, tmp_path / "second", TINY)
    for part in ("tokenizer", "masked", "predictor", "residual", "length"):
        theirs, ours = bundle.tensors(part), copy.tensors(part)
        assert theirs.keys() == ours.keys()
        assert all(np.array_equal(theirs[name], ours[name]) for name in theirs)

    for stage in ("tokenizer", "masked", "residual", "length"):
        before = load_part(again / stage / "part").state
        train_stage(stage, replace(options(prepared, again, 1), warm=True))
        after = load_part(again / stage / "part").state
        assert 0 < farthest_move(before, after) < 0.1, stage  # from the weights that were there, not from random ones


def test_a_bundle_is_not_taken_apart_into_a_run_that_has_stages(
    prepared: PreparedData, run: Path, tmp_path: Path
) -> None:
    bundle = assemble(prepared.path, run, tmp_path / "bundle", TINY)
    with pytest.raises(InvalidInput, match="already has a stage tokenizer"):
        unpack(bundle, run)


def test_a_stage_says_which_one_it_needs_first(prepared: PreparedData, tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="has not finished"):
        train_stage("masked", options(prepared, tmp_path, 1))


@pytest.mark.parametrize("name", ["tokenizer", "masked"])
def test_a_run_killed_and_resumed_ends_with_the_same_weights_bit_for_bit(
    name: str, prepared: PreparedData, tmp_path: Path
) -> None:
    def stage() -> TokenizerStage | MaskedStage:
        torch.manual_seed(0)
        if name == "tokenizer":
            return TokenizerStage(TINY, MotionData.load(prepared.path, CPU), Tokenizer(TINY))
        return masked_stage(prepared)

    def go(folder: Path, stage: TokenizerStage | MaskedStage, *, resume: bool = False) -> dict[str, torch.Tensor]:
        budget = Budget(steps=6)
        run_options = RunOptions(folder, budget, resume=resume, bf16=False, quiet=True, checkpoint_minutes=0)
        train(stage, run_options, TINY.to_dict())
        return stage.module.state_dict()

    whole = go(tmp_path / "whole", stage())
    broken = stage()
    steps = 0
    after = broken.after_step

    def die(context: StepContext) -> None:
        nonlocal steps
        after(context)
        steps += 1
        if steps == 4:
            raise KeyboardInterrupt

    broken.after_step = die  # type: ignore[method-assign]
    with pytest.raises(KeyboardInterrupt):
        go(tmp_path / "broken", broken)
    resumed = go(tmp_path / "broken", stage(), resume=True)
    for key, value in whole.items():
        assert torch.equal(value, resumed[key]), key


def test_resuming_with_another_seed_is_refused(prepared: PreparedData, tmp_path: Path) -> None:
    run_options = RunOptions(tmp_path, Budget(steps=1), bf16=False, quiet=True)
    train(TokenizerStage(TINY, MotionData.load(prepared.path, CPU), Tokenizer(TINY)), run_options, {})
    with pytest.raises(InvalidInput, match="another stage, seed or configuration"):
        train(
            TokenizerStage(TINY, MotionData.load(prepared.path, CPU), Tokenizer(TINY)),
            replace(run_options, resume=True, seed=1, budget=Budget(steps=2)),
            {},
        )


@pytest.mark.parametrize("wanted", ["0", "1"])
def test_matrices_are_in_bfloat16_only_where_that_pays(
    wanted: str, prepared: PreparedData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MAREY_BF16", wanted)
    stage = TokenizerStage(TINY, MotionData.load(prepared.path, CPU), Tokenizer(TINY))
    loss, used = stage.loss, list[bool]()

    def watched(context: StepContext) -> tuple[torch.Tensor, Mapping[str, torch.Tensor]]:
        used.append(torch.is_autocast_enabled("cpu"))
        return loss(context)

    stage.loss = watched  # type: ignore[method-assign]
    train(stage, RunOptions(tmp_path, Budget(steps=1), quiet=True), {})
    assert used == [wanted == "1" and fast_bf16(CPU)]


def test_the_tokenizer_learns(prepared: PreparedData, tmp_path: Path) -> None:
    stage = TokenizerStage(TINY, MotionData.load(prepared.path, CPU), Tokenizer(TINY))
    before = stage.validate()["local_mm"]
    train(stage, RunOptions(tmp_path, Budget(steps=60), bf16=False, quiet=True, validate_times=1), {})
    assert stage.validate()["local_mm"] < 0.9 * before


def test_the_masked_transformer_and_the_predictor_learn(prepared: PreparedData, tmp_path: Path) -> None:
    stage = masked_stage(prepared)
    before = stage.validate()
    train(stage, RunOptions(tmp_path, Budget(steps=8), bf16=False, quiet=True, validate_times=1), {})
    assert stage.validate()["reconstruction/specific"] < before["reconstruction/specific"] - 0.1


def test_gradient_of_the_predictor_never_reaches_the_graph(prepared: PreparedData) -> None:
    stage = masked_stage(prepared)
    sample = next(iter([stage.sample(stage.pairs.draw(np.random.default_rng(0), 4), np.random.default_rng(0))]))
    stage.module.zero_grad()
    _losses, _masked, _, ranking = stage.piece(sample, 0.0)
    ranking.sum().backward()
    assert all(p.grad is None for p in stage.module.masked.parameters())
    assert any(p.grad is not None for p in stage.module.predictor.parameters())


def test_reconstruction_trains_the_graph_and_not_the_predictor(prepared: PreparedData) -> None:
    stage = masked_stage(prepared)
    sample = stage.sample(stage.pairs.draw(np.random.default_rng(0), 8), np.random.default_rng(0))
    losses, masked, _, _ = stage.piece(sample.at_level(2), 0.0)
    (losses * masked).sum().backward()
    assert stage.module.masked.text.graph.project.weight.grad is not None
    assert all(p.grad is None for p in stage.module.predictor.parameters())


def test_the_teacher_follows_the_student_slowly(prepared: PreparedData) -> None:
    stage = masked_stage(prepared)
    for p in stage.module.predictor.parameters():
        p.data.add_(1.0)
    before = [p.clone() for p in stage.module.teacher.parameters()]
    stage.after_step(context(step=10**6))
    for old, new, student in zip(
        before, stage.module.teacher.parameters(), stage.module.predictor.parameters(), strict=True
    ):
        torch.testing.assert_close(new, old + (student - old) * 0.001)


def test_random_masks_do_not_ask_the_teacher(prepared: PreparedData) -> None:
    stage = masked_stage(prepared, replace(TINY, mining=replace(TINY.mining, mask="random")))

    def refuse(*_: object) -> torch.Tensor:
        raise AssertionError

    stage.module.teacher.forward = refuse  # type: ignore[method-assign]
    stage.loss(context(fraction=1.0))


def test_hard_masks_take_the_tokens_the_teacher_finds_hardest(prepared: PreparedData) -> None:
    stage = masked_stage(prepared)
    sample = stage.sample(stage.pairs.draw(np.random.default_rng(0), 4), np.random.default_rng(0))
    size = sample.tokens.shape[1] // 2 * 2
    sample = replace(sample, tokens=sample.tokens[:, :size], noise=sample.noise[:, :size])
    stage._predict = lambda *_: torch.arange(size).float().expand(4, -1)  # type: ignore[method-assign]
    sample = replace(sample, progress=torch.full((4,), 2 / 3), lengths=torch.full((4,), size))
    masked = stage.masks(sample, torch.zeros(4, 25, 384), alpha=1.0)
    half = size // 2
    assert masked[:, size - half :].all()
    assert not masked[:, : size - half].any()


def test_the_first_prediction_is_how_often_each_code_occurs(prepared: PreparedData) -> None:
    stage = masked_stage(prepared)
    shares = stage.module.masked.head.bias.detach().exp()
    counts = torch.bincount(stage.tokens.tokens[:, 0].clamp(min=0), minlength=TINY.tokenizer.codes).float()
    assert float(torch.corrcoef(torch.stack([shares[: len(counts)], counts]))[0, 1]) > 0.95


def test_three_levels_a_step_average_the_same_loss_as_one_drawn(prepared: PreparedData) -> None:
    three = masked_stage(prepared, replace(TINY, mining=replace(TINY.mining, levels_per_step=3)))
    loss, logs = three.loss(context(fraction=0.0))
    assert torch.isfinite(loss)
    assert 0 < float(logs["reconstruction"]) < 10
    assert 0 <= float(logs["accuracy"]) <= 1


def test_configurations_survive_json() -> None:
    for name in ("paper", "starter", "tiny"):
        config = named_config(name)
        assert HGM3Config.from_dict(config.to_dict()) == config
    with pytest.raises(InvalidInput, match="unknown fields: depht"):
        HGM3Config.from_dict({"tokenizer": {"depht": 1}})
    with pytest.raises(InvalidInput, match="unknown configuration"):
        named_config("large")
    assert named_config("tiny", mask="random").mining.mask == "random"


def test_the_stages_share_the_minutes_of_a_training() -> None:
    assert sum(RECIPE.shares.values()) == pytest.approx(1)


def test_heads_start_at_the_frequencies_of_the_training_split_alone(prepared: PreparedData) -> None:
    stage = masked_stage(prepared)
    tokens = stage.tokens
    codes = TINY.tokenizer.codes
    counted = tokens.log_shares(codes, stage.pairs.train)
    held_out = [c for c, clip in enumerate(prepared.clips) if clip.split != "train"]
    for clip in held_out:
        tokens.tokens[tokens.starts[clip, 0] : tokens.starts[clip, 0] + tokens.lengths[clip, 0]] = 5
    assert held_out
    assert torch.equal(tokens.log_shares(codes, stage.pairs.train), counted)
    clip = int(stage.pairs.train[0])
    start, length = tokens.starts[clip], tokens.lengths[clip]
    alone = torch.cat([tokens.tokens[s : s + n, 0] for s, n in zip(start.tolist(), length.tolist(), strict=True)])
    expected = torch.bincount(alone, minlength=codes).float() + 1
    torch.testing.assert_close(tokens.log_shares(codes, stage.pairs.train[:1])[0].exp(), expected / expected.sum())
    torch.testing.assert_close(stage.module.masked.head.bias.detach(), counted[0])


def test_difficulties_are_not_rounded_under_autocast(prepared: PreparedData) -> None:
    stage = masked_stage(prepared)
    sample = stage.sample(stage.pairs.train[:8], np.random.default_rng(0))
    with torch.autocast("cpu", dtype=torch.bfloat16), torch.no_grad():
        nodes = stage.module.masked.text(sample.graphs)
        found = stage._predict(stage.module.predictor, sample, nodes, sample.tokens >= 0)
    found = found[sample.tokens >= 0]
    assert found.dtype == torch.float32
    assert (found != found.bfloat16().float()).float().mean() > 0.9


def test_a_larger_transformer_starts_from_a_smaller_one(prepared: PreparedData, run: Path, tmp_path: Path) -> None:
    """It computes the same before its first step; other stages and the bundle ask for parts of its own size."""
    shutil.copytree(run, tmp_path / "run")
    large = replace(TINY, masked=replace(TINY.masked, layers=4, feedforward=96))
    trained, stage = load_part(run / "masked" / "part"), masked_stage(prepared, large)
    module = stage.module.eval()
    module.load_state_dict(grow(trained.state, module.state_dict()))
    small = masked_stage(prepared).module.eval()
    small.load_state_dict(trained.state)
    sample = stage.sample(stage.pairs.train[:4], np.random.default_rng(0))
    valid = sample.tokens >= 0
    logits = [
        each.masked(sample.tokens.clamp(min=0), valid, each.masked.read(sample.graphs), sample.graphs.present, valid)
        for each in (small, module)
    ]
    torch.testing.assert_close(*logits, rtol=0, atol=1e-5)
    with pytest.raises(InvalidInput, match="another masked"):
        RECIPE.part("masked", large, tmp_path / "run")
    train_stage("masked", replace(options(prepared, tmp_path / "run", 2, large), warm=True))
    assert RECIPE.part("masked", large, tmp_path / "run").config["masked"]["layers"] == 4


@pytest.mark.parametrize("other", [{"heads": 4}, {"norm_first": False}, {"heads": 1, "layers": 4}])
def test_a_transformer_that_computes_otherwise_is_no_start(
    prepared: PreparedData, run: Path, tmp_path: Path, other: dict[str, Any]
) -> None:
    """Its weights have the same shapes."""
    shutil.copytree(run, tmp_path / "run")
    another = replace(TINY, masked=replace(TINY.masked, **other))
    with pytest.raises(InvalidInput, match="another masked"):
        train_stage("masked", replace(options(prepared, tmp_path / "run", 2, another), warm=True))


def test_a_transformer_does_not_shrink(prepared: PreparedData, run: Path) -> None:
    state = load_part(run / "masked" / "part").state
    small = masked_stage(prepared, replace(TINY, masked=replace(TINY.masked, layers=1))).module.state_dict()
    with pytest.raises(InvalidInput, match="can only grow"):
        grow(state, small)


def test_levels_of_condition_are_drawn_evenly(prepared: PreparedData) -> None:
    stage = masked_stage(prepared, TINY)
    drawn = stage.sample(np.repeat(stage.pairs.train[:1], 600), np.random.default_rng(0)).level
    assert torch.bincount(drawn, minlength=3).tolist() == pytest.approx([200, 200, 200], abs=40)
