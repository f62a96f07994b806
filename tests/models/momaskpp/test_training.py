"""Training: every stage runs on tiny data, and ends in a bundle that generates; masks and replaced tokens."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.bundles import Bundle
from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.data.prepared import PreparedData
from marey.generation.port import Request
from marey.models.momaskpp.assembly import assemble, recipe_of, unpack
from marey.models.momaskpp.bundle import random_bundle
from marey.models.momaskpp.captions import INDEX, STATES, WordData
from marey.models.momaskpp.config import PAPER, RELEASED_SNAPMOGEN, STARTER, TINY, MoMaskPPConfig, PerturbationConfig
from marey.models.momaskpp.generate import Generator
from marey.models.momaskpp.memory import memory_model
from marey.models.momaskpp.scales import Scales
from marey.models.momaskpp.stage_masked import ScaleStage, choose_masks
from marey.models.momaskpp.stage_refiner import RefinerStage
from marey.models.momaskpp.stage_tokenizer import ScaleTokenizerStage, has_positions, tokenizer_loss
from marey.models.momaskpp.tokenizer import Tokenizer
from marey.models.momaskpp.tokens import ScaleTokens, encode_clips
from marey.models.momaskpp.train import train_stage
from marey.nn.growing import take
from marey.training.budget import Budget
from marey.training.motions import MotionData
from marey.training.parts import load_part
from marey.training.stages import StepContext
from marey.training.staging import TrainOptions
from tests.support.device_memory import device_with_room_for
from tests.support.devices import check_training_elsewhere
from tests.support.prepared import farthest_move, text_features, write_prepared
from tests.support.recording import assert_recordable

CPU = torch.device("cpu")
STAGES = ("tokenizer", "masked", "refiner", "length")


def options(
    prepared: PreparedData, run: Path, steps: int, config: MoMaskPPConfig = TINY
) -> TrainOptions[MoMaskPPConfig]:
    return TrainOptions(prepared.path, run, config, Budget(steps=steps), device="cpu", bf16=False, quiet=True)


def context(step: int = 0, fraction: float = 1.0) -> StepContext:
    torch.manual_seed(step)
    return StepContext(step, fraction, np.random.default_rng(step))


@pytest.fixture(scope="module")
def run(prepared: PreparedData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    for stage in STAGES:
        train_stage(stage, options(prepared, folder, 2))
    return folder


@pytest.fixture(scope="module")
def words(prepared: PreparedData, run: Path) -> WordData:
    """Made by the run's stages."""
    return WordData.load(prepared, TINY.text, CPU)


@pytest.fixture(scope="module")
def stage(prepared: PreparedData, words: WordData) -> ScaleStage:
    return masked_stage(prepared, words)


def masked_stage(prepared: PreparedData, words: WordData, config: MoMaskPPConfig = TINY) -> ScaleStage:
    data = MotionData.load(prepared.path, CPU)
    torch.manual_seed(0)
    tokenizer = Tokenizer(config)
    tokenizer.quantizer.codebooks.normal_()
    tokens = ScaleTokens(**encode_clips(tokenizer, data), scales=tokenizer.scales)
    return ScaleStage(config, prepared.clips, tokens, words)


def test_all_stages_end_in_a_bundle_that_generates_and_trains_on(
    prepared: PreparedData, run: Path, tmp_path: Path
) -> None:
    bundle = assemble(prepared.path, run, tmp_path / "trained", TINY, card="# card")
    assert not bundle.manifest.random
    assert bundle.manifest.data[0].name == "synthetic"
    assert "tokenizer/test/error_mm" in bundle.manifest.metrics
    generator = Generator.load(Bundle.open(tmp_path / "trained"), device="cpu")
    (made,) = generator.generate([Request(text_features(0), 1, 40)])
    assert made is not None
    assert made.features.shape == (40, 263)

    again = tmp_path / "run"
    assert unpack(bundle, again) == TINY
    copy = assemble(prepared.path, again, tmp_path / "second", TINY)
    for part in STAGES:
        theirs, ours = bundle.tensors(part), copy.tensors(part)
        assert theirs.keys() == ours.keys()
        assert all(np.array_equal(theirs[name], ours[name]) for name in theirs)
    before = load_part(again / "masked" / "part").state
    train_stage("masked", replace(options(prepared, again, 1), warm=True))
    assert 0 < farthest_move(before, load_part(again / "masked" / "part").state) < 0.1
    with pytest.raises(InvalidInput, match="another masked"):
        assemble(prepared.path, run, tmp_path / "x", replace(TINY, masked=replace(TINY.masked, layers=1)))
    with pytest.raises(InvalidInput, match="already has a stage tokenizer"):
        unpack(bundle, run)


