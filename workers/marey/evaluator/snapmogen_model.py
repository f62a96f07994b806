"""The networks of SnapMoGen's published evaluator (Guo et al. 2025, App. B.2), on those of `marey.evaluator.model`.

They differ in the head: one linear map, shared, makes the mean of the first learned token's output and the log-variance
of the second's. The output of the first itself is the embedding that the paper's FID, diversity and multimodality are
computed on; retrieval compares means. Token states of the text encoder are read as they are.

Shapes: B batch, T frames, S text tokens, E latent width.
"""

from __future__ import annotations

from collections.abc import Callable

from torch import Tensor, nn

from marey.evaluator.config import EvaluatorConfig
from marey.evaluator.model import DistributionEncoder, Gaussian, MotionEncoder, SentenceEncoder

MODEL = "snapmogen"
MAX_WORDS = 120
"""Tokens of T5 that the published evaluator reads."""
PUBLIC = EvaluatorConfig(
    name="public",
    layout="snapmogen-296",
    features=296,
    fps=30.0,
    inputs=148,  # root and global rotations
    min_frames=16,
    max_frames=320,
    text_width=768,  # T5 v1.1 base
)


class _Head(nn.Module):
    """The shared map of both outputs; a mixin of the two encoders below."""

    encoder: DistributionEncoder
    _tokens: Callable[[Tensor, Tensor], tuple[Tensor, Tensor]]

    def _add_head(self, width: int) -> None:
        self.head = nn.Linear(width, width)

    def forward(self, x: Tensor, lengths: Tensor, /) -> Gaussian:
        """Encode features or token states (B, T or S, numbers) of which (B,) exist as Gaussians."""
        raw = self.encoder(*self._tokens(x, lengths))
        return Gaussian(self.head(raw.mean), self.head(raw.log_variance))

    def embed(self, x: Tensor, lengths: Tensor, /) -> Tensor:
        """Return mean vectors (B, E) of `forward`'s input, which retrieval compares."""
        return self.head(self.raw(x, lengths))

    def raw(self, x: Tensor, lengths: Tensor) -> Tensor:
        """Return the embeddings (B, E) of the paper's FID, diversity and multimodality."""
        return self.encoder.mean(*self._tokens(x, lengths))


class SnapMoGenMotionEncoder(_Head, MotionEncoder):
    """Encoder of raw features; it reads root and rotations, normalised with the statistics of the data set."""

    def __init__(self, config: EvaluatorConfig) -> None:
        MotionEncoder.__init__(self, config)
        self._add_head(config.width)


class SnapMoGenSentenceEncoder(_Head, SentenceEncoder):
    """Encoder of T5's token states; their statistics are `unchanged`."""

    def __init__(self, config: EvaluatorConfig) -> None:
        SentenceEncoder.__init__(self, config)
        self._add_head(config.width)
