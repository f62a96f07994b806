"""MoMask's residual VQ-VAE (Sec. 3.1): features to tokens and back, without masks.

The published network convolves padding like motion, so the end of a motion depends on the padding behind it. Here every
motion is encoded and decoded at its own length, as the public code does with one prompt.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from marey.models.momask.config import MoMaskConfig
from marey.nn.convolutional_tokenizer import ConvolutionalTokenizer
from marey.nn.quantizer import NO_TOKEN, ResidualQuantizer


class Tokenizer(ConvolutionalTokenizer):
    """Tokenizer of features in their own units; normalisation is inside."""

    def __init__(self, config: MoMaskConfig) -> None:
        t = config.tokenizer
        super().__init__(config.features, t, ResidualQuantizer(t.levels, t.codes, t.code_width))

    @torch.no_grad()
    def encode(self, features: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Tokens (B, n, V) of features (B, T, D); `lengths` (B,) in frames; positions beyond them are -1."""
        if lengths is None:
            return super().encode(features)
        size = features.shape[1] // self.frames_per_token
        tokens = torch.full((len(features), size, self.quantizer.levels), NO_TOKEN, device=features.device)
        for row, frames in enumerate(lengths.tolist()):
            count = frames // self.frames_per_token
            tokens[row, :count] = super().encode(features[row : row + 1, : count * self.frames_per_token])[0]
        return tokens

    @torch.no_grad()
    def decode(self, tokens: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Features (B, n · N/n, D) in their own units; `lengths` (B,) in TOKENS; zero beyond them."""
        if lengths is None:
            return super().decode(tokens)
        features = self.mean.new_zeros(len(tokens), tokens.shape[1] * self.frames_per_token, len(self.mean))
        for row, count in enumerate(lengths.tolist()):
            made = super().decode(tokens[row : row + 1, :count])
            features[row, : made.shape[1]] = made[0]
        return features


def build_tokenizer(parameters: Mapping[str, Any]) -> Tokenizer:
    """Build an untrained tokenizer from the configuration of a bundle.

    Raises:
        InvalidInput: the configuration of another model.
    """
    return Tokenizer(MoMaskConfig.from_dict(parameters))
