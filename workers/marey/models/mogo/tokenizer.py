"""MoSA-VQ motion tokenizer (MOGO Sec. 2.1): one token column a frame, a decoder that never looks ahead.

Read top to bottom: causal convolutions with carried state, encoder, decoder, tokenizer. Inside, features run as
(B, C, T). Everything beyond a clip's own length is zero after every convolution of the encoder, which looks both ways;
behind the causal decoder it is enough to blank what goes in and what comes out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.models.mogo.config import MOGOConfig, TokenizerConfig
from marey.nn.convolution import ResidualBlock, frame_mask, masked
from marey.nn.motion_tokenizer import MotionTokenizer
from marey.nn.quantizer import Quantized
from marey.nn.scaled_quantizer import ScaledQuantizer
from marey.nn.stored_names import keep_stored_names


@dataclass(frozen=True)
class DecoderState:
    """State of the decoder's convolutions: frames already decoded; rows are sessions."""

    pasts: tuple[Tensor, ...]  # one a convolution that reaches back: (B, C, frames it reaches back)

    def select(self, rows: Tensor) -> DecoderState:
        """Return the sessions at `rows` (indices or bool)."""
        rows = rows.to(self.pasts[0].device)
        return DecoderState(tuple(past[rows] for past in self.pasts))

    @classmethod
    def join(cls, states: Sequence[Self]) -> DecoderState:
        """Concatenate several states as one batch, in their order."""
        return DecoderState(tuple(torch.cat(pasts) for pasts in zip(*(s.pasts for s in states), strict=True)))


class CausalConv(nn.Conv1d):
    """Convolution over a frame and those before it."""

    def __init__(self, before: int, after: int, kernel: int, dilation: int = 1) -> None:
        super().__init__(before, after, kernel, dilation=dilation)
        self.reach = (kernel - 1) * dilation

    def advance(self, x: Tensor, past: Tensor) -> tuple[Tensor, Tensor]:
        """Advance by frames (B, C, T) behind `past` (B, C, reach): returns (B, C', T) and the new past."""
        one = x.shape[-1] == 1
        x = torch.cat([past, x], -1)
        return (self._last(x) if one and not self.training else self(x)), x[..., x.shape[-1] - self.reach :]

    def _last(self, x: Tensor) -> Tensor:
        """Return the one frame (B, C', 1) that (B, C, reach + 1) gives: on a CPU one vector product per session, so
        that streams do not change each other's bits, in a tenth of a convolution's time."""
        seen, weight = x[..., :: self.dilation[0]].flatten(1), self.weight.flatten(1)  # (B, C · kernel)
        if x.device.type != "cpu":
            return F.linear(seen, weight, self.bias)[..., None]
        return torch.stack([F.linear(each, weight, self.bias) for each in seen])[..., None]


class CausalBlock(nn.Module):
    """`ResidualBlock` over the past alone: ReLU, dilated conv k3, ReLU, conv k1, plus the input."""

    def __init__(self, width: int, dilation: int, dropout: float) -> None:
        super().__init__()
        self.wide = CausalConv(width, width, 3, dilation)
        self.narrow = CausalConv(width, width, 1)
        self.dropout = dropout

    def forward(self, x: Tensor, past: Tensor) -> tuple[Tensor, Tensor]:
        """(B, C, T) -> (B, C, T) and the new past."""
        h, past = self.wide.advance(F.relu(x), past)
        h, _ = self.narrow.advance(F.relu(h), h[..., :0])
        return x + F.dropout(h, self.dropout, self.training), past


class Encoder(nn.Module):
    """Features (B, D, T) to latents (B, d, T); a latent sees frames before and after its own."""

    def __init__(self, features: int, config: TokenizerConfig) -> None:
        super().__init__()
        self.in_proj = nn.Conv1d(features, config.width, 3, padding=1)
        self.stage = nn.Conv1d(config.width, config.width, 3, padding=1)
        self.blocks = nn.ModuleList(ResidualBlock(config.width, d, config.dropout) for d in _dilations(config))
        self.out_proj = nn.Conv1d(config.width, config.code_width, 3, padding=1)
        keep_stored_names(self)

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """`mask` (B, 1, T) or None for full windows."""
        x = masked(F.relu(self.in_proj(x)), mask)
        x = masked(self.stage(x), mask)
        for block in self.blocks:
            x = block(x, mask)
        return masked(self.out_proj(x), mask)


