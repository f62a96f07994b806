"""TMR's networks (Petrovich et al. 2023) as SnapMoGen's appendix B.2 sizes them, read top to bottom.

    motion ── MotionEncoder   ── Gaussian over latents ──┐
    text   ── SentenceEncoder ── Gaussian over latents ──┴── MotionDecoder ── the motion, from either (training alone)

Both encoders are ACTOR's (Petrovich et al. 2021): a transformer over two learned tokens and the sequence, whose first
two outputs are mean and log-variance. The appendix appends the two tokens, TMR prepends them; attention does not depend
on the order. Mean vectors are the embeddings. Weights are initialised as torch's layers, as in TMR: with the
generators' 0.02 the learned tokens attend so little to the sequence that all embeddings start nearly equal.

Shapes: B batch, T frames, n motion tokens, S text tokens, D features, I read features, W text width, E latent width.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from marey.evaluator.config import EvaluatorConfig, NetworkConfig
from marey.nn.convolution import frame_mask
from marey.nn.packed import pack_linears
from marey.nn.transformer import Transformer, sinusoidal_positions

DISTRIBUTION = 2
"""Learned tokens before a sequence: mean and log-variance."""
MAX_TEXT_TOKENS = 512
"""T5's limit, the longest of the text encoders'."""


@dataclass(frozen=True)
class Gaussian:
    """Diagonal Gaussians over latents; both (B, E)."""

    mean: Tensor
    log_variance: Tensor

    def sample(self) -> Tensor:
        """Draw one latent (B, E) each, differentiable."""
        return self.mean + torch.randn_like(self.mean) * (0.5 * self.log_variance).exp()


class DistributionEncoder(nn.Module):
    """Encoder of a sequence of vectors as one Gaussian."""

    positions: Tensor

    def __init__(self, inputs: int, longest: int, config: NetworkConfig) -> None:
        super().__init__()
        self.project = nn.Linear(inputs, config.width)
        self.distribution = nn.Parameter(torch.randn(DISTRIBUTION, config.width))
        self.transformer = Transformer(config.layers, config.width, config.heads, config.feedforward, config.dropout)
        positions = sinusoidal_positions(DISTRIBUTION + longest, config.width)
        self.register_buffer("positions", positions, persistent=False)

    def forward(self, x: Tensor, valid: Tensor) -> Gaussian:
        """Encode (B, S, inputs), with a mask (B, S) bool of at least one leading True, as Gaussians."""
        mean, log_variance = self._outputs(x, valid, DISTRIBUTION).unbind(1)
        return Gaussian(mean, log_variance)

    def mean(self, x: Tensor, valid: Tensor) -> Tensor:
        """Return the means (B, E) alone."""
        return self._outputs(x, valid, 1)[:, 0]

    def pack(self) -> None:
        """Pack the matrices for inference on a CPU: the bits of a row then do not depend on the other rows."""
        self.transformer.prepare_inference(torch.float32)
        pack_linears(self)

    def _outputs(self, x: Tensor, valid: Tensor, rows: int) -> Tensor:
        tokens = self.distribution.expand(len(x), -1, -1)
        sequence = torch.cat([tokens, self.project(x).to(tokens.dtype)], 1)  # (B, 2 + S, E)
        valid = torch.cat([valid.new_ones(len(x), DISTRIBUTION), valid], 1)
        return self.transformer(sequence + self.positions[: sequence.shape[1]], valid, rows)


class MotionEncoder(nn.Module):
    """Encoder of raw features as a Gaussian; it holds the statistics that normalise them."""

    mean: Tensor  # (D,) of the evaluator's own training data, never a generator's
    std: Tensor  # (D,)

    def __init__(self, config: EvaluatorConfig) -> None:
        super().__init__()
        self.inputs, self.frames = config.inputs, config.frames_per_token
        self.width = config.width
        self.register_buffer("mean", torch.zeros(config.features))
        self.register_buffer("std", torch.ones(config.features))
        longest = -(-config.max_frames // self.frames)
        self.encoder = DistributionEncoder(self.inputs * self.frames, longest, config.network)

    def forward(self, features: Tensor, lengths: Tensor, /) -> Gaussian:
        """Encode raw features (B, T, D or at least I) with frames (B,); frames beyond a motion's end are not read."""
        return self.encoder(*self._tokens(features, lengths))

    def embed(self, features: Tensor, lengths: Tensor, /) -> Tensor:
        """Return mean vectors (B, E) of `forward`'s input."""
        return self.encoder.mean(*self._tokens(features, lengths))

    def normalize(self, features: Tensor) -> Tensor:
        """Normalise raw features (…, D or at least I) to (…, I): zero mean, unit deviation of each group."""
        kept = slice(self.inputs)
        return (features[..., kept] - self.mean[kept]) / self.std[kept]

    def _tokens(self, features: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """Return (B, n, frames · I) and (B, n) bool; in a motion's last token, missing frames are the mean pose."""
        batch, size = features.shape[:2]
        tokens = -(-size // self.frames)
        x = features.new_zeros(batch, tokens * self.frames, self.inputs)
        x[:, :size] = self.normalize(features).masked_fill(~frame_mask(lengths, size)[..., None], 0.0)
        return x.view(batch, tokens, -1), frame_mask(-(-lengths // self.frames), tokens)


class SentenceEncoder(nn.Module):
    """Encoder of a text encoder's token states as a Gaussian."""

    text_mean: Tensor  # (W,) of the training captions; standardising them is ours, as in the generators
    text_std: Tensor  # (W,)

    def __init__(self, config: EvaluatorConfig) -> None:
        super().__init__()
        self.register_buffer("text_mean", torch.zeros(config.text_width))
        self.register_buffer("text_std", torch.ones(config.text_width))
        self.encoder = DistributionEncoder(config.text_width, MAX_TEXT_TOKENS, config.network)

    def forward(self, states: Tensor, lengths: Tensor, /) -> Gaussian:
        """Encode token states (B, S, W) of which (B,) exist."""
        return self.encoder(*self._tokens(states, lengths))

    def embed(self, states: Tensor, lengths: Tensor, /) -> Tensor:
        """Return mean vectors (B, E) of `forward`'s input."""
        return self.encoder.mean(*self._tokens(states, lengths))

    @property
    def unchanged(self) -> dict[str, Tensor]:
        """Statistics of token states that change nothing, by the names of the buffers."""
        return {"text_mean": torch.zeros_like(self.text_mean), "text_std": torch.ones_like(self.text_std)}

    def _tokens(self, states: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        valid = frame_mask(lengths, states.shape[1])
        x = (states - self.text_mean) / self.text_std
        return x.masked_fill(~valid[..., None], 0.0), valid


class MotionDecoder(nn.Module):
    """Decoder from a latent to its motion, all frames at once (ACTOR, TMR).

    TMR's decoder attends from positions to the latent. Attention to a single vector is the same linear map of it at
    every position, so that is added once, and self-attention follows (ours).
    """

    positions: Tensor

    def __init__(self, config: EvaluatorConfig) -> None:
        super().__init__()
        network = config.network
        self.inputs, self.frames = config.inputs, config.frames_per_token
        self.spread = nn.Linear(network.width, network.width)
        self.transformer = Transformer(
            network.layers, network.width, network.heads, network.feedforward, network.dropout
        )
        self.out = nn.Linear(network.width, self.inputs * self.frames)
        longest = -(-config.max_frames // self.frames)
        self.register_buffer("positions", sinusoidal_positions(longest, network.width), persistent=False)

    def forward(self, latents: Tensor, lengths: Tensor) -> Tensor:
        """Decode (B, E) with frames (B,) to normalised features (B, n · frames, I); undefined beyond a motion's own
        frames."""
        tokens = -(-lengths // self.frames)
        size = int(tokens.max())
        x = self.spread(latents)[:, None] + self.positions[:size]
        x = self.transformer(x, frame_mask(tokens, size))
        return self.out(x).unflatten(-1, (self.frames, self.inputs)).flatten(1, 2)


class TMR(nn.Module):
    """All trained networks; a bundle holds the two encoders."""

    def __init__(self, config: EvaluatorConfig) -> None:
        super().__init__()
        self.motion = MotionEncoder(config)
        self.text = SentenceEncoder(config)
        self.decoder = MotionDecoder(config)
