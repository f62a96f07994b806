"""The convolutional tokenizer of any number of stages."""

from __future__ import annotations

from dataclasses import dataclass

import pytest
import torch

from marey.nn.convolutional_tokenizer import ConvolutionalTokenizer
from marey.nn.quantizer import ResidualQuantizer


@dataclass(frozen=True)
class Shape:
    """Sizes of a small tokenizer."""

    stages: int
    width: int = 8
    depth: int = 1
    code_width: int = 4
    dropout: float = 0.0


@pytest.mark.parametrize("stages", [0, 1, 2, 3, 4])
def test_each_stage_halves_the_frame_rate_and_decoding_gives_it_back(stages: int) -> None:
    torch.manual_seed(0)
    made = ConvolutionalTokenizer(6, Shape(stages), ResidualQuantizer(2, 8, 4, dropout=0.0)).eval()
    assert made.frames_per_token == 2**stages
    features, lengths = torch.randn(2, 32, 6), torch.tensor([32, 16])
    tokens = made.encode(features, lengths)
    assert tokens.shape == (2, 32 // 2**stages, 2)
    assert (tokens[1, 16 // 2**stages :] == -1).all()
    assert (tokens[1, : 16 // 2**stages] >= 0).all()
    assert made.decode(tokens[:1]).shape == (1, 32, 6)
