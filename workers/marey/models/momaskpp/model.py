"""MoMask++: the networks beside the tokenizer, read top to bottom.

    words ── WordTokens (null condition: states times zero) ── condition tokens
    tokens of all scales + words ── ScaleTransformer (eq. 7) ── logits
    sentence                     ── LengthHead (ours)    ── logits of the number of tokens
    features without the root's velocity ── RootRefiner       ── that velocity

Shapes: B batch, N positions of all scales, S of them that a batch has, L words, K codes, W width of the text states,
w transformer width.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.models.momaskpp.attention import CrossTransformer
from marey.models.momaskpp.config import MoMaskPPConfig, TextConfig
from marey.models.momaskpp.scales import Scales
from marey.models.momaskpp.tokenizer import DilatedBlocks
from marey.nn.batch_threads import CALLING_THREAD, BatchThreads
from marey.nn.packed import pack_linears, packed_gelu
from marey.nn.sampling import guide
from marey.nn.transformer import Transformer, initialize, sinusoidal_positions


@dataclass(frozen=True)
class TextStates:
    """Word-level states of the texts of a batch."""

    states: Tensor  # (B, L, W)
    present: Tensor  # (B, L) bool

    def select(self, rows: Tensor) -> TextStates:
        """Return the texts at `rows`."""
        return TextStates(self.states[rows], self.present[rows])


class WordNormalizer(nn.Module):
    """Standardisation of text states by the training captions' mean and std (ours); identity until they are set.

    Noise in training stands in for phrasings that the captions lack.
    """

    mean: Tensor  # (W,)
    std: Tensor  # (W,)

    def __init__(self, config: TextConfig) -> None:
        super().__init__()
        self.noise = config.noise
        self.register_buffer("mean", torch.zeros(config.width))
        self.register_buffer("std", torch.ones(config.width))

    def forward(self, states: Tensor) -> Tensor:
        """(…, W) -> (…, W)."""
        x = (states.float() - self.mean) / self.std
        return x + self.noise * torch.randn_like(x) if self.training and self.noise > 0 else x


class WordTokens(nn.Module):
    """Condition tokens of a text. Without condition the states are zero; bias, positions and the mask stay."""

    positions: Tensor  # (L, w)

    def __init__(self, config: TextConfig, width: int) -> None:
        super().__init__()
        self.normalizer = WordNormalizer(config)
        self.project = nn.Linear(config.width, width)
        self.register_buffer("positions", sinusoidal_positions(config.max_words, width), persistent=False)

    def forward(self, states: Tensor, dropped: Tensor | None = None) -> Tensor:
        """(B, L, W) -> (B, L, w) with positions; rows `dropped` (B,) bool without condition."""
        x = self.normalizer(states)
        x = x if dropped is None else x * ~dropped[:, None, None]
        return self.project(x) + self.positions[: x.shape[1]]


class ScaleTransformer(nn.Module):
    """Predicts masked tokens of all scales from the others and a text (eq. 7)."""

    positions: Tensor  # (N, w)

    def __init__(self, config: MoMaskPPConfig) -> None:
        super().__init__()
        c, codes = config.masked, config.tokenizer.codes
        self.mask_token, self.pad_token = codes, codes + 1
        self.words = WordTokens(config.text, c.width)
        self.embedding = nn.Embedding(codes + 2, c.embedding)
        self.project = nn.Linear(c.embedding, c.width)
        self.projected: Tensor | None = None  # (K + 2, w) for inference: each token's embedding, projected once
        self.register_buffer("positions", sinusoidal_positions(Scales.of(config).size, c.width), persistent=False)
        self.transformer: Transformer | CrossTransformer
        if c.conditioning == "cross-attention":
            self.transformer = CrossTransformer(c)
        else:
            self.transformer = Transformer(
                c.layers, c.width, c.heads, c.feedforward, c.dropout, c.attention_dropout, norm_first=c.norm_first
            )
        self.dense: nn.Module = nn.Linear(c.width, c.width)
        self.gelu: nn.Module = nn.GELU()
        self.norm = nn.LayerNorm(c.width, eps=1e-12)
        self.codes = nn.Linear(c.width, codes)
        initialize(self)

    def prepare_inference(self, dtype: torch.dtype, batch_threads: BatchThreads = CALLING_THREAD) -> None:
        """Prepare for inference: matrices of the transformer in `dtype`, sequences shared among `batch_threads`. On a
        CPU they are packed: a sequence's bits do not depend on the others of its batch."""
        self.transformer.prepare_inference(dtype, batch_threads)
        self.dense, self.gelu = packed_gelu(self.dense, self.gelu, dtype)
        self.projected = self.project(self.embedding.weight).detach()
        pack_linears(self)

    def forward(
        self,
        tokens: Tensor,
        positions: Tensor,
        valid: Tensor,
        words: Tensor,
        present: Tensor,
        guidance: float | None = None,
        wanted: Tensor | None = None,
    ) -> Tensor:
        """Logits (B, S, K), float32; with `guidance` (B / 2, S, K), the first half with condition, the second without.

        With `wanted`, only those of M tokens (M, K), one after another.

        Args:
            tokens: (B, S) codes, `mask_token`, or any value where not `valid`.
            positions: (S,) of these tokens in the row of all scales.
            valid: (B, S) bool, tokens that exist; one at least in each row.
            words: (B, L, w) from `words`.
            present: (B, L) bool, words that exist.
            guidance: scale of classifier-free guidance.
            wanted: (B, S) bool, valid tokens, the same ones in both halves.
        """
        tokens = tokens.masked_fill(~valid, self.pad_token)
        embedded = self.project(self.embedding(tokens)) if self.projected is None else self.projected[tokens]
        x = embedded + self.positions[positions]
        if isinstance(self.transformer, CrossTransformer):
            hidden = self.transformer(x, valid, words, present, wanted)
        else:
            both = torch.cat([x, words], 1)
            hidden = self.transformer(both, torch.cat([valid, present], 1), tokens.shape[1])
            hidden = hidden if wanted is None else hidden[wanted]
        hidden = self.norm(self.gelu(self.dense(hidden)))
        if guidance is not None:  # before the last matrix, which is linear: the same logits for half of its work
            with_condition, without = hidden.chunk(2)
            hidden = guide(with_condition, without, guidance)
        return self.codes(hidden).float()


