"""Multi-scale RVQ-VAE motion tokenizer with attention after each stage (Sec. 4.2.1).

Read top to bottom: attention, encoder, decoder, tokenizer. Inside, features run as (B, C, T). With the layout `own`
they are zero beyond a clip's own length after every operation; with `padded` a clip stands in the length of the longest
one, convolutions read its padding, and only attention leaves it out: published weights were trained so.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.models.momaskpp.config import MoMaskPPConfig, TokenizerConfig
from marey.models.momaskpp.quantizer import MultiScaleQuantizer
from marey.models.momaskpp.scales import Scales
from marey.nn.convolution import ResidualBlock, frame_mask, masked
from marey.nn.motion_tokenizer import MotionTokenizer
from marey.nn.quantizer import NO_TOKEN, Quantized
from marey.nn.transformer import Attention


class DilatedBlocks(nn.Module):
    """Residual blocks with falling dilation: 3^(depth-1), …, 3, 1."""

    def __init__(self, width: int, depth: int, dropout: float) -> None:
        super().__init__()
        self.blocks = nn.ModuleList(ResidualBlock(width, 3**i, dropout) for i in reversed(range(depth)))

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """(B, C, T) -> (B, C, T)."""
        for block in self.blocks:
            x = block(x, mask)
        return x


class FrameAttention(nn.Module):
    """Norm, attention without positions, and the input: no feed-forward."""

    def __init__(self, config: TokenizerConfig) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(config.width)
        self.attention = Attention(config.width, config.attention_heads, config.attention_dropout)

    def forward(self, x: Tensor, readable: Tensor, mask: Tensor | None) -> Tensor:
        """(B, C, T) -> (B, C, T); `readable` (B, T) bool marks the frames of the clips."""
        mixed = self.attention(self.norm(x.transpose(1, 2)), readable[:, None, None])
        return masked(x + mixed.transpose(1, 2), mask)


class NoAttention(nn.Module):
    """In place of attention: the input."""

    def forward(self, x: Tensor, readable: Tensor, mask: Tensor | None) -> Tensor:
        """(B, C, T) as it is."""
        return x


def _stages(config: TokenizerConfig) -> tuple[nn.ModuleList, nn.ModuleList]:
    """Residual blocks and attention of each stage."""
    residuals = (DilatedBlocks(config.width, config.depth, config.dropout) for _ in range(config.stages))
    attention = (FrameAttention(config) if config.attention else NoAttention() for _ in range(config.stages))
    return nn.ModuleList(residuals), nn.ModuleList(attention)


class Encoder(nn.Module):
    """Features (B, D, T) to latents (B, d, T / 2^stages)."""

    def __init__(self, features: int, config: TokenizerConfig) -> None:
        super().__init__()
        width = config.width
        self.leaky = config.layout == "padded"
        self.in_proj = nn.Conv1d(features, width, 3, padding=1)
        self.down = nn.ModuleList(nn.Conv1d(width, width, 4, 2, 1) for _ in range(config.stages))
        self.residuals, self.attention = _stages(config)
        self.out_proj = nn.Conv1d(width, config.code_width, 3, padding=1)

    def forward(self, x: Tensor, lengths: Tensor) -> Tensor:
        """`lengths` (B,) frames."""
        mask = _mask(lengths, x, leaky=self.leaky)
        x = masked(F.relu(self.in_proj(masked(x, mask))), mask)
        for down, residuals, attention in zip(self.down, self.residuals, self.attention, strict=True):
            lengths = lengths // 2
            x = down(x)  # (B, C, T / 2)
            mask = _mask(lengths, x, leaky=self.leaky)
            x = residuals(masked(x, mask), mask)
            x = attention(x, frame_mask(lengths, x.shape[2]), mask)
        return masked(self.out_proj(x), mask)


class Decoder(nn.Module):
    """Latents (B, d, n) to features (B, D, n · 2^stages)."""

    def __init__(self, features: int, config: TokenizerConfig) -> None:
        super().__init__()
        width = config.width
        self.leaky = config.layout == "padded"
        self.in_proj = nn.Conv1d(config.code_width, width, 3, padding=1)
        self.residuals, self.attention = _stages(config)
        self.up = nn.ModuleList(nn.Conv1d(width, width, 3, padding=1) for _ in range(config.stages))
        self.smooth = nn.Conv1d(width, width, 3, padding=1)
        self.out_proj = nn.Conv1d(width, features, 3, padding=1)
        self.dtype = torch.float32

    def prepare_inference(self, dtype: torch.dtype) -> None:
        """Cast the stages to `dtype` for inference; the last two convolutions stay, so that no frame is rounded."""
        for stages in (self.residuals, self.attention, self.up):
            stages.to(dtype)
        self.dtype = dtype

    def forward(self, x: Tensor, lengths: Tensor) -> Tensor:
        """`lengths` (B,) tokens."""
        mask = _mask(lengths, x, leaky=self.leaky)
        x, mask = masked(F.relu(self.in_proj(x)), mask).to(self.dtype), None if mask is None else mask.to(self.dtype)
        for residuals, up, attention in zip(self.residuals, self.up, self.attention, strict=True):
            x = residuals(x, mask).repeat_interleave(2, dim=-1)  # nearest: (B, C, 2 T)
            lengths = lengths * 2
            mask = _mask(lengths, x, leaky=self.leaky)
            x = masked(up(x), mask)
            x = attention(x, frame_mask(lengths, x.shape[2]), mask)
        x, mask = x.float(), None if mask is None else mask.float()
        x = masked(F.relu(self.smooth(x)), mask)
        return masked(self.out_proj(x), mask)


class Tokenizer(MotionTokenizer):
    """Tokenizer of features in their own units; normalisation is inside."""

    quantizer: MultiScaleQuantizer

    def __init__(self, config: MoMaskPPConfig) -> None:
        super().__init__(config.features, config.tokenizer.frames_per_token)
        self.scales = Scales.of(config)
        self.encoder = Encoder(config.features, config.tokenizer)
        self.decoder = Decoder(config.features, config.tokenizer)
        self.quantizer = MultiScaleQuantizer(config.tokenizer, self.scales)

    @property
    def codebooks(self) -> Tensor:
        """(1, K, d): all scales share it."""
        return self.quantizer.codebooks

    def forward(self, features: Tensor, lengths: Tensor | None = None) -> tuple[Tensor, Quantized]:
        """Reconstruct (training): features (B, T, D) in their own units, `lengths` (B,) in frames or None = all T.

        Returns:
            reconstruction (B, T, D), normalised, and the quantizer's result. T and lengths divide by the rate N/n.
        """
        latent, tokens = self.latents(features, lengths)
        quantized = self.quantizer.quantize(latent, tokens)
        return self.reconstruct(quantized.output, tokens)[:, : features.shape[1]].float(), quantized

    def latents(self, features: Tensor, lengths: Tensor | None = None) -> tuple[Tensor, Tensor]:
        """Encode features as latents (B, T', d), T' the longest clip's tokens where padded, and lengths in tokens."""
        batch, frames = features.shape[:2]
        if lengths is None:
            lengths = torch.full((batch,), frames, device=features.device)
        size = self.scales.longest * self.frames_per_token if self.scales.layout == "padded" else frames
        x = F.pad(self.normalize(features) * frame_mask(lengths, frames)[..., None], (0, 0, 0, size - frames))
        return self.encoder(x.transpose(1, 2), lengths).transpose(1, 2), lengths // self.frames_per_token

    def reconstruct(self, latent: Tensor, lengths: Tensor) -> Tensor:
        """Decode latents (B, T', d) of clips of `lengths` (B,) tokens to normalised features (B, T' · N/n, D)."""
        latent = latent * frame_mask(lengths, latent.shape[1])[..., None]
        return self.decoder(latent.transpose(1, 2), lengths).transpose(1, 2)

    @torch.no_grad()
    def encode(self, features: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Tokens (B, N, 1) of features (B, T, D): a block a scale, coarse to fine, -1 where a clip has no token.

        Padded residuals are cut off at the number of FRAMES instead of tokens, as published transformers' training
        tokens were made: nearly always they run on into the padding.
        """
        latent, tokens = self.latents(features, lengths)
        padded = self.scales.layout == "padded"
        cut = (tokens * self.frames_per_token).clamp(max=self.scales.longest) if padded else tokens
        index = self.quantizer.indices(latent, cut)
        return index.masked_fill(~self.scales.valid(tokens), NO_TOKEN)[..., None]

    @torch.no_grad()
    def decode(self, tokens: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Features (B, T, D) of tokens (B, N, 1) in their own units; zero beyond a clip's end.

        Args:
            tokens: as from `encode`.
            lengths: (B,) in tokens of the full scale; T follows from the longest. None = the longest possible.
        """
        if lengths is None:
            lengths = torch.full((len(tokens),), self.scales.longest, device=tokens.device)
        longest = int(lengths.max())
        size = self.scales.longest if self.scales.layout == "padded" else longest
        latent = self.quantizer.vectors(tokens[..., 0], lengths, size)
        frames = longest * self.frames_per_token
        features = self.restore(self.reconstruct(latent, lengths)[:, :frames].float())
        return features * frame_mask(lengths * self.frames_per_token, frames)[..., None]


def build_tokenizer(parameters: Mapping[str, Any]) -> Tokenizer:
    """Build an untrained tokenizer from the configuration of a bundle or run.

    Raises:
        InvalidInput: the configuration of another model.
    """
    return Tokenizer(MoMaskPPConfig.from_dict(parameters))


def _mask(lengths: Tensor, x: Tensor, *, leaky: bool) -> Tensor | None:
    return None if leaky else frame_mask(lengths, x.shape[2])[:, None].to(x.dtype)
