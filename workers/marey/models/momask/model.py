"""MoMask: the networks beside the tokenizer, read top to bottom.

    base tokens + sentence  ── MaskedTransformer (Sec. 3.2)    ── logits
    lower levels + sentence ── ResidualTransformer (Sec. 3.3)  ── logits of the next level
    sentence                ── LengthEstimator                 ── logits of the number of tokens

Guo et al., "MoMask: Generative Masked Modeling of 3D Human Motions", CVPR 2024, as its public checkpoints compute
(EricGuo5513/momask-codes, MIT). They are imported, not trained here: there is no dropout.

Shapes: B batch, n tokens (padded to the bucket), V levels, K codes, d width of a code, W text width, w transformer
width, S condition tokens.
"""

from __future__ import annotations

import itertools

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.models.momask.config import MoMaskConfig, TransformerConfig
from marey.nn.batch_threads import CALLING_THREAD, BatchThreads
from marey.nn.packed import can_pack, pack_linears, packed_gelu
from marey.nn.sampling import guide
from marey.nn.transformer import Transformer, initialize, sinusoidal_positions


class TokenSequence(nn.Module):
    """Transformer over [condition tokens | motion tokens]; positions count the motion tokens alone."""

    positions: Tensor  # (n_max, w)

    def __init__(self, config: TransformerConfig, max_tokens: int) -> None:
        super().__init__()
        c = config
        self.transformer = Transformer(c.layers, c.width, c.heads, c.feedforward, 0.0)
        table = sinusoidal_positions(max_tokens + 8, c.width)  # a bucket is a multiple of 8 tokens
        self.register_buffer("positions", table, persistent=False)

    def forward(self, condition: Tensor, tokens: Tensor, valid: Tensor) -> Tensor:
        """Condition (B, S, w) and embedded tokens (B, n, w), of which `valid` (B, n) bool exist, to (B, n, w).

        The condition has no positions and may always be read.
        """
        x = torch.cat([condition, tokens + self.positions[: tokens.shape[1]]], 1)  # (B, S + n, w)
        readable = torch.cat([valid.new_ones(condition.shape[:2]), valid], 1)
        return self.transformer(x, readable)[:, condition.shape[1] :]


class SentenceProjection(nn.Module):
    """Projection of sentence features to condition tokens."""

    nothing: Tensor  # (1, W)

    def __init__(self, text_width: int, width: int) -> None:
        super().__init__()
        self.project = nn.Linear(text_width, width)
        self.register_buffer("nothing", torch.zeros(1, text_width), persistent=False)

    def forward(self, features: Tensor) -> Tensor:
        """(B, W) -> (B, w)."""
        return self.project(features)

    def null(self) -> Tensor:
        """Return the token (1, w) of no condition: a zero vector of text, so the bias stays."""
        return self.project(self.nothing)


class Head(nn.Module):
    """Dense, GELU, norm, and a linear layer."""

    def __init__(self, width: int, outputs: int) -> None:
        super().__init__()
        self.dense: nn.Module = nn.Linear(width, width)
        self.gelu: nn.Module = nn.GELU()
        self.norm = nn.LayerNorm(width, eps=1e-12)
        self.final = nn.Linear(width, outputs)

    def prepare_inference(self, dtype: torch.dtype) -> None:
        """Pack the first matrix with its GELU for inference on a CPU."""
        self.dense, self.gelu = packed_gelu(self.dense, self.gelu, dtype)

    def forward(self, x: Tensor, guidance: float | None) -> Tensor:
        """(B, n, w) -> (B, n, outputs); with `guidance` (B / 2, n, outputs).

        With guidance the first half of the rows has the condition and the second has none. All that follows the norm is
        linear, so guidance acts before it: the same logits for half of the work.
        """
        hidden = self.norm(self.gelu(self.dense(x)))
        if guidance is not None:
            conditional, unconditional = hidden.chunk(2)
            hidden = guide(conditional, unconditional, guidance)
        return self.final(hidden)


class MaskedTransformer(nn.Module):
    """Predicts masked tokens of the base level."""

    def __init__(self, config: MoMaskConfig) -> None:
        super().__init__()
        t, width = config.tokenizer, config.masked.width
        self.mask_token, self.pad_token = t.codes, t.codes + 1
        self.embedding = nn.Embedding(t.codes + 2, t.code_width)
        self.project = nn.Linear(t.code_width, width)
        self.condition = SentenceProjection(config.text_width, width)
        self.sequence = TokenSequence(config.masked, config.max_tokens)
        self.head = Head(width, t.codes)
        initialize(self)

    def prepare_inference(self, dtype: torch.dtype, batch_threads: BatchThreads = CALLING_THREAD) -> None:
        """Prepare for inference: matrices of the transformer in `dtype`, sequences shared among `batch_threads`."""
        self.sequence.transformer.prepare_inference(dtype, batch_threads)
        self.head.prepare_inference(dtype)
        pack_linears(self)

    def forward(self, tokens: Tensor, valid: Tensor, sentence: Tensor, guidance: float | None = None) -> Tensor:
        """Logits (B, n, K), of no meaning where not `valid`; with `guidance` (B / 2, n, K): see `Head`.

        Args:
            tokens: (B, n) in 0 … K - 1, or `mask_token`.
            valid: (B, n) bool.
            sentence: (B, w) from `condition`.
            guidance: None = none.
        """
        embedded = self.project(self.embedding(tokens.masked_fill(~valid, self.pad_token)))
        return self.head(self.sequence(sentence[:, None], embedded, valid), guidance).float()