def test_a_stage_begins_from_the_weights_of_another_bundle_that_fit(prepared: PreparedData, tmp_path: Path) -> None:
    """Their terms are recorded; what has no like there writes nothing at first."""
    origin = random_bundle(tmp_path / "origin", replace(TINY, tokenizer=replace(TINY.tokenizer, codes=16)), seed=3)
    resting = replace(TINY.train_tokenizer, learning_rate=1e-12, ema=0.0)
    config = replace(TINY, train_tokenizer=resting)
    train_stage("tokenizer", replace(options(prepared, tmp_path / "run", 1, config), origin=origin))
    part = load_part(tmp_path / "run" / "tokenizer" / "part")
    taken = origin.tensors("tokenizer")
    assert np.allclose(part.state["decoder.out_proj.weight"], taken["decoder.out_proj.weight"], atol=1e-6)
    assert part.state["quantizer.codebooks"].shape == (1, 32, 16)  # its own: theirs has 16 codes
    assert part.sources[-1].name == "synthetic"

    narrow = random_bundle(tmp_path / "narrow", replace(TINY, tokenizer=replace(TINY.tokenizer, width=16)))
    with pytest.raises(InvalidInput, match="fits in less than half of this stage's weights"):
        train_stage("tokenizer", replace(options(prepared, tmp_path / "no", 1, config), origin=narrow))


def test_the_convolutions_of_other_models_are_found_by_their_names() -> None:
    tokenizer = Tokenizer(TINY)
    foreign = {
        name.replace("in_proj", "enter").replace("out_proj", "leave"): torch.randn_like(value)
        for name, value in tokenizer.named_parameters()
        if "attention" not in name
    }
    copied = take(tokenizer, foreign, recipe_of(TINY).names)
    assert torch.equal(tokenizer.encoder.in_proj.weight, foreign["encoder.enter.weight"])
    assert torch.equal(tokenizer.decoder.out_proj.weight, foreign["decoder.leave.weight"])
    assert not any("attention" in name for name in copied)
    frames = torch.randn(1, 32, 8)
    block, everywhere = tokenizer.encoder.attention[0], torch.ones(1, 8, dtype=torch.bool)
    assert torch.equal(block(frames, everywhere, None), frames)


def test_auto_splits_batches_by_the_memory_of_the_device(prepared: PreparedData, run: Path, tmp_path: Path) -> None:
    shutil.copytree(run / "tokenizer", tmp_path / "tokenizer")
    auto = replace(options(prepared, tmp_path, 1), micro_batch="auto")
    with device_with_room_for(3, memory_model(TINY, bf16=False)) as chosen:
        train_stage("masked", auto)
    assert chosen == [3]
    with pytest.raises(InvalidInput, match="auto is for stages whose memory is estimated"):
        train_stage("length", auto)


def test_a_configuration_has_the_stages_of_its_parts(prepared: PreparedData, tmp_path: Path) -> None:
    assert recipe_of(TINY).stages == STAGES
    assert recipe_of(PAPER).stages == ("tokenizer", "masked")
    assert recipe_of(STARTER).stages == ("tokenizer", "masked", "length")
    assert recipe_of(RELEASED_SNAPMOGEN).stages == ("tokenizer", "masked", "refiner")
    assert all(sum(recipe_of(each).shares.values()) == pytest.approx(1) for each in (TINY, PAPER, STARTER))
    with pytest.raises(InvalidInput, match="unknown stage 'refiner'"):
        train_stage("refiner", options(prepared, tmp_path, 1, PAPER))


def test_data_of_another_layout_is_refused(prepared: PreparedData, tmp_path: Path) -> None:
    other = replace(TINY, layout="kit-251")
    with pytest.raises(InvalidInput, match="holds features of the layout humanml3d-263"):
        train_stage("tokenizer", options(prepared, tmp_path, 1, other))


def test_a_stage_says_which_one_it_needs_first(prepared: PreparedData, tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="has not finished"):
        train_stage("masked", options(prepared, tmp_path, 1))


