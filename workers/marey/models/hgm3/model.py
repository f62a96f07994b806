"""HGM³: the networks, read top to bottom.

    semantic graph ── GraphAttention (eq. 9-11) ── Condition (three levels, fixed slots): conditions.py
    base tokens + condition ── MaskedTransformer F_θ (eq. 3-4)      ── logits
    base tokens + condition ── LossPredictor G_φ (eq. 5)            ── difficulty of each token
    lower levels + sentence ── ResidualTransformer (App. A.2)       ── logits of the next level
    sentence                ── LengthEstimator                      ── logits of the number of tokens

Jeong et al., "HGM³: Hierarchical Generative Masked Motion Modeling with Hard Token Mining", ICLR 2025. Where it is
silent: masked and residual transformer after MoMask (Guo et al. 2024), graph after GraphMotion (Jin et al. 2024).

Shapes: B batch, n tokens (padded to the bucket), V levels, K codes, W text width, w transformer width,
S = 1 + A + P condition slots: the motion node, A actions, P specifics; absent slots are masked.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.models.hgm3.conditions import Condition, GraphBatch, GraphEncoder, TextNormalizer
from marey.models.hgm3.config import HGM3Config, TransformerConfig
from marey.nn.batch_threads import CALLING_THREAD, BatchThreads
from marey.nn.packed import packed_gelu
from marey.nn.ragged import pad_length
from marey.nn.sampling import guide
from marey.nn.stored_names import keep_stored_names
from marey.nn.transformer import Transformer, initialize, sinusoidal_positions


class SequenceModel(nn.Module):
    """Transformer over [tokens | slots]; positions count the slots first: motion 0, actions, specifics, tokens."""

    positions: Tensor  # (S + n_max, w)

    def __init__(self, config: TransformerConfig, slots: int, max_tokens: int) -> None:
        super().__init__()
        self.slots = slots
        c = config
        self.transformer = Transformer(
            c.layers, c.width, c.heads, c.feedforward, c.dropout, c.attention_dropout, norm_first=c.norm_first
        )
        # a bucket is a multiple of 8 tokens
        table = sinusoidal_positions(slots + max_tokens + 8, c.width)
        self.register_buffer("positions", table, persistent=False)

    def forward(
        self,
        tokens: Tensor,
        valid: Tensor,
        condition: Tensor,
        visible: Tensor,
        *,
        wanted: Tensor | None = None,
        trim: bool = True,
    ) -> tuple[Tensor, Tensor]:
        """Embedded tokens (B, n, w) and condition (B, S, w) to outputs at the wanted tokens.

        Wanted tokens come first in memory, then other readable positions, then padding: dropping padding (`trim`)
        changes no bit (`pad_length`), and the last block computes the wanted rows alone.

        Args:
            tokens: (B, n, w).
            valid: (B, n) bool, tokens that exist.
            condition: (B, S, w).
            visible: (B, S) bool, slots that may be read.
            wanted: (B, n) bool, None = all valid ones.
            trim: cut padding that the whole batch has.

        Returns:
            outputs (B, m, w) and the tokens (B, m) they belong to; rows beyond a sample's own wanted ones belong to
            others of its tokens, or to no token (index n).
        """
        size, slots = valid.shape[1], visible.shape[1]
        wanted = valid if wanted is None else wanted
        tokens = tokens + self.positions[self.slots : self.slots + size]
        x = torch.cat([tokens, condition + self.positions[:slots]], 1)  # (B, n + S, w)
        readable = torch.cat([valid, visible], 1)  # (B, n + S)
        first = torch.cat([wanted, torch.zeros_like(visible)], 1)
        order = torch.argsort(2 - readable.long() - first.long(), dim=1, stable=True)
        longest = int(readable.sum(1).max()) if trim else size + slots
        length = pad_length(longest, self.transformer.multiple)
        rows = min(pad_length(int(wanted.sum(1).max()) if trim else size, self.transformer.multiple), length)
        place = torch.arange(length, device=order.device)
        order = order[:, place.clamp(max=size + slots - 1)]  # (B, Q)
        readable = readable.gather(1, order) & (place < size + slots)
        x = x.gather(1, order[..., None].expand(-1, -1, x.shape[-1]))
        index = torch.where(place[:rows] < size + slots, order[:, :rows], size).clamp(max=size)
        return self.transformer(x, readable, rows), index


def at_tokens(outputs: Tensor, index: Tensor, size: int) -> Tensor:
    """Outputs (B, m, …) of tokens `index` (B, m) at their places: (B, size, …), zeros where there is none."""
    placed = outputs.new_zeros((len(outputs), size + 1, *outputs.shape[2:]))
    index = index.view(*index.shape, *[1] * (outputs.dim() - 2)).expand_as(outputs)
    return placed.scatter(1, index, outputs)[:, :size]


def guided(hidden: Tensor, guidance: float | None) -> Tensor:
    """Apply classifier-free guidance before the last matrix, which is linear: the same logits for half of its work.

    (B, …), the first half with condition and the second without, to (B / 2, …); unchanged without `guidance`.
    """
    if guidance is None:
        return hidden
    with_condition, without = hidden.chunk(2)
    return guide(with_condition, without, guidance)


class TokenHead(nn.Module):
    """Dense, GELU, norm, and one logit a code (MoMask); `tied` gives the last matrix, else it is learned."""

    def __init__(self, width: int, codes: int, *, tied: bool) -> None:
        super().__init__()
        self.dense: nn.Module = nn.Linear(width, width)
        self.gelu: nn.Module = nn.GELU()
        self.norm = nn.LayerNorm(width)
        self.bias = nn.Parameter(torch.zeros(codes))
        self.codes = None if tied else nn.Linear(width, codes, bias=False)

    def prepare_inference(self, dtype: torch.dtype) -> None:
        """Pack the first matrix for inference on a CPU; logits stay float32."""
        self.dense, self.gelu = packed_gelu(self.dense, self.gelu, dtype)

    def forward(self, x: Tensor, tied: Tensor | None = None, guidance: float | None = None) -> Tensor:
        """(B, n, w) -> (B, n, K) logits, float32; with `guidance` (B / 2, n, K): see `guided`."""
        h = guided(self.norm(self.gelu(self.dense(x))), guidance)
        logits = self.codes(h) if self.codes is not None else F.linear(h * h.shape[-1] ** -0.5, _given(tied))
        return logits.float() + self.bias


class MaskedTransformer(nn.Module):
    """F_θ: reconstructs masked base tokens under a condition (eq. 3)."""

    def __init__(self, config: HGM3Config) -> None:
        super().__init__()
        codes = config.tokenizer.codes
        self.mask_token = codes
        self.compact = config.compact
        self.text = GraphEncoder(config.condition)
        self.condition = Condition(config.condition, config.masked.width)
        self.embedding = nn.Embedding(codes + 1, config.masked.width)  # the last is [MASK]
        self.sequence = SequenceModel(config.masked, config.condition.slots, config.max_tokens)
        self.head = TokenHead(config.masked.width, codes, tied=config.compact)
        initialize(self)

    def prepare_inference(self, dtype: torch.dtype, batch_threads: BatchThreads = CALLING_THREAD) -> None:
        """Prepare for inference: matrices in `dtype`, sequences shared among `batch_threads`."""
        self.sequence.transformer.prepare_inference(dtype, batch_threads)
        self.head.prepare_inference(dtype)

    def read(self, graph: GraphBatch) -> Tensor:
        """Return the condition tokens (B, S, w) of graphs, for all levels of condition."""
        return self.condition(self.text(graph))

    def at_level(self, level: int, condition: Tensor) -> tuple[MaskedTransformer, Tensor]:
        """Return the network that predicts under a level of condition, and its part of what `read` gave: one network
        for all."""
        return self, condition

    def forward(
        self,
        tokens: Tensor,
        valid: Tensor,
        condition: Tensor,
        visible: Tensor,
        wanted: Tensor,
        *,
        trim: bool = True,
        guidance: float | None = None,
    ) -> Tensor:
        """Logits (B, n, K) at the `wanted` tokens (B, n) bool, undefined elsewhere; with `guidance` (B / 2, n, K): see
        `guided`.

        `tokens` (B, n) in 0 … K, K = [MASK], any value where not `valid`; for the rest see `SequenceModel`.
        """
        embedded = self.embedding(tokens.masked_fill(~valid, self.mask_token))
        hidden, index = self.sequence(embedded, valid, condition, visible, wanted=wanted, trim=trim)
        logits = self.head(hidden, self.embedding.weight[:-1] if self.compact else None, guidance)
        return at_tokens(logits, index[: len(logits)], valid.shape[1])


class SeparateTransformers(nn.Module):
    """A transformer of its own for each level of condition, in place of one (the ablation of HGM³ Tab. 3)."""

    def __init__(self, networks: Sequence[MaskedTransformer]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)
        self.mask_token = networks[0].mask_token

    def read(self, graph: GraphBatch) -> Tensor:
        """Return the condition tokens (B, S, 3 w) of graphs: those of each network, side by side."""
        return torch.cat([self._network(level).read(graph) for level in range(len(self.networks))], -1)

    def at_level(self, level: int, condition: Tensor) -> tuple[MaskedTransformer, Tensor]:
        """Return the network of a level, and its condition tokens (B, S, w)."""
        return self._network(level), condition.chunk(len(self.networks), -1)[level]

    def _network(self, level: int) -> MaskedTransformer:
        network = self.networks[level]
        assert isinstance(network, MaskedTransformer)
        return network


class LossPredictor(nn.Module):
    """G_φ: reads the UNMASKED base tokens and the condition, predicts which tokens are hard for F_θ (eq. 5)."""

    def __init__(self, config: HGM3Config) -> None:
        super().__init__()
        self.condition = Condition(config.condition, config.predictor.width)
        self.embedding = nn.Embedding(config.tokenizer.codes, config.predictor.width)
        self.sequence = SequenceModel(config.predictor, config.condition.slots, config.max_tokens)
        self.head = nn.Linear(config.predictor.width, 1)
        initialize(self)

    def forward(self, tokens: Tensor, valid: Tensor, condition: Tensor, visible: Tensor) -> Tensor:
        """Difficulty (B, n), only its order is meaningful; zero where not `valid`."""
        embedded = self.embedding(tokens.masked_fill(~valid, 0))
        hidden, index = self.sequence(embedded, valid, condition, visible)
        with torch.autocast(hidden.device.type, enabled=False):  # ties of bfloat16 would rank tokens by their position
            difficulty = self.head(hidden.float()).squeeze(-1)
        return at_tokens(difficulty, index, valid.shape[1]) * valid


class ResidualTransformer(nn.Module):
    """Predicts level v + 1 from the levels up to v and the plain sentence feature (App. A.2)."""

    codebooks: Tensor  # (V, K, d): the tokenizer's, each level scaled to unit std; not stored twice
    code_std: Tensor  # (V,): those stds

    def __init__(self, config: HGM3Config) -> None:
        super().__init__()
        t, width = config.tokenizer, config.residual.width
        self.levels = t.levels
        self.compact = config.compact
        self.normalizer = TextNormalizer(config.condition)
        self.text = nn.Linear(config.condition.text_width, width)
        self.null = nn.Parameter(torch.zeros(width))
        self.level = nn.Embedding(t.levels - 1, width)
        self.sequence = SequenceModel(config.residual, 2, config.max_tokens)
        if config.compact:  # ours: the codes themselves, projected in and out
            self.register_buffer("codebooks", torch.zeros(t.levels, t.codes, t.code_width), persistent=False)
            self.register_buffer("code_std", torch.ones(t.levels), persistent=False)
            self.in_proj = nn.Linear(t.code_width, width)
            self.out_proj = nn.Linear(width, t.code_width)
            keep_stored_names(self)
            self.scale = nn.Parameter(torch.ones(t.levels - 1))
            self.bias = nn.Parameter(torch.zeros(t.levels - 1, t.codes))
        else:
            self.embedding = nn.Parameter(torch.randn(t.levels - 1, t.codes, width) * 0.5)
            self.dense: nn.Module = nn.Linear(width, width)
            self.gelu: nn.Module = nn.GELU()
            self.norm = nn.LayerNorm(width)
            self.output = nn.Parameter(torch.randn(t.levels - 1, t.codes, width) * 0.02)
            self.bias = nn.Parameter(torch.zeros(t.levels - 1, t.codes))
        initialize(self)
        if config.compact:  # the scale of the positions, as embeddings have
            nn.init.normal_(self.in_proj.weight, std=0.5 * t.code_width**-0.5)
            nn.init.zeros_(self.out_proj.weight)  # first prediction: how often each code occurs

    def prepare_inference(self, dtype: torch.dtype, batch_threads: BatchThreads = CALLING_THREAD) -> None:
        """Prepare for inference: matrices in `dtype`, sequences shared among `batch_threads`."""
        self.sequence.transformer.prepare_inference(dtype, batch_threads)
        if not self.compact:
            self.dense, self.gelu = packed_gelu(self.dense, self.gelu, dtype)

    def set_codebooks(self, codebooks: Tensor) -> None:
        """Set the tokenizer's codebooks (V, K, d); no effect unless compact."""
        if self.compact:
            self.code_std.copy_(codebooks.std((1, 2)).clamp(min=1e-6))
            self.codebooks.copy_(codebooks / self.code_std[:, None, None])

    def embed(self, tokens: Tensor, level: int) -> Tensor:
        """Return the input (B, n, d or w) that `level` of tokens (B, n) adds for the levels above."""
        if not self.compact:
            return F.embedding(tokens.clamp(min=0), self.embedding[level])
        # relative to the first level, so that the input has about unit scale
        return F.embedding(tokens.clamp(min=0), self.codebooks[level]) * (self.code_std[level] / self.code_std[0])

    def sentence(self, features: Tensor, dropped: Tensor | None = None) -> Tensor:
        """Text token (B, w) of sentence encodings (B, W); the null token where `dropped` (B,)."""
        token = self.text(self.normalizer.sentence(features))
        return token if dropped is None else torch.where(dropped[:, None], self.null.to(token.dtype), token)

    def forward(
        self,
        total: Tensor,
        valid: Tensor,
        level: Tensor,
        sentence: Tensor,
        *,
        trim: bool = True,
        guidance: float | None = None,
    ) -> Tensor:
        """Logits (B, n, K) of level `level` (B,) in 1 … V - 1; with `guidance` (B / 2, n, K): see `guided`.

        Args:
            total: (B, n, d or w), sum of `embed` over the levels below.
            valid: (B, n) bool.
            level: (B,), the level to predict.
            sentence: (B, w) from `sentence`.
        """
        x = self.in_proj(total) if self.compact else total
        condition = torch.stack([self.level(level - 1).to(sentence.dtype), sentence], 1)  # (B, 2, w)
        visible = torch.ones(condition.shape[:2], dtype=torch.bool, device=valid.device)
        hidden, index = self.sequence(x, valid, condition, visible, trim=trim)
        logits = self._logits(hidden, level - 1, guidance)
        return at_tokens(logits, index[: len(logits)], valid.shape[1])

    def _logits(self, hidden: Tensor, index: Tensor, guidance: float | None) -> Tensor:
        """(B, n, w) -> (B, n, K) float32, with the codes of each sample's own level (B,)."""
        index = index if guidance is None else index.chunk(2)[0]
        if not self.compact:
            hidden = guided(self.norm(self.gelu(self.dense(hidden))), guidance)
            if not self.training and bool((index == index[0]).all()):  # decoding: one level at a time
                return F.linear(hidden, self.output[index[0]]).float() + self.bias[index[0]]
            return (
                torch.bmm(hidden, self.output[index].to(hidden.dtype).transpose(1, 2)).float()
                + (self.bias[index][:, None])
            )
        leaving = guided(self.out_proj(hidden), guidance).float() * self.scale[index][:, None, None]  # (B, n, d)
        if not self.training and bool((index == index[0]).all()):
            return F.linear(leaving, self.codebooks[1 + index[0]]) + self.bias[index[0]]
        codes = self.codebooks[1:][index]  # (B, K, d)
        return torch.bmm(leaving, codes.transpose(1, 2)) + self.bias[index][:, None]


class LengthEstimator(nn.Module):
    """Number of tokens from the sentence feature (after MoMask's estimator): classes 1 … n_max."""

    def __init__(self, config: HGM3Config) -> None:
        super().__init__()
        self.normalizer = TextNormalizer(config.condition)
        widths = (config.condition.text_width, *config.length_hidden)
        layers: list[nn.Module] = []
        for before, after in itertools.pairwise(widths):
            layers += [nn.Linear(before, after), nn.LayerNorm(after), nn.LeakyReLU(0.2), nn.Dropout(0.2)]
        self.layers = nn.Sequential(*layers, nn.Linear(widths[-1], config.max_tokens))

    def forward(self, sentence: Tensor) -> Tensor:
        """(B, W) -> (B, n_max) logits; class k means k + 1 tokens."""
        return self.layers(self.normalizer.sentence(sentence))


def _given(value: Tensor | None) -> Tensor:
    if value is None:
        raise ValueError("a tied head needs the embedding matrix")
    return value
