"""What a bundle of HGM³ makes of training captions is trained on where it obeyed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.bundles import Bundle
from marey.checks.judge import Expectation, Verdict
from marey.core.errors import InvalidFile
from marey.data.prepared import PreparedData
from marey.models.hgm3 import practice
from marey.models.hgm3.assembly import take_apart
from marey.models.hgm3.bundle import random_bundle
from marey.models.hgm3.config import TINY, HGM3Config
from marey.models.hgm3.data import CaptionData
from marey.models.hgm3.generate import Generator
from marey.models.hgm3.practice import practise
from marey.models.hgm3.stage_masked import MaskedStage
from marey.models.hgm3.tokenizer import Tokenizer
from marey.models.hgm3.train import train_stage
from marey.training.budget import Budget
from marey.training.drawn import FILE, Drawn, load_drawn
from marey.training.motions import MotionData, TokenData
from marey.training.staging import TrainOptions
from marey.training.texts import CaptionTexts
from tests.support.prepared import text_features, write_prepared

CPU = torch.device("cpu")


class Reader:
    """Reads every prompt as a made-up sentence, and remembers what it was asked."""

    def __init__(self) -> None:
        self.asked: list[str] = []

    def features(self, prompts: Sequence[str]) -> list[object]:
        self.asked += prompts
        return [text_features(len(prompt)) for prompt in prompts]


def another_tokenizer() -> Tokenizer:
    torch.manual_seed(0)
    tokenizer = Tokenizer(TINY).eval()
    tokenizer.quantizer.codebooks.normal_()
    return tokenizer


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    folder = tmp_path_factory.mktemp("several") / "prepared"
    return PreparedData.open(write_prepared(folder, 40, ("walk", "bow", "idle", "run")))


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return random_bundle(tmp_path_factory.mktemp("bundle") / "random-tiny")


@pytest.fixture
def obeying(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Lets the checker find that one action is obeyed, and no other."""

    def only(act: str) -> None:
        def verdict(_joints: object, _fps: float, expected: Sequence[Expectation]) -> Verdict:
            return Verdict([each.act for each in expected] == [act])

        monkeypatch.setattr(practice, "judge", verdict)

    return only


def test_what_obeys_is_kept_and_what_does_not_is_tried_three_times(
    several: PreparedData, bundle: Bundle, obeying: Callable[[str], None]
) -> None:
    obeying("walk")
    reader = Reader()
    drawn = practise(Generator.load(bundle, device="cpu"), reader, several, 24)
    acts = [several.clips[clip].acts for clip in drawn.clips]
    assert acts
    assert set(acts) == {("walk",)}
    assert not [prompt for prompt in reader.asked if "idle" in prompt]  # no check exists for it
    assert len(reader.asked) == len(acts) + 3 * (24 - len(acts))
    assert len(drawn.tokens) == int(drawn.lengths.sum())
    assert drawn.tokens.shape[1] == TINY.tokenizer.levels
    assert all(several.clips[clip].split == "train" for clip in drawn.clips)


def test_what_was_drawn_is_further_clips_with_the_captions_of_those_it_was_drawn_for(several: PreparedData) -> None:
    levels = TINY.tokenizer.levels
    drawn = Drawn.of([(7, torch.full((9, levels), 1)), (2, torch.full((7, levels), 2))])
    data = MotionData.load(several.path, CPU)
    tokenizer = another_tokenizer()
    tokens = TokenData.encode(tokenizer, data)
    captions = CaptionData.of(CaptionTexts.load(several), several.caption_counts, TINY.condition, CPU)
    clips, more, said = drawn.extend(several.clips, tokens, captions)
    assert clips[-2:] == [several.clips[7], several.clips[2]]
    for row, (clip, code, length) in enumerate([(7, 1, 9), (2, 2, 7)], start=len(several.clips)):
        for phase in range(tokens.phases):
            found, lengths = more.batch(torch.tensor([row]), torch.tensor([phase]), 12)
            assert lengths.tolist() == [length]
            assert (found[0, :length] == code).all()
        assert (said.first[row], said.count[row]) == (captions.first[clip], captions.count[clip])
    before, after = (t.batch(torch.tensor([3]), torch.tensor([0]), 12)[0] for t in (tokens, more))
    assert torch.equal(before, after)
    stage = MaskedStage(TINY, clips, more, said)
    assert {len(several.clips), len(several.clips) + 1} <= set(stage.pairs.train.tolist())


def test_the_masked_stage_trains_on_what_lies_in_its_run_and_refuses_what_is_of_another_tokenizer(
    several: PreparedData,
    bundle: Bundle,
    tmp_path: Path,
    obeying: Callable[[str], None],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    obeying("bow")
    take_apart(bundle, tmp_path)
    generator = Generator.load(bundle, device="cpu")
    drawn = practise(generator, Reader(), several, 12)
    drawn.write(tmp_path, generator.networks.tokenizer, several)
    read = load_drawn(tmp_path, generator.networks.tokenizer, several)
    assert read is not None
    assert np.array_equal(read.clips, drawn.clips)
    assert torch.equal(read.tokens, drawn.tokens)
    assert torch.equal(read.lengths, drawn.lengths)

    seen: list[int] = []
    own = MaskedStage.__init__

    def watched(self: MaskedStage, config: HGM3Config, clips: Sequence[object], *rest: object) -> None:
        seen.append(len(clips))
        own(self, config, clips, *rest)

    monkeypatch.setattr(MaskedStage, "__init__", watched)
    options = TrainOptions(
        several.path, tmp_path, TINY, Budget(steps=1), warm=True, device="cpu", bf16=False, quiet=True
    )
    train_stage("masked", options)
    assert seen == [len(several.clips) + len(drawn.clips)]
    drawn.write(tmp_path, another_tokenizer(), several)
    with pytest.raises(InvalidFile, match="another tokenizer"):
        train_stage("masked", options)
    (tmp_path / FILE).unlink()
    train_stage("masked", options)
    assert seen[-1] == len(several.clips)
