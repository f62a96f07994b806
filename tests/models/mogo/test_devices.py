"""Training on a device of its own."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch

from marey.data.prepared import PreparedData
from marey.models.mogo.config import TINY
from marey.models.mogo.tokenizer import Tokenizer
from marey.training.motions import MotionData
from marey.training.tokenizing import TokenizerStage
from tests.models.mogo.test_objective import transformer_stage
from tests.support.devices import check_training_elsewhere

SPLIT = replace(TINY, ahead=(), depth=replace(TINY.depth, share=1.0))
"""Batches that can be split."""


@pytest.mark.parametrize("joint", [False, True])
def test_no_tensor_of_a_training_is_made_on_another_device(joint: bool, prepared: PreparedData) -> None:
    config = replace(SPLIT, transformer=replace(SPLIT.transformer, joint=joint))
    check_training_elsewhere(transformer_stage(prepared, config))


def test_no_tensor_of_the_training_of_a_tokenizer_is_made_on_another_device(prepared: PreparedData) -> None:
    data = MotionData.load(prepared.path, torch.device("cpu"))
    check_training_elsewhere(TokenizerStage(TINY, data, Tokenizer(TINY)))
