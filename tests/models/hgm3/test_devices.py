"""Training on a device of its own."""

from __future__ import annotations

import torch

from marey.data.prepared import PreparedData
from marey.models.hgm3.config import TINY
from marey.models.hgm3.stage_masked import MaskedStage
from marey.models.hgm3.stage_residual import ResidualStage, length_stage
from marey.training.motions import MotionData
from marey.training.tokenizing import TokenizerStage
from tests.models.hgm3.test_objective import encoded
from tests.support.devices import check_training_elsewhere, like_another_device


def test_no_tensor_of_a_training_is_made_on_another_device(prepared: PreparedData) -> None:
    tokenizer, tokens, captions = encoded(prepared, TINY)
    check_training_elsewhere(TokenizerStage(TINY, MotionData.load(prepared.path, torch.device("cpu")), tokenizer))
    check_training_elsewhere(MaskedStage(TINY, prepared.clips, tokens, captions))
    check_training_elsewhere(ResidualStage(TINY, prepared.clips, tokens, captions, tokenizer.codebooks))
    check_training_elsewhere(length_stage(TINY, prepared.clips, tokens, captions))


def test_tokens_of_whole_clips_are_encoded_and_decoded_where_they_are(prepared: PreparedData) -> None:
    tokenizer = encoded(prepared, TINY)[0].eval()
    features = torch.randn(2, 32, 263)
    wanted = tokenizer.decode(tokenizer.encode(features))
    with like_another_device():
        assert torch.equal(tokenizer.decode(tokenizer.encode(features)), wanted)
