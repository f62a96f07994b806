"""The evaluator on published sets, whose clips have captions and no actions."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from marey.data.manifest import Clip
from marey.data.prepared import PreparedData
from marey.data.snapmogen import prepare_snapmogen
from marey.data.t2m_folder import HUMANML3D_SET, prepare_t2m
from marey.evaluator.config import PAPER, STARTER, TINY
from marey.evaluator.labels import label_of
from marey.evaluator.reference import ReferenceClip, ReferenceSplit
from marey.evaluator.stage_tmr import TMRStage
from marey.training.motions import MotionData
from tests.support import snapmogen_folder
from tests.support.t2m_folder import write_folder_to_measure
from tests.support.texts import shared_encoder


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> PreparedData:
    folder = tmp_path_factory.mktemp("published")
    prepare_t2m(HUMANML3D_SET, write_folder_to_measure(folder / "published"), folder / "data")
    return PreparedData.open(folder / "data")


def stage_of(data: PreparedData, *, spared: bool) -> TMRStage:
    config = replace(TINY, loss=replace(TINY.loss, spare_same_label=spared))
    torch.manual_seed(0)
    return TMRStage(config, MotionData.load(data.path, torch.device("cpu")), shared_encoder())


def test_all_other_clips_are_negatives(data: PreparedData) -> None:
    found = stage_of(data, spared=True).validate()
    assert found["contrast"] > 0.5 * math.log(2), "two clips, of which networks without training know nothing"


def test_the_clip_alone_answers_its_captions(data: PreparedData) -> None:
    found = stage_of(data, spared=True).test()
    for k in (1, 2, 3):
        assert found[f"test/pair_r{k}"] == found[f"test/label_r{k}"] < 0.5


def test_same_label_is_an_option_that_paper_leaves_off(data: PreparedData) -> None:
    stages = [stage_of(data, spared=spared) for spared in (True, False)]
    for stage in stages:
        stage.labels.zero_()
    spared, whole = (stage.validate()["contrast"] for stage in stages)
    assert spared == 0 < whole
    assert (PAPER.loss.spare_same_label, STARTER.loss.spare_same_label) == (False, True)
    assert "spare_same_label" not in STARTER.to_dict()["loss"], "earlier releases read the bundle"


def test_references_of_earlier_releases_are_told_apart(data: PreparedData) -> None:
    def stored(clip: Clip) -> ReferenceClip:
        made = ReferenceClip.of(clip, data.joints(clip), 20.0, 196)
        return made.model_copy(update={"label": "motion, normal"})

    clips = [stored(clip) for clip in data.split("test")[:4]]
    split = ReferenceSplit.of(clips, np.zeros((4, 8), np.float32))
    assert len(set(split.labels.tolist())) == 4


def test_clips_of_snapmogen_have_labels_of_their_own(tmp_path: Path) -> None:
    prepare_snapmogen(snapmogen_folder.write_folder(tmp_path / "published"), tmp_path / "out")
    clips = PreparedData.open(tmp_path / "out").clips
    assert len({label_of(clip) for clip in clips}) == len(clips) > 1
