"""Tokens of all scales of all clips of a prepared folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.models.momaskpp.scales import Scales
from marey.models.momaskpp.tokenizer import Tokenizer
from marey.nn.quantizer import NO_TOKEN
from marey.training.motions import TOKENS, MotionData, TokenData, encode_phases, fingerprint, made_once


@dataclass(frozen=True)
class ScaleTokens(TokenData):
    """As `TokenData`, but a sequence holds the tokens that a clip has at every scale, block after block; `lengths`
    counts those of the full scale."""

    scales: Scales

    def rows(self, clips: Tensor, phases: Tensor) -> tuple[Tensor, Tensor]:
        """Return tokens (B, N), NO_TOKEN where a clip has none, and lengths (B,) of the full scale."""
        lengths = self.lengths[clips, phases]
        valid = self.scales.valid(lengths)  # (B, N)
        index = self.starts[clips, phases][:, None] + valid.long().cumsum(1) - 1
        tokens = self.tokens[index.clamp(0, len(self.tokens) - 1), 0]
        return tokens.masked_fill(~valid, NO_TOKEN), lengths

    def log_shares(self, codes: int, clips: NDArray[np.int64]) -> Tensor:
        """As of `TokenData`, (1, K): over the tokens of all scales."""
        sizes = self.scales.valid(self.lengths.flatten()).sum(1).view_as(self.lengths)
        return TokenData(self.tokens, self.starts, sizes).log_shares(codes, clips)


def load_scale_tokens(run: Path, tokenizer: Tokenizer, data: MotionData) -> ScaleTokens:
    """Return the tokens of all clips: encoded once per tokenizer and data, then read from the run folder."""
    key = f"{data.prepared.sha256}:{fingerprint(tokenizer)}"
    device = data.features.device
    made = made_once(run / TOKENS, key, device, lambda: encode_clips(tokenizer, data))
    return ScaleTokens(**made, scales=tokenizer.scales)


@torch.no_grad()
def encode_clips(tokenizer: Tokenizer, data: MotionData, *, batch: int = 64) -> dict[str, Tensor]:
    """Encode every clip, longer ones up to the longest that the model makes; training clips at all phases, others at
    phase 0. Returns the fields of `TokenData`."""
    tokenizer.eval()

    def tokens_of(features: Tensor, frames: Tensor) -> list[Tensor]:
        tokens = tokenizer.encode(features, frames)  # (B, N, 1)
        return [row[row[:, 0] != NO_TOKEN] for row in tokens]

    rate, longest = tokenizer.frames_per_token, tokenizer.scales.longest
    return vars(encode_phases(tokens_of, data, rate, longest=longest, batch=batch))
