"""Training MOGO on a small prepared folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from shared.errors import InvalidInput, NotFound
from tests.support.prepared import farthest_move, write_prepared
from workers.mogo.assembly import assemble, take_apart
from workers.mogo.config import TINY, MOGOConfig
from workers.mogo.model import NOT_ASKED, next_targets
from workers.mogo.stage_transformer import MIN_FRAMES, TransformerStage
from workers.mogo.tokenizer import Tokenizer
from workers.mogo.train import train_stage
from workers.training.budget import Budget
from workers.training.data.prepared import PreparedData
from workers.training.motions import MotionData, TokenData
from workers.training.parts import load_part
from workers.training.sentences import SentenceData
from workers.training.staging import TrainOptions
from workers.training.texts import CaptionTexts

CPU = torch.device("cpu")


@pytest.fixture(scope="session")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    return PreparedData.open(write_prepared(tmp_path_factory.mktemp("mogo") / "prepared"))


@pytest.fixture(scope="session")
def stage(prepared: PreparedData) -> TransformerStage:
    torch.manual_seed(0)
    data = MotionData.load(prepared.path, CPU)
    tokenizer = Tokenizer(TINY).eval()
    tokenizer.quantizer.codebooks.normal_()
    tokens = TokenData.encode(tokenizer, data)
    captions = SentenceData.of_sentences(CaptionTexts.load(prepared), prepared.caption_counts, 384, CPU)
    return TransformerStage(TINY, prepared.clips, tokens, captions)


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


def test_a_bundle_taken_apart_and_assembled_again_is_the_same_and_trains_on(
    prepared: PreparedData, tmp_path: Path
) -> None:
    run, again = tmp_path / "run", tmp_path / "again"
    for stage in ("tokenizer", "transformer"):
        train_stage(stage, options(prepared, run, 3))
    bundle = assemble(prepared.path, run, tmp_path / "first", TINY)
    assert take_apart(bundle, again) == TINY
    copy = assemble(prepared.path, again, tmp_path / "second", TINY)
    for stage in ("tokenizer", "transformer"):
        theirs, ours = bundle.tensors(stage), copy.tensors(stage)
        assert theirs.keys() == ours.keys()
        assert all(np.array_equal(theirs[name], ours[name]) for name in theirs)
        before = load_part(again / stage / "part").state
        train_stage(stage, replace(options(prepared, again, 1), warm=True))
        after = load_part(again / stage / "part").state
        assert 0 < farthest_move(before, after) < 0.1, stage  # from the weights that were there, not from random ones
    with pytest.raises(InvalidInput, match="has a stage tokenizer already"):
        take_apart(bundle, again)


def test_the_transformer_learns_the_clips_it_sees(prepared: PreparedData, tmp_path: Path) -> None:
    train_stage("tokenizer", options(prepared, tmp_path, 3))
    short = train_stage("transformer", options(prepared, tmp_path, 2))
    long = train_stage("transformer", options(prepared, tmp_path, 60))
    assert long["loss"] < short["loss"] - 0.2


def test_cuts_lie_within_their_clips_and_around_their_seams(stage: TransformerStage) -> None:
    seen = set()
    for seed in range(300):
        rng = np.random.default_rng(seed)
        clips = stage.pairs.draw(rng, 8)
        cuts = stage.cut(clips, rng)
        lengths = stage.lengths[clips]
        assert (cuts.first >= 0).all()
        assert (cuts.stop <= lengths).all()
        assert (cuts.stop - cuts.first <= TINY.max_frames).all()
        assert (cuts.said <= cuts.first).all()
        plain = cuts.seam < 0
        assert (cuts.stop - cuts.first >= np.minimum(MIN_FRAMES, TINY.max_frames))[plain].all()
        assert (cuts.first < cuts.seam)[~plain].all()
        for clip, seam, act in zip(clips[~plain], cuts.seam[~plain], cuts.act[~plain], strict=True):
            assert stage.clips[int(clip)].seams[act] == seam
        seen |= {(bool(p), bool(f)) for p, f in zip(plain, cuts.first > 0, strict=True)}
    assert seen == {(True, False), (True, True), (False, False), (False, True)}


def test_a_steered_sample_has_the_caption_of_each_act_and_others_the_same_twice(stage: TransformerStage) -> None:
    joined = next(i for i, c in enumerate(stage.clips) if c.seams and c.split == "train")
    single = next(i for i, c in enumerate(stage.clips) if not c.seams and c.split == "train")
    clips = np.array([joined, single])
    for seed in range(40):
        rng = np.random.default_rng(seed)
        cuts = stage.cut(clips, rng)
        sample = stage.sample(clips, cuts, rng)
        own = stage.captions.first[joined] + stage.captions.count[joined]
        if cuts.seam[0] >= 0:
            wanted = stage.captions.sentences(torch.tensor([own, own + 1]))
            assert torch.equal(sample.prompts[0], wanted)
            assert int(sample.seam[0]) == cuts.seam[0] - cuts.first[0] >= 1
        assert torch.equal(sample.prompts[1, 0], sample.prompts[1, 1])
        assert int(sample.seam[1]) > int(sample.lengths[1])
        start = stage.tokens.starts[single, 0] + cuts.first[1]
        size = int(sample.lengths[1])
        assert torch.equal(sample.tokens[1, :size], stage.tokens.tokens[start : start + size])


def test_the_end_is_asked_only_where_a_clip_ends(stage: TransformerStage) -> None:
    clips = stage.pairs.train[:6]
    for seed in range(20):
        rng = np.random.default_rng(seed)
        cuts = stage.cut(clips, rng)
        sample = stage.sample(clips, cuts, rng)
        targets = next_targets(sample.tokens, sample.lengths, 32, ends=sample.ends, skipped=sample.skipped)
        asked = (targets[:, 0] == 32).sum(1).bool()
        assert asked.tolist() == (cuts.stop == stage.lengths[clips]).tolist()
        assert ((targets[:, 0, 0] == NOT_ASKED) == (sample.skipped > 0)).all()