class ResidualTransformer(nn.Module):
    """Predicts level q = 1 … V - 1 from the sum of the embeddings of the levels below.

    Each table of codes has K rows and one for padding, which may be drawn: such a token adds no code to the motion.
    """

    def __init__(self, config: MoMaskConfig) -> None:
        super().__init__()
        t, width = config.tokenizer, config.residual.width
        self.levels, self.shared = t.levels, config.shared
        self.pad_token = t.codes
        self.embedding = nn.Parameter(torch.empty(t.levels - 1, t.codes + 1, t.code_width))  # of levels 0 … V - 2
        own = 1 if config.shared else t.levels - 1
        self.output = nn.Parameter(torch.empty(own, t.codes + 1, t.code_width))
        self.bias = nn.Parameter(torch.zeros(t.levels - 1, t.codes + 1))  # zero where shared
        self.project = nn.Linear(t.code_width, width)
        self.condition = SentenceProjection(config.text_width, width)
        self.level = nn.Linear(t.levels, width)  # of the level as a one-hot vector
        self.sequence = TokenSequence(config.residual, config.max_tokens)
        self.head = Head(width, t.code_width)
        self.logits: nn.ModuleList | None = None
        initialize(self)
        for table in (self.embedding, self.output):
            nn.init.normal_(table, std=0.5)

    def prepare_inference(self, dtype: torch.dtype, batch_threads: BatchThreads = CALLING_THREAD) -> None:
        """Prepare for inference: matrices of the transformer in `dtype`, sequences shared among `batch_threads`."""
        self.sequence.transformer.prepare_inference(dtype, batch_threads)
        if can_pack(self):
            self.logits = nn.ModuleList(self._as_linear(level) for level in range(1, self.levels))
        self.head.prepare_inference(dtype)
        pack_linears(self)

    def embed(self, tokens: Tensor, level: int) -> Tensor:
        """Return the input (B, n, d) that tokens (B, n) of `level`, in 0 … K, add for the levels above."""
        return F.embedding(tokens, self.embedding[level])

    def table(self, level: int) -> Tensor:
        """Return the table (K + 1, d) that predicts `level`: where shared, the one that embeds it, but for the last."""
        if not self.shared:
            return self.output[level - 1]
        return self.output[0] if level == self.levels - 1 else self.embedding[level]

    def forward(
        self, total: Tensor, valid: Tensor, level: int, sentence: Tensor, guidance: float | None = None
    ) -> Tensor:
        """Logits (B, n, K + 1) of `level`, of no meaning where not `valid`; with `guidance` (B / 2, n, K + 1).

        Args:
            total: (B, n, d), the sum of `embed` over the levels below.
            valid: (B, n) bool.
            level: 1 … V - 1.
            sentence: (B, w) from `condition`.
            guidance: None = none; see `Head`.
        """
        number = torch.tensor([level], device=total.device)
        token = self.level(F.one_hot(number, self.levels).to(total.dtype))  # (1, w)
        condition = torch.stack([sentence, token.expand_as(sentence)], 1)  # (B, 2, w)
        hidden = self.head(self.sequence(condition, self.project(total), valid), guidance).float()
        if self.logits is not None:
            return self.logits[level - 1](hidden)
        return F.linear(hidden, self.table(level), self.bias[level - 1])

    def _as_linear(self, level: int) -> nn.Linear:
        table = self.table(level)
        linear = nn.Linear(table.shape[1], table.shape[0])
        linear.load_state_dict({"weight": table, "bias": self.bias[level - 1]})
        return linear


class LengthEstimator(nn.Module):
    """Number of tokens from the sentence feature: class k means k tokens."""

    def __init__(self, config: MoMaskConfig) -> None:
        super().__init__()
        widths = (config.text_width, *config.length_hidden)
        layers: list[nn.Module] = []
        for before, after in itertools.pairwise(widths):
            layers += [nn.Linear(before, after), nn.LayerNorm(after), nn.LeakyReLU(0.2)]
        self.layers = nn.Sequential(*layers, nn.Linear(widths[-1], config.length_classes))

    def forward(self, sentence: Tensor) -> Tensor:
        """(B, W) -> (B, classes) logits."""
        return self.layers(sentence)