def test_words_of_captions_are_encoded_once_and_again_for_other_captions(
    prepared: PreparedData, words: WordData, tmp_path: Path
) -> None:
    captions = torch.arange(3)
    text = words.words(captions)
    assert text.present.all()  # "one", "two", "one": a word between two special tokens
    assert text.states.shape == (3, 3, 384)
    assert torch.equal(text.states[0], text.states[2])
    assert not torch.equal(text.states[0], text.states[1])
    written = (prepared.path / STATES).stat().st_mtime_ns
    WordData.load(prepared, TINY.text, CPU)
    assert (prepared.path / STATES).stat().st_mtime_ns == written
    other = PreparedData.open(write_prepared(tmp_path / "other", acts=("walk", "bow")))
    for name in (STATES, INDEX):
        (other.path / name).write_bytes((prepared.path / name).read_bytes())
    assert len(WordData.load(other, TINY.text, CPU).start) == 1 + 4  # two captions of each of two actions
    (other.path / STATES).write_bytes(b"no array")
    with pytest.raises(InvalidFile):
        WordData.load(other, TINY.text, CPU)


def test_tokens_of_all_scales_come_back_in_their_places(prepared: PreparedData, stage: ScaleStage) -> None:
    data = MotionData.load(prepared.path, CPU)
    torch.manual_seed(0)
    tokenizer = Tokenizer(TINY).eval()
    tokenizer.quantizer.codebooks.normal_()
    for clip in (0, 7):
        own = data.prepared.clips[clip]
        length = torch.tensor([(own.length - 1) // 4])
        expected = tokenizer.encode(data.features[None, own.start + 1 : own.start + 1 + 4 * int(length)], length * 4)
        tokens, lengths = stage.tokens.rows(torch.tensor([clip]), torch.tensor([1]))
        assert torch.equal(lengths, length)
        assert torch.equal(tokens, expected[..., 0])


def test_codes_are_counted_over_the_tokens_of_all_scales_of_training_clips(stage: ScaleStage) -> None:
    tokens, clips, codes = stage.tokens, stage.pairs.train, stage.config.tokenizer.codes
    counted, seen = torch.ones(codes), set[int]()
    for clip in clips.tolist():
        for phase in range(tokens.phases):
            if (start := int(tokens.starts[clip, phase])) not in seen:
                seen.add(start)
                row = tokens.rows(torch.tensor([clip]), torch.tensor([phase]))[0]
                counted += torch.bincount(row[row >= 0], minlength=codes)
    shares = tokens.log_shares(codes, clips)
    assert shares.shape == (1, codes)
    torch.testing.assert_close(shares[0].exp(), counted / counted.sum())
    assert not torch.equal(shares, tokens.log_shares(codes, clips[:1]))


def test_masks_are_counted_on_the_tokens_a_clip_has_or_as_published_on_all() -> None:
    torch.manual_seed(0)
    own, padded = Scales((8, 4, 2, 1), "own", 49), Scales((8, 4, 2, 1), "padded", 49)
    lengths, progress = torch.tensor([7, 25, 49]), torch.tensor([0.999, 0.5, 0.0])
    noise = torch.rand(3, 91)
    masks = choose_masks(own, lengths, progress, noise, padded=False)
    assert masks.sum(1).tolist() == [1, round(0.7071 * own.total(25)), 91]
    assert not (masks & ~own.valid(lengths)).any()
    published = choose_masks(padded, lengths, torch.full((3,), 0.999), noise, padded=True)
    assert published.sum() <= 3
    assert not (published & ~padded.valid(lengths)).any()
    assert 0 in [
        int(choose_masks(padded, lengths[:1], progress[:1], torch.rand(1, 91), padded=True).sum()) for _ in range(20)
    ]


def test_tokens_are_replaced_in_the_published_shares(stage: ScaleStage) -> None:
    sample = next(iter(stage.samples(np.arange(4).repeat(64), np.random.default_rng(0))))
    half = torch.arange(sample.tokens.shape[1])[None] % 2 == 0
    masked = half.expand_as(sample.tokens) & (sample.tokens >= 0)
    sample = replace(sample, masked=masked)
    stage.module.train()
    shown, valid = stage.shown(sample), sample.tokens >= 0
    hidden = (shown == stage.module.mask_token)[masked].float().mean()
    assert float(hidden) == pytest.approx(0.9 * 0.88, abs=0.03)
    changed = (shown != sample.tokens)[valid & ~masked].float().mean()
    assert float(changed) == pytest.approx(0.1 * 31 / 32, abs=0.03)
    stage.config = replace(TINY, perturbation=PerturbationConfig(0.0, 1.0, 0.0))
    plain = stage.shown(sample)
    stage.config = TINY
    assert torch.equal(plain == stage.module.mask_token, masked)
    assert torch.equal(plain[valid & ~masked], sample.tokens[valid & ~masked])


def test_only_masked_tokens_are_predicted_and_the_loss_falls(prepared: PreparedData, words: WordData) -> None:
    stage = masked_stage(prepared, words, replace(TINY, perturbation=PerturbationConfig(0.0, 1.0, 0.0)))
    optimizer = torch.optim.Adam(stage.module.parameters(), 3e-3)
    stage.module.train()
    losses = list[float]()
    for step in range(30):
        loss, logs = stage.loss(context(step))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        losses.append(float(logs["loss"]))
    assert np.mean(losses[-5:]) < np.mean(losses[:5]) - 0.2


def test_validation_keeps_every_condition(prepared: PreparedData, words: WordData) -> None:
    """The share of dropped conditions is of training alone."""
    stage = masked_stage(prepared, words)
    stage.module.eval()
    kept = stage.validate()
    stage.config = replace(TINY, text=replace(TINY.text, drop=1.0))
    assert stage.validate() == kept
    sample = next(stage.samples(stage.pairs.train, np.random.default_rng(0)))
    assert sample.dropped.all()  # that share would change it


@pytest.mark.parametrize("size", [1, 3])
def test_gradients_of_parts_add_up_to_those_of_the_batch(prepared: PreparedData, words: WordData, size: int) -> None:
    plain = replace(
        TINY,
        masked=replace(TINY.masked, dropout=0.0),
        text=replace(TINY.text, noise=0.0),
        perturbation=PerturbationConfig(0.0, 1.0, 0.0),
        train_masked=replace(TINY.train_masked, batch=7),
    )
    stage = masked_stage(prepared, words, plain)
    stage.module.train()

    def gradients(parts: bool) -> tuple[dict[str, torch.Tensor], float]:
        stage.module.zero_grad()
        losses = stage.parts(context(), size) if parts else [stage.loss(context())]
        total = 0.0
        for loss, logs in losses:
            loss.backward()
            total += float(logs["loss"])
        return {
            name: each.grad.clone() for name, each in stage.module.named_parameters() if each.grad is not None
        }, total

    (whole, loss), (added, same) = gradients(parts=False), gradients(parts=True)
    assert same == pytest.approx(loss, rel=1e-5)
    assert whole.keys() == added.keys()
    for name, wanted in whole.items():
        torch.testing.assert_close(added[name], wanted, atol=1e-6, rtol=1e-4, msg=name)


def test_samples_without_condition_read_no_caption(stage: ScaleStage) -> None:
    model = stage.module.eval()
    states = torch.randn(2, 3, 384)
    dropped = model.words(states, torch.tensor([True, False]))
    assert torch.equal(dropped[0], model.words(torch.randn(2, 3, 384), torch.tensor([True, True]))[0])
    assert torch.equal(dropped[1], model.words(states)[1])


def test_the_tokenizers_loss_weighs_essential_columns_and_the_root_once_more(prepared: PreparedData) -> None:
    data = MotionData.load(prepared.path, CPU)
    stage = ScaleTokenizerStage(TINY, data, Tokenizer(TINY))
    model = stage.module.eval()
    model.quantizer.codebooks.normal_()
    features, lengths = data.windows(torch.tensor([0]), 32), torch.tensor([32])

    def total(**weights: float) -> float:
        plain = {"essential_weight": 0.0, "position_weight": 0.0, "commitment": 0.0, **weights}
        config = replace(TINY, tokenizer=replace(TINY.tokenizer, **plain))
        return tokenizer_loss(model, config, features, lengths, 1.0).total.item()

    losses = tokenizer_loss(model, TINY, features, lengths, 1.0)
    assert total() == pytest.approx(float(losses.features), rel=1e-5)
    assert total(essential_weight=2.0) - total() == pytest.approx(2 * float(losses.essential), rel=1e-4)
    assert total(commitment=0.5) - total() == pytest.approx(0.5 * float(losses.commitment), rel=1e-4)
    added = [total(**{name: 1.0}) - total() for name in ("root_weight", "position_weight", "velocity_weight")]
    assert all(value > 0 for value in (*added, total(world_weight=1.0) - total()))
    assert has_positions(TINY)


def test_steps_of_both_networks_can_be_recorded(prepared: PreparedData, words: WordData) -> None:
    tokenizer = Tokenizer(TINY)
    assert_recordable(ScaleTokenizerStage(TINY, MotionData.load(prepared.path, CPU), tokenizer), len(TINY.windows))
    assert_recordable(masked_stage(prepared, words))


def test_a_padded_batch_has_the_loss_of_its_pieces(prepared: PreparedData, words: WordData) -> None:
    still = PerturbationConfig(replace_random=0.0, perturb=0.0, replace_mask=1.0)
    config = replace(TINY, perturbation=still, masked=replace(TINY.masked, dropout=0.0))
    config = replace(config, text=replace(config.text, noise=0.0))
    stage = masked_stage(prepared, words, config)
    loss, logs = stage.loss(StepContext(0, 0.0, np.random.default_rng(0)))
    batch = stage.batch(StepContext(0, 0.0, np.random.default_rng(0)))
    padded, shown = stage.batch_loss(batch)
    assert batch.tokens.shape[1] == stage.scales.size
    torch.testing.assert_close(padded, loss)
    assert float(shown["accuracy"]) == pytest.approx(float(logs["accuracy"]))


def test_the_root_counts_once_more_by_its_weight(prepared: PreparedData) -> None:
    data = MotionData.load(prepared.path, CPU)
    model = ScaleTokenizerStage(TINY, data, Tokenizer(TINY)).module.eval()
    model.quantizer.codebooks.normal_()
    features, lengths = data.windows(torch.tensor([0, 50]), 32), torch.tensor([32, 20])

    def total(weight: float) -> float:
        config = replace(TINY, tokenizer=replace(TINY.tokenizer, root_weight=weight))
        return tokenizer_loss(model, config, features, lengths, 1.0).total.item()

    output = model(features, lengths)[0]
    error = torch.nn.functional.smooth_l1_loss(output, model.normalize(features), reduction="none")[..., :4]
    own = torch.cat([error[0], error[1, :20]]).mean()
    assert total(3.0) - total(0.0) == pytest.approx(3 * float(own.detach()), rel=1e-3)


def test_errors_of_features_without_positions_are_those_of_whole_tokens_of_each_captured_clip(
    prepared: PreparedData,
) -> None:
    config = replace(TINY, layout=RELEASED_SNAPMOGEN.layout)
    assert not has_positions(config)
    data = MotionData.load(prepared.path, CPU)
    stage = ScaleTokenizerStage(config, data, Tokenizer(TINY))
    model = stage.module.eval()
    model.quantizer.codebooks.normal_()
    clips, expected = data.originals("val"), list[float]()
    assert any(clip.length % model.frames_per_token for clip in clips)
    for clip in clips:
        frames = clip.length - clip.length % model.frames_per_token
        features = data.features[clip.start : clip.start + frames][None]
        made = model.decode(model.encode(features), torch.tensor([frames // model.frames_per_token]))
        expected.append(float(((made - features) / model.std).abs().mean()))
    assert stage.validate() == {"error": pytest.approx(float(np.mean(expected)), rel=1e-5)}
    assert stage.test().keys() == {"test/error"}


def test_a_network_that_knows_nothing_is_right_by_chance(prepared: PreparedData, words: WordData) -> None:
    """Ties go to the first code, so how often it is right is the share of that code."""
    stage = masked_stage(prepared, words)
    stage.module.eval()
    for parameter in stage.module.codes.parameters():
        parameter.data.zero_()
    found = stage.validate()
    assert found["loss"] == pytest.approx(math.log(TINY.tokenizer.codes), rel=1e-4)
    assert 0 <= found["accuracy"] < 0.5


def test_no_tensor_of_a_training_is_made_on_another_device(prepared: PreparedData, words: WordData) -> None:
    data = MotionData.load(prepared.path, CPU)
    for layout in ("own", "padded"):
        config = replace(TINY, tokenizer=replace(TINY.tokenizer, layout=layout))
        check_training_elsewhere(ScaleTokenizerStage(config, data, Tokenizer(config)))
        check_training_elsewhere(masked_stage(prepared, words, config))
    check_training_elsewhere(RefinerStage(TINY, data))


def test_batches_of_recorded_steps_have_one_shape_whatever_was_drawn(stage: ScaleStage, words: WordData) -> None:
    """A recorded graph reads tensors of the shape that it was recorded with."""
    batches = [stage.batch(context(step)) for step in range(6)]
    assert {tuple(each.text.states.shape) for each in batches} == {
        (stage.optimisation.batch, words.limit, words.states.shape[1])
    }
    assert len({tuple(each.shape) for batch in batches for each in (batch.tokens, batch.valid, batch.masked)}) == 1
    rng = np.random.default_rng(0)
    clips = stage.pairs.draw(rng, 1)
    assert any(sample.text.states.shape[1] < words.limit for sample in stage.samples(clips, rng))