class LengthHead(nn.Module):
    """Number of tokens from the encoding of the whole sentence: classes 1 … n_max (ours, after MoMask's estimator)."""

    def __init__(self, config: MoMaskPPConfig) -> None:
        super().__init__()
        self.normalizer = WordNormalizer(config.text)
        widths = (config.text.width, *config.length_hidden)
        layers: list[nn.Module] = []
        for before, after in itertools.pairwise(widths):
            layers += [nn.Linear(before, after), nn.LayerNorm(after), nn.LeakyReLU(0.2), nn.Dropout(0.2)]
        self.layers = nn.Sequential(*layers, nn.Linear(widths[-1], config.max_tokens))

    def forward(self, sentence: Tensor) -> Tensor:
        """(B, W) -> (B, n_max) logits; class k means k + 1 tokens."""
        return self.layers(self.normalizer(sentence))


class RootRefiner(nn.Module):
    """The root's velocity from all other features of a motion (published as global motion regressor)."""

    def __init__(self, config: MoMaskPPConfig) -> None:
        super().__init__()
        c = config.refiner
        self.in_proj = nn.Conv1d(len(inputs_of(config)), c.width, 3, padding=1)
        self.residuals = DilatedBlocks(c.width, c.depth, c.dropout)
        self.out_proj = nn.Conv1d(c.width, 2, 3, padding=1)

    def forward(self, features: Tensor) -> Tensor:
        """(B, T, C) normalised features of the columns `inputs_of` to (B, T, 2), normalised."""
        x = F.leaky_relu(self.in_proj(features.transpose(1, 2)), 0.2)
        return self.out_proj(self.residuals(x, None)).transpose(1, 2)


ROOT_VELOCITY = slice(1, 3)
"""Columns that the refiner predicts: the root's displacement along X and Z in the heading frame."""
CONTACTS = 4
"""Last columns, which it does not read."""


def inputs_of(config: MoMaskPPConfig) -> list[int]:
    """Return the columns that the refiner reads: the yaw rate, and from the root's height on all but the contacts."""
    return [0, *range(ROOT_VELOCITY.stop, config.features - CONTACTS)]
