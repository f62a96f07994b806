"""Training MOGO on a small prepared folder."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.core.errors import InvalidInput, NotFound
from marey.data.prepared import PreparedData
from marey.data.style import style_of
from marey.models.mogo import steers
from marey.models.mogo.assembly import assemble, unpack
from marey.models.mogo.config import TINY, MOGOConfig
from marey.models.mogo.level_token import build_transformer
from marey.models.mogo.memory import memory_model
from marey.models.mogo.model import NOT_ASKED, RQHCTransformer, next_targets
from marey.models.mogo.rollouts import Rollouts
from marey.models.mogo.samples import BEFORE_SEAM, MIN_FRAMES, Samples, TokenSpan
from marey.models.mogo.stage_transformer import TransformerStage
from marey.models.mogo.steers import LEAST_ENTERED, load_steers
from marey.models.mogo.tokenizer import Tokenizer
from marey.models.mogo.train import train_stage
from marey.training.budget import Budget
from marey.training.motions import MotionData, TokenData
from marey.training.pairs import Pairs
from marey.training.parts import load_part
from marey.training.sentences import SentenceData
from marey.training.staging import TrainOptions
from marey.training.texts import CaptionTexts
from tests.support.device_memory import device_with_room_for
from tests.support.prepared import farthest_move, write_prepared

CPU = torch.device("cpu")


@pytest.fixture(scope="session")
def stage(prepared: PreparedData, tmp_path_factory: pytest.TempPathFactory) -> TransformerStage:
    torch.manual_seed(0)
    data = MotionData.load(prepared.path, CPU)
    tokenizer = Tokenizer(TINY).eval()
    tokenizer.quantizer.codebooks.normal_()
    tokens = TokenData.encode(tokenizer, data)
    captions = SentenceData.of_sentences(CaptionTexts.load(prepared), prepared.caption_counts, 384, CPU)
    pairs = Pairs(prepared.clips, tokens, captions, MIN_FRAMES)
    run = tmp_path_factory.mktemp("steers")
    single = [int(c) for c in pairs.train if not prepared.clips[int(c)].seams]
    steered = load_steers(run, TINY, tokenizer, data, single, [1.0] * len(single))
    return TransformerStage(TINY, prepared.clips, tokens, captions, steered)


def options(prepared: PreparedData, run: Path, steps: int) -> TrainOptions[MOGOConfig]:
    return TrainOptions(prepared.path, run, TINY, Budget(steps=steps), device="cpu", bf16=False, quiet=True)


def test_both_stages_train_and_leave_their_parts(prepared: PreparedData, tmp_path: Path) -> None:
    with pytest.raises(NotFound, match="has not finished"):
        train_stage("transformer", options(prepared, tmp_path, 2))
    errors = train_stage("tokenizer", options(prepared, tmp_path, 3))
    assert {"test/error_mm", "test/local_mm", "error_mm"} <= set(errors)
    metrics = train_stage("transformer", options(prepared, tmp_path, 3))
    assert set(metrics) >= {"loss", "loss/0", "accuracy/2"}
    assert MOGOConfig.from_dict(load_part(tmp_path / "transformer" / "part").config) == TINY
    with pytest.raises(InvalidInput, match="Known: tokenizer, transformer, all"):
        train_stage("masked", options(prepared, tmp_path, 1))


def test_auto_splits_batches_by_the_memory_of_the_device(prepared: PreparedData, tmp_path: Path) -> None:
    plain = replace(TINY, ahead=(), depth=replace(TINY.depth, share=1.0))
    given = replace(options(prepared, tmp_path, 1), config=plain)
    train_stage("tokenizer", given)
    with device_with_room_for(3, memory_model(plain, bf16=False)) as chosen:
        train_stage("transformer", replace(given, micro_batch="auto"))
    assert chosen == [3]


def test_validation_keeps_every_prompt(stage: TransformerStage, monkeypatch: pytest.MonkeyPatch) -> None:
    """The share of dropped prompts is of training alone."""
    stage.module.eval()
    kept = stage.validate()
    dropped = replace(TINY, condition=replace(TINY.condition, drop=1.0))
    monkeypatch.setattr(stage.module, "config", dropped)
    assert stage.validate() == kept


def test_a_bundle_taken_apart_and_assembled_again_is_the_same_and_trains_on(
    prepared: PreparedData, tmp_path: Path
) -> None:
    run, again = tmp_path / "run", tmp_path / "again"
    for stage in ("tokenizer", "transformer"):
        train_stage(stage, options(prepared, run, 3))
    bundle = assemble(prepared.path, run, tmp_path / "first", TINY)
    assert unpack(bundle, again) == TINY
    copy = assemble(prepared.path, again, tmp_path / "second", TINY)
    for stage in ("tokenizer", "transformer"):
        theirs, ours = bundle.tensors(stage), copy.tensors(stage)
        assert theirs.keys() == ours.keys()
        assert all(np.array_equal(theirs[name], ours[name]) for name in theirs)
        before = load_part(again / stage / "part").state
        train_stage(stage, replace(options(prepared, again, 1), warm=True))
        after = load_part(again / stage / "part").state
        assert 0 < farthest_move(before, after) < 0.1, stage  # from the weights that were there, not from random ones
    with pytest.raises(InvalidInput, match="already has a stage tokenizer"):
        unpack(bundle, again)


def test_the_transformer_learns_the_clips_it_sees(prepared: PreparedData, tmp_path: Path) -> None:
    train_stage("tokenizer", options(prepared, tmp_path, 3))
    fast = replace(TINY, train_transformer=replace(TINY.train_transformer, learning_rate=1e-2))
    short, long = (
        train_stage("transformer", replace(options(prepared, tmp_path, steps), config=fast)) for steps in (2, 25)
    )
    assert long["loss/0"] < short["loss/0"] - 0.2


def rows(stage: TransformerStage, clip: int) -> tuple[int, int]:
    """First token of a clip, and its frames."""
    return int(stage.samples._starts[clip]), int(stage.samples.lengths[clip])


def test_stretches_are_acts_or_two_that_follow_each_other(stage: TransformerStage) -> None:
    joined = next(i for i, c in enumerate(stage.samples.clips) if len(c.seams) == 1 and c.split == "train")
    about = stage.samples.clips[joined]
    start, length = rows(stage, joined)
    own = int(stage.samples.captions.first[joined] + stage.samples.captions.count[joined])
    seam = about.seams[0]
    seen = set()
    for seed in range(200):
        stretch = stage.samples.of_clip(joined, np.random.default_rng(seed))
        first, stop = stretch.first - start, stretch.first - start + stretch.frames
        assert 0 <= first < stop <= length
        if stretch.seam:
            assert first + stretch.seam == seam
            assert (stretch.before, stretch.after) == (own, own + 1)
        else:
            assert stretch.before == stretch.after == own + (first >= seam)
            assert stop <= seam or first >= seam
        assert stretch.ends == (stop in (seam, length))
        assert (stretch.skipped == 0) == (first == 0)
        seen.add((stretch.seam > 0, first >= seam, stretch.skipped > 1))
    assert seen >= {(False, False, False), (False, True, False), (True, False, False)}


def test_a_model_that_does_not_split_prompts_learns_joined_clips_as_one_sample(stage: TransformerStage) -> None:
    given = stage.samples
    joined = next(i for i, c in enumerate(given.clips) if len(c.seams) == 1 and c.split == "train")
    tokens = TokenData(given.tokens, torch.from_numpy(given._starts)[:, None], torch.from_numpy(given.lengths)[:, None])
    samples = Samples(given.clips, tokens, given.captions, None, given.most, split=False)
    first = int(given.captions.first[joined])
    for seed in range(20):
        span = samples.of_clip(joined, np.random.default_rng(seed))
        assert not span.seam
        assert (span.skipped, span.frames) == (0, min(int(given.lengths[joined]), given.most)), "no crop unasked"
        assert first <= span.before == span.after < first + int(given.captions.authors[joined].sum())
    _, frames = samples.captioned_actions(np.array([joined]))
    assert set(frames.tolist()) == {int(given.lengths[joined])}


def test_a_single_act_has_one_of_its_captions_and_is_sometimes_cut(stage: TransformerStage) -> None:
    single = next(i for i, c in enumerate(stage.samples.clips) if not c.seams and c.split == "train" and c.length >= 20)
    start, length = rows(stage, single)
    found = [stage.samples.of_clip(single, np.random.default_rng(seed)) for seed in range(100)]
    first = int(stage.samples.captions.first[single])
    assert {s.before for s in found} <= set(range(first, first + int(stage.samples.captions.count[single])))
    assert all(s.before == s.after and s.seam == 0 for s in found)
    assert any(s.skipped for s in found)
    assert any(not s.skipped for s in found)
    assert all(s.first == start + s.skipped for s in found)
    assert all(s.ends == (s.skipped + s.frames == length) for s in found)
    assert stage.samples.crops == TINY.crops == 0.4


def test_a_stretch_that_is_too_long_loses_its_end_and_a_seam_behind_it() -> None:
    whole = TokenSpan(first=7, frames=40, skipped=0, before=1, after=2, seam=30, ends=True)
    assert whole.shortened(40) == whole
    assert whole.shortened(35) == replace(whole, frames=35, ends=False)
    assert whole.shortened(24) == replace(whole, frames=24, seam=0, ends=False)


def test_what_is_drawn_becomes_tokens_prompts_and_seams(stage: TransformerStage) -> None:
    rng = np.random.default_rng(0)
    some = [stage.samples.anytime(rng) for _ in range(4)]
    some += [stage.samples.of_clip(int(c), rng) for c in stage.pairs.draw(rng, 8)]
    sample = stage.samples.collate(some)
    for row, stretch in enumerate(some):
        assert int(sample.lengths[row]) == stretch.frames
        wanted = stage.samples.tokens[stretch.first : stretch.first + stretch.frames]
        assert torch.equal(sample.tokens[row, : stretch.frames], wanted)
        assert (sample.tokens[row, stretch.frames :] == -1).all()
        said = torch.tensor([stretch.before, stretch.after])
        assert torch.equal(sample.prompts[row], stage.samples.captions.sentences(said))
        assert int(sample.seam[row]) == (stretch.seam or int(sample.lengths.max()) + 1)
    targets = next_targets(sample.tokens, sample.lengths, 32, ends=sample.ends, skipped=sample.skipped)
    assert (targets[:, 0] == 32).any(1).tolist() == [s.ends for s in some]
    assert ((targets[:, 0, 0] == NOT_ASKED) == (sample.skipped > 0)).all()


def test_some_steered_motions_leave_what_the_model_itself_makes(
    prepared: PreparedData, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(steers, "WORST_SEAM", np.inf)  # of random weights no clip can be entered
    torch.manual_seed(0)
    data, tokenizer, model = MotionData.load(prepared.path, CPU), Tokenizer(TINY).eval(), RQHCTransformer(TINY)
    tokenizer.quantizer.codebooks.normal_()
    captions = SentenceData.of_sentences(CaptionTexts.load(prepared), prepared.caption_counts, 384, CPU)
    clips = [i for i, c in enumerate(prepared.clips) if c.split == "train" and not c.seams]
    config = replace(TINY, steers=2)
    rollouts = Rollouts(model, tokenizer, captions)
    made = load_steers(tmp_path, config, tokenizer, data, clips, [1.0] * len(clips), rollouts)
    drawn = range(2, len(made.starts))
    assert len(drawn) == TINY.rollouts
    left = made.left[2:].tolist()
    again = list(Rollouts(model, tokenizer, captions).draw(left, TINY.max_frames - LEAST_ENTERED))
    assert {rollout.clip for rollout in again} == set(left)
    for row in drawn:
        rollout = again[row - 2]
        start, seam = int(made.starts[row]), int(made.seams[row])
        assert torch.equal(made.tokens[start : start + seam], rollout.tokens)
        assert seam < int(made.lengths[row]) <= TINY.max_frames


def test_steered_motions_leave_one_clip_for_another_and_are_made_once(prepared: PreparedData, tmp_path: Path) -> None:
    torch.manual_seed(0)
    data, tokenizer = MotionData.load(prepared.path, CPU), Tokenizer(TINY).eval()
    tokenizer.quantizer.codebooks.normal_()
    clips = [i for i, c in enumerate(prepared.clips) if c.split == "train" and not c.seams]
    made = load_steers(tmp_path, TINY, tokenizer, data, clips, [1.0] * len(clips))
    assert len(made.starts) == TINY.steers
    assert len(made.tokens) == int(made.lengths.sum())
    assert (made.lengths <= TINY.max_frames).all()
    assert ((made.seams >= 8) & (made.seams < made.lengths)).all()
    assert (made.left != made.entered).all()
    written = (tmp_path / "steers.safetensors").stat().st_mtime_ns
    again = load_steers(tmp_path, TINY, tokenizer, data, clips, [1.0] * len(clips))
    assert all(torch.equal(getattr(made, name), getattr(again, name)) for name in vars(made))
    assert (tmp_path / "steers.safetensors").stat().st_mtime_ns == written
    # the frames before the seam are those of the clip that was left
    for row in range(len(made.starts)):
        seam = int(made.seams[row])
        clip = prepared.clips[int(made.left[row])]
        features = data.features[clip.start : clip.start + seam - 1][None]
        whole = tokenizer.encode(features, torch.tensor([seam - 1]))[0]
        reach = 4  # frames by which the encoder looks ahead
        start = int(made.starts[row])
        assert torch.equal(made.tokens[start : start + max(seam - 1 - reach, 0)], whole[: max(seam - 1 - reach, 0)])


def test_a_bundle_records_captions_of_its_training_data(tmp_path: Path) -> None:
    data = PreparedData.open(write_prepared(tmp_path / "data", clips=12, acts=("walk", "bow", "jump")))
    given = options(data, tmp_path / "run", 1)
    for stage in ("tokenizer", "transformer"):
        train_stage(stage, given)
    made = assemble(data.path, given.run, tmp_path / "bundle", TINY)
    assert made.manifest.text is not None
    assert made.manifest.text.style == style_of(data.split("train"))
    assert set(made.manifest.text.style) == {f"a person does {act}" for act in ("walk", "bow", "jump")}


def test_prompts_are_standardised_over_the_training_captions_unless_the_bundle_says_otherwise(
    stage: TransformerStage,
) -> None:
    captions = stage.samples.captions
    spoken = captions.sentence[captions.captions_of(stage.pairs.train.tolist())]
    read = stage.module.prompt.standardised(captions.strings[spoken].double())
    torch.testing.assert_close(read.mean(0), torch.zeros(384).to(read), atol=1e-4, rtol=0)
    torch.testing.assert_close(read.std(0, correction=0), torch.ones(384).to(read), atol=1e-3, rtol=0)
    plain = replace(TINY, condition=replace(TINY.condition, standardised=False))
    places = (torch.from_numpy(each)[:, None] for each in (stage.samples._starts, stage.samples.lengths))
    tokens = TokenData(stage.samples.tokens, *places)
    prompt = TransformerStage(plain, stage.samples.clips, tokens, captions).module.prompt
    assert not prompt.mean.any()
    assert (prompt.std == 1).all()


def test_validation_of_a_network_that_knows_nothing_is_that_of_chance(stage: TransformerStage) -> None:
    """Of K codes each is right once in K times, on every level; level 0 may be END as well."""
    known = stage.module
    stage.module = build_transformer(TINY).eval()
    for parameter in stage.module.head.parameters():
        parameter.data.zero_()
    found = stage.validate()
    stage.module = known
    codes = TINY.tokenizer.codes
    assert found["loss/0"] == pytest.approx(math.log(codes + 1), rel=1e-4)
    for level in range(1, TINY.tokenizer.levels):
        assert found[f"loss/{level}"] == pytest.approx(math.log(codes), rel=1e-4)
        assert found[f"accuracy/{level}"] == pytest.approx(1 / codes, rel=1e-3)
    assert found["accuracy/0"] == pytest.approx(1 / (codes + 1), rel=1e-3)


@pytest.mark.parametrize(("frames", "most"), [(MIN_FRAMES, 0), (MIN_FRAMES + 1, 1), (MIN_FRAMES + 5, 5)])
def test_a_crop_leaves_the_shortest_motion_and_may_take_a_single_frame(
    frames: int, most: int, stage: TransformerStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stage.samples, "crops", 1.0)
    whole = TokenSpan(first=7, frames=frames, skipped=0, before=1, after=1, seam=0, ends=True)
    found = {stage.samples._cut(whole, np.random.default_rng(seed)).skipped for seed in range(60)}
    assert found == (set(range(1, most + 1)) or {0})


def test_a_crop_ends_before_the_seam(stage: TransformerStage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stage.samples, "crops", 1.0)
    whole = TokenSpan(first=7, frames=22, skipped=0, before=1, after=2, seam=12, ends=True)
    found = [stage.samples._cut(whole, np.random.default_rng(seed)) for seed in range(60)]
    assert {each.seam for each in found} == set(range(BEFORE_SEAM, 12))
