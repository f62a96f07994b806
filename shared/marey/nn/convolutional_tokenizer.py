"""Convolutional motion tokenizer: the residual VQ-VAE of MoMask (Guo et al. 2024), after T2M-GPT (Zhang et al. 2023).

Read top to bottom: encoder, decoder, tokenizer. Inside, features run as (B, C, T), and are zero beyond a clip's own
length after every convolution and upsampling.
"""

from __future__ import annotations

from typing import Protocol

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.nn.convolution import ResidualBlock, frame_mask, masked
from marey.nn.motion_tokenizer import MotionTokenizer
from marey.nn.quantizer import Quantized, ResidualQuantizer
from marey.nn.stored_names import keep_stored_names


class TokenizerShape(Protocol):
    """Sizes of a convolutional tokenizer."""

    @property
    def width(self) -> int: ...
    @property
    def depth(self) -> int:
        """Residual blocks a stage, dilations 3^(depth-1) … 1."""
        ...

    @property
    def stages(self) -> int:
        """Number of halvings of the frame rate."""
        ...

    @property
    def code_width(self) -> int: ...
    @property
    def dropout(self) -> float: ...


class Residuals(nn.Module):
    """Residual blocks with falling dilation: 3^(depth-1), …, 3, 1."""

    def __init__(self, config: TokenizerShape) -> None:
        super().__init__()
        dilations = [3**i for i in reversed(range(config.depth))]
        self.blocks = nn.ModuleList(ResidualBlock(config.width, d, config.dropout) for d in dilations)

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """(B, C, T) -> (B, C, T)."""
        for block in self.blocks:
            x = block(x, mask)
        return x


class Encoder(nn.Module):
    """Features (B, D, T) to latents (B, d, T / 2^stages)."""

    def __init__(self, features: int, config: TokenizerShape) -> None:
        super().__init__()
        self.in_proj = nn.Conv1d(features, config.width, 3, padding=1)
        self.down = nn.ModuleList(nn.Conv1d(config.width, config.width, 4, 2, 1) for _ in range(config.stages))
        self.residuals = nn.ModuleList(Residuals(config) for _ in range(config.stages))
        self.out_proj = nn.Conv1d(config.width, config.code_width, 3, padding=1)
        keep_stored_names(self)

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """`mask` (B, 1, T) or None for full windows."""
        x = masked(F.relu(self.in_proj(x)), mask)
        for down, residuals in zip(self.down, self.residuals, strict=True):
            mask = None if mask is None else mask[..., ::2]
            x = residuals(masked(down(x), mask), mask)  # (B, C, T / 2)
        return masked(self.out_proj(x), mask)


class Decoder(nn.Module):
    """Latents (B, d, n) to features (B, D, n · 2^stages)."""

    def __init__(self, features: int, config: TokenizerShape) -> None:
        super().__init__()
        self.in_proj = nn.Conv1d(config.code_width, config.width, 3, padding=1)
        self.residuals = nn.ModuleList(Residuals(config) for _ in range(config.stages))
        self.up = nn.ModuleList(nn.Conv1d(config.width, config.width, 3, padding=1) for _ in range(config.stages))
        self.smooth = nn.Conv1d(config.width, config.width, 3, padding=1)
        self.out_proj = nn.Conv1d(config.width, features, 3, padding=1)
        keep_stored_names(self)
        self.dtype = torch.float32

    def prepare_inference(self, dtype: torch.dtype) -> None:
        """Cast the stages to `dtype` for inference; the last two convolutions stay, so that no frame is rounded."""
        self.residuals.to(dtype)
        self.up.to(dtype)
        self.dtype = dtype

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """`mask` (B, 1, n) or None."""
        x = masked(F.relu(self.in_proj(x)), mask)
        if self.dtype != torch.float32:
            x, mask = x.to(self.dtype), None if mask is None else mask.to(self.dtype)
        for residuals, up in zip(self.residuals, self.up, strict=True):
            x = residuals(x, mask).repeat_interleave(2, dim=-1)  # nearest: (B, C, 2 T)
            mask = None if mask is None else mask.repeat_interleave(2, dim=-1)
            x = masked(up(x), mask)
        if self.dtype != torch.float32:
            x, mask = x.float(), None if mask is None else mask.float()
        x = masked(F.relu(self.smooth(x)), mask)
        return masked(self.out_proj(x), mask)


class ConvolutionalTokenizer(MotionTokenizer):
    """Tokenizer of features in their own units; normalisation is inside."""

    def __init__(self, features: int, config: TokenizerShape, quantizer: ResidualQuantizer) -> None:
        """Build an untrained tokenizer of `features` numbers a frame; `quantizer` has the width of its codes."""
        super().__init__(features, 2**config.stages)
        self.encoder = Encoder(features, config)
        self.decoder = Decoder(features, config)
        self.quantizer = quantizer

    @property
    def codebooks(self) -> Tensor:
        """(V, K, d)."""
        return self.quantizer.codebooks

    def forward(self, features: Tensor, lengths: Tensor | None = None) -> tuple[Tensor, Quantized]:
        """Reconstruct (training): features (B, T, D) in their own units, `lengths` (B,) in frames or None = all T.

        Returns:
            reconstruction (B, T, D), normalised, and the quantizer's result. T and lengths divide by the rate N/n.
        """
        mask = None if lengths is None else frame_mask(lengths, features.shape[1])  # (B, T)
        x = self.normalize(features).transpose(1, 2)  # (B, D, T)
        wide = None if mask is None else mask[:, None].to(x.dtype)
        x = x if wide is None else x * wide
        latent = self.encoder(x, wide).transpose(1, 2)  # (B, n, d)
        token_mask = None if mask is None else mask[:, :: self.frames_per_token]
        quantized = self.quantizer(latent, token_mask)
        narrow = None if token_mask is None else token_mask[:, None].to(x.dtype)
        output = self.decoder(quantized.output.transpose(1, 2), narrow)
        return output.transpose(1, 2).float(), quantized

    @torch.no_grad()
    def encode(self, features: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Tokens (B, n, V) of features (B, T, D); positions beyond a clip's own length are -1."""
        mask = None if lengths is None else frame_mask(lengths, features.shape[1])
        x = self.normalize(features).transpose(1, 2)
        wide = None if mask is None else mask[:, None].to(x.dtype)
        latent = self.encoder(x if wide is None else x * wide, wide).transpose(1, 2)
        tokens = self.quantizer.encode(latent)
        if mask is None:
            return tokens
        return tokens.masked_fill(~mask[:, :: self.frames_per_token, None], -1)

    @torch.no_grad()
    def decode(self, tokens: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Features (B, n · N/n, D) in their own units; `lengths` (B,) in TOKENS; zero beyond them."""
        latent = self.quantizer.decode(tokens)  # (B, n, d)
        mask = None if lengths is None else frame_mask(lengths, tokens.shape[1])
        if mask is not None:
            latent = latent * mask[..., None]
        x = self.decoder(latent.transpose(1, 2), None if mask is None else mask[:, None].to(latent.dtype))
        features = self.restore(x.transpose(1, 2).float())
        if mask is None:
            return features
        return features * mask.repeat_interleave(self.frames_per_token, dim=1)[..., None]
