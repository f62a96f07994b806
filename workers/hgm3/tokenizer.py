"""RVQ-VAE motion tokenizer (HGM³ Sec. 3.1, App. A.1; convolutions and losses after MoMask's public description).

Read top to bottom: masked convolutions, encoder, decoder, tokenizer, loss. Inside, features run as (B, C, T) and
everything beyond a clip's own length is zero after every convolution and upsampling: a bias would otherwise make the
padding non-zero, and the next convolution would leak it into the clip's end.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from shared.nn.quantizer import Quantized, ResidualQuantizer
from workers.hgm3.config import HGM3Config, TokenizerConfig
from workers.hgm3.joints import heading_joints, world_joints

ROOT = slice(0, 4)
"""Yaw rate, X and Z displacement, height: the columns every HumanML3D-like layout begins with."""
CONTACTS = slice(-4, None)


class ResidualBlock(nn.Module):
    """ReLU, dilated conv k3, ReLU, conv k1, plus the input."""

    def __init__(self, width: int, dilation: int, dropout: float) -> None:
        super().__init__()
        self.wide = nn.Conv1d(width, width, 3, padding=dilation, dilation=dilation)
        self.narrow = nn.Conv1d(width, width, 1)
        self.dropout = dropout

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """(B, C, T) -> (B, C, T)."""
        h = _masked(self.wide(F.relu(x)), mask)
        h = F.dropout(self.narrow(F.relu(h)), self.dropout, self.training)
        return _masked(x + h, mask)


class Residuals(nn.Module):
    """Residual blocks with falling dilation: 3^(depth-1), …, 3, 1."""

    def __init__(self, config: TokenizerConfig) -> None:
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

    def __init__(self, features: int, config: TokenizerConfig) -> None:
        super().__init__()
        self.enter = nn.Conv1d(features, config.width, 3, padding=1)
        self.down = nn.ModuleList(nn.Conv1d(config.width, config.width, 4, 2, 1) for _ in range(config.stages))
        self.residuals = nn.ModuleList(Residuals(config) for _ in range(config.stages))
        self.leave = nn.Conv1d(config.width, config.code_width, 3, padding=1)

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """`mask` (B, 1, T) or None for full windows."""
        x = _masked(F.relu(self.enter(x)), mask)
        for down, residuals in zip(self.down, self.residuals, strict=True):
            mask = None if mask is None else mask[..., ::2]
            x = residuals(_masked(down(x), mask), mask)  # (B, C, T / 2)
        return _masked(self.leave(x), mask)


class Decoder(nn.Module):
    """Latents (B, d, n) to features (B, D, n · 2^stages)."""

    def __init__(self, features: int, config: TokenizerConfig) -> None:
        super().__init__()
        self.enter = nn.Conv1d(config.code_width, config.width, 3, padding=1)
        self.residuals = nn.ModuleList(Residuals(config) for _ in range(config.stages))
        self.up = nn.ModuleList(nn.Conv1d(config.width, config.width, 3, padding=1) for _ in range(config.stages))
        self.smooth = nn.Conv1d(config.width, config.width, 3, padding=1)
        self.leave = nn.Conv1d(config.width, features, 3, padding=1)
        self.dtype = torch.float32

    def lower(self, dtype: torch.dtype) -> None:
        """Cast the stages to `dtype` for inference; the last two convolutions stay, so that no frame is rounded."""
        self.residuals.to(dtype)
        self.up.to(dtype)
        self.dtype = dtype

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """`mask` (B, 1, n) or None."""
        x = _masked(F.relu(self.enter(x)), mask)
        if self.dtype != torch.float32:
            x, mask = x.to(self.dtype), None if mask is None else mask.to(self.dtype)
        for residuals, up in zip(self.residuals, self.up, strict=True):
            x = residuals(x, mask).repeat_interleave(2, dim=-1)  # nearest: (B, C, 2 T)
            mask = None if mask is None else mask.repeat_interleave(2, dim=-1)
            x = _masked(up(x), mask)
        if self.dtype != torch.float32:
            x, mask = x.float(), None if mask is None else mask.float()
        x = _masked(F.relu(self.smooth(x)), mask)
        return _masked(self.leave(x), mask)


class Tokenizer(nn.Module):
    """Features in their own units to tokens and back; normalisation is inside."""

    mean: Tensor  # (D,)
    std: Tensor  # (D,), already divided by the feature bias

    def __init__(self, config: HGM3Config) -> None:
        super().__init__()
        self.config = config.tokenizer
        self.encoder = Encoder(config.features, config.tokenizer)
        self.decoder = Decoder(config.features, config.tokenizer)
        t = config.tokenizer
        self.quantizer = ResidualQuantizer(t.levels, t.codes, t.code_width, decay=t.decay, dropout=t.level_dropout)
        self.register_buffer("mean", torch.zeros(config.features))
        self.register_buffer("std", torch.ones(config.features))

    def set_statistics(self, mean: Tensor, std: Tensor) -> None:
        """Mean and std (D,) as the network uses them (`biased_std` makes the latter from the data's)."""
        self.mean.copy_(mean)
        self.std.copy_(std)

    def forward(self, features: Tensor, lengths: Tensor | None = None) -> tuple[Tensor, Quantized]:
        """Reconstruct (training): features (B, T, D) in their own units, `lengths` (B,) in frames or None = all T.

        Returns:
            reconstruction (B, T, D), normalised, and the quantizer's result. T and lengths divide by the rate N/n.
        """
        mask = None if lengths is None else frame_mask(lengths, features.shape[1])  # (B, T)
        x = ((features - self.mean) / self.std).transpose(1, 2)  # (B, D, T)
        wide = None if mask is None else mask[:, None].to(x.dtype)
        x = x if wide is None else x * wide
        latent = self.encoder(x, wide).transpose(1, 2)  # (B, n, d)
        token_mask = None if mask is None else mask[:, :: self.config.frames_per_token]
        quantized = self.quantizer(latent, token_mask)
        narrow = None if token_mask is None else token_mask[:, None].to(x.dtype)
        output = self.decoder(quantized.output.transpose(1, 2), narrow)
        return output.transpose(1, 2).float(), quantized

    @torch.no_grad()
    def encode(self, features: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Tokens (B, n, V) of features (B, T, D); positions beyond a clip's own length are -1."""
        mask = None if lengths is None else frame_mask(lengths, features.shape[1])
        x = ((features - self.mean) / self.std).transpose(1, 2)
        wide = None if mask is None else mask[:, None].to(x.dtype)
        latent = self.encoder(x if wide is None else x * wide, wide).transpose(1, 2)
        tokens = self.quantizer.encode(latent)
        if mask is None:
            return tokens
        return tokens.masked_fill(~mask[:, :: self.config.frames_per_token, None], -1)

    @torch.no_grad()
    def decode(self, tokens: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Features (B, n · N/n, D) in their own units; `lengths` (B,) in TOKENS; zero beyond them."""
        latent = self.quantizer.decode(tokens)  # (B, n, d)
        mask = None if lengths is None else frame_mask(lengths, tokens.shape[1])
        if mask is not None:
            latent = latent * mask[..., None]
        x = self.decoder(latent.transpose(1, 2), None if mask is None else mask[:, None].to(latent.dtype))
        features = x.transpose(1, 2).float() * self.std + self.mean
        if mask is None:
            return features
        return features * mask.repeat_interleave(self.config.frames_per_token, dim=1)[..., None]


@dataclass(frozen=True)
class TokenizerLoss:
    """The terms of the training objective, each already averaged over valid frames."""

    total: Tensor
    features: Tensor  # L1 of normalised features (eq. 2, first term)
    commitment: Tensor  # eq. 2, second term, without β
    position: Tensor  # metres, in the heading frame
    velocity: Tensor  # m/s, in the heading frame
    world: Tensor  # metres, in space: with the drift of the root since the window's start


def tokenizer_loss(
    model: Tokenizer, config: HGM3Config, features: Tensor, lengths: Tensor | None = None, fraction: float = 1.0
) -> tuple[TokenizerLoss, Quantized]:
    """Eq. 2 of HGM³ plus terms on the joints (ours), which are what the error is measured on.

    The term in space rises with the budget's `fraction`: drift adds up over a window, and at first its gradient drowns
    all others.

    Args:
        model: the tokenizer.
        config: weights of the terms.
        features: (B, T, D) in their own units.
        lengths: (B,) frames, or None where every window is full.
        fraction: of the budget used.
    """
    t = config.tokenizer
    output, quantized = model(features, lengths)
    target = (features - model.mean) / model.std
    valid = torch.ones_like(features[..., 0]) if lengths is None else frame_mask(lengths, features.shape[1]).float()
    weights = feature_weights(config).to(features.device)  # (D,)
    l1 = _average(((output - target).abs() * weights).sum(-1) / weights.sum(), valid)

    restored = output * model.std + model.mean
    local = heading_joints(restored, config.joints) - heading_joints(features, config.joints)  # (B, T, J, 3)
    position = _average(local.abs().sum(-1).mean(-1), valid)
    velocity = _average(local.diff(dim=1).abs().sum(-1).mean(-1) * config.fps, valid[:, 1:])
    drift = world_joints(restored, config.joints) - world_joints(features, config.joints)
    world = _average(drift.abs().sum(-1).mean(-1), valid)
    total = (
        l1
        + t.commitment * quantized.commitment
        + t.position_weight * position
        + t.velocity_weight * velocity
        + t.world_weight * min(1.0, 2 * fraction) ** 2 * world
    )
    terms = (l1, quantized.commitment, position, velocity, world)
    return TokenizerLoss(total, *(term.detach() for term in terms)), quantized


def feature_weights(config: HGM3Config) -> Tensor:
    """Weight of each feature column (D,) in the L1 term: 1, or `rotation_weight` for the 6-D rotations."""
    weights = torch.ones(config.features)
    start = 4 + 3 * (config.joints - 1)
    weights[start : start + 6 * (config.joints - 1)] = config.tokenizer.rotation_weight
    return weights


def biased_std(std: Tensor, bias: float) -> Tensor:
    """Divide the std of root and contact columns by `bias` (MoMask), so that their errors weigh more."""
    scaled = std.clone()
    scaled[ROOT] /= bias
    scaled[CONTACTS] /= bias
    return scaled


def frame_mask(lengths: Tensor, size: int) -> Tensor:
    """(B,) lengths to (B, size) bool, true within the clip."""
    return torch.arange(size, device=lengths.device)[None] < lengths[:, None]


def _masked(x: Tensor, mask: Tensor | None) -> Tensor:
    return x if mask is None else x * mask


def _average(values: Tensor, valid: Tensor) -> Tensor:
    return (values * valid).sum() / valid.sum().clamp(min=1)
