"""HGM³'s residual VQ-VAE (Sec. 3.1): features to tokens and back; convolutions after MoMask (Guo et al. 2024)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from marey.models.hgm3.config import HGM3Config
from marey.nn.convolutional_tokenizer import ConvolutionalTokenizer
from marey.nn.quantizer import ResidualQuantizer


class Tokenizer(ConvolutionalTokenizer):
    """Tokenizer of features in their own units; normalisation is inside."""

    def __init__(self, config: HGM3Config) -> None:
        t = config.tokenizer
        quantizer = ResidualQuantizer(t.levels, t.codes, t.code_width, decay=t.decay, dropout=t.level_dropout)
        super().__init__(config.features, t, quantizer)


def build_tokenizer(parameters: Mapping[str, Any]) -> Tokenizer:
    """Build an untrained tokenizer from the configuration of a bundle or run.

    Raises:
        InvalidInput: the configuration of another model.
    """
    return Tokenizer(HGM3Config.from_dict(parameters))