class Decoder(nn.Module):
    """Latents (B, d, T) to features (B, D, T), in chunks of any length."""

    def __init__(self, features: int, config: TokenizerConfig) -> None:
        super().__init__()
        self.in_proj = CausalConv(config.code_width, config.width, 3)
        self.blocks = nn.ModuleList(CausalBlock(config.width, d, config.dropout) for d in _dilations(config))
        self.stage = CausalConv(config.width, config.width, 3)
        self.smooth = CausalConv(config.width, config.width, 3)
        self.out_proj = CausalConv(config.width, features, 3)
        keep_stored_names(self)

    def start(self, batch: int) -> DecoderState:
        """Return the state before the first frame: zeros, as after motionless latents of zero."""
        convolutions = [part for part in self.modules() if isinstance(part, CausalConv) and part.reach]
        return DecoderState(tuple(c.weight.new_zeros(batch, c.in_channels, c.reach) for c in convolutions))

    def forward(self, x: Tensor, state: DecoderState) -> tuple[Tensor, DecoderState]:
        """The next T frames (B, D, T) of latents (B, d, T), and the state behind them."""
        pasts = list(state.pasts)  # in the order of `start`: in_proj, blocks, stage, smooth, out_proj
        x, pasts[0] = self.in_proj.advance(x, pasts[0])
        x = F.relu(x)
        for i, block in enumerate(self.blocks, 1):
            x, pasts[i] = block(x, pasts[i])
        x, pasts[-3] = self.stage.advance(x, pasts[-3])
        x, pasts[-2] = self.smooth.advance(x, pasts[-2])
        x, pasts[-1] = self.out_proj.advance(F.relu(x), pasts[-1])
        return x, DecoderState(tuple(pasts))


class Tokenizer(MotionTokenizer):
    """Tokenizer of features in their own units; normalisation is inside."""

    def __init__(self, config: MOGOConfig) -> None:
        super().__init__(config.features, frames_per_token=1)
        t = config.tokenizer
        self.config = t
        self.encoder = Encoder(config.features, t)
        self.decoder = Decoder(config.features, t)
        self.quantizer = ScaledQuantizer(
            t.levels, t.codes, t.code_width, decay=t.decay, dropout=t.level_dropout, scale=t.scale
        )

    @property
    def codebooks(self) -> Tensor:
        """(V, K, d)."""
        return self.quantizer.codebooks

    def forward(self, features: Tensor, lengths: Tensor | None = None) -> tuple[Tensor, Quantized]:
        """Reconstruct (training): features (B, T, D) in their own units, `lengths` (B,) in frames or None = all T.

        Returns:
            reconstruction (B, T, D), normalised, zero beyond a clip's length; and the quantizer's result.
        """
        latent, mask = self._latent(features, lengths)
        quantized = self.quantizer(latent, mask)
        output, _ = self.decoder(quantized.output.transpose(1, 2), self.decoder.start(len(features)))
        output = output.transpose(1, 2).float()
        return (output if mask is None else output * mask[..., None]), quantized

    @torch.no_grad()
    def encode(self, features: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Tokens (B, T, V) of features (B, T, D); -1 beyond a clip's own length."""
        latent, mask = self._latent(features, lengths)
        tokens = self.quantizer.encode(latent)
        return tokens if mask is None else tokens.masked_fill(~mask[..., None], -1)

    @torch.no_grad()
    def decode(self, tokens: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Features (B, T, D) in their own units of whole clips (B, T, V); zero beyond `lengths` (B,)."""
        features, _ = self.decode_next(tokens, self.decoder.start(len(tokens)))
        return features if lengths is None else features * frame_mask(lengths, tokens.shape[1])[..., None]

    @torch.no_grad()
    def decode_next(self, tokens: Tensor, state: DecoderState) -> tuple[Tensor, DecoderState]:
        """Return features (B, T, D) of the next T columns (B, T, V) of streams, and the state to continue from.

        The same columns in the same chunks give the same bits; other chunks agree to rounding.
        """
        latent = self.quantizer.decode(tokens)  # (B, T, d)
        x, state = self.decoder(latent.transpose(1, 2), state)
        return self.restore(x.transpose(1, 2)), state

    def _latent(self, features: Tensor, lengths: Tensor | None) -> tuple[Tensor, Tensor | None]:
        """Latents (B, T, d) and the mask (B, T) of frames that exist."""
        mask = None if lengths is None else frame_mask(lengths, features.shape[1])
        x = self.normalize(features).transpose(1, 2)  # (B, D, T)
        wide = None if mask is None else mask[:, None].to(x.dtype)
        return self.encoder(masked(x, wide), wide).transpose(1, 2), mask


def build_tokenizer(parameters: Mapping[str, Any]) -> Tokenizer:
    """Build an untrained tokenizer from the configuration of a bundle or run.

    Raises:
        InvalidInput: the configuration of another model.
    """
    return Tokenizer(MOGOConfig.from_dict(parameters))


def _dilations(config: TokenizerConfig) -> list[int]:
    return [3**i for i in reversed(range(config.depth))]
