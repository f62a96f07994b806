"""MiniLM with low-rank updates of its matrices (LoRA, Hu et al. 2021, arXiv 2106.09685), for training the labeller."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.bundles import Bundle
from marey.text.minilm import EPS, HEADS
from marey.text.minilm_bundle import LAYERS, WIDTH, load_weights

PROJECTIONS = ("attention.self.query", "attention.self.key", "attention.self.value")  # of one input
MATRICES = (*PROJECTIONS, "attention.output.dense", "intermediate.dense", "output.dense")
NAMES = tuple(f"encoder.layer.{layer}.{matrix}" for layer in range(LAYERS) for matrix in MATRICES)
SCALE = 2.0  # of an update; as a learning rate for it alone
SMOOTHING = 0.75  # 0.5, which Xiao et al. take, leaves the feature of 28 among those of 2 too large for seven bits


@dataclass(frozen=True)
class TokenBatch:
    """B sentences of N tokens at most, and T words at most."""

    ids: Tensor  # (B, N)
    mask: Tensor  # (B, N) true on tokens
    pooling: Tensor  # (B, T, N): weights of the mean over a word's pieces


def token_batch(tokens: Sequence[tuple[list[int], Tensor]]) -> TokenBatch:
    """Pad sentences, each given as token ids and (T, N) weights of the means (`WordStates.tokens`)."""
    rows, length = len(tokens), max(len(ids) for ids, _ in tokens)
    ids = torch.zeros(rows, length, dtype=torch.long)
    mask = torch.zeros(rows, length, dtype=torch.bool)
    pooling = torch.zeros(rows, max(len(weights) for _, weights in tokens), length)
    for row, (sentence, weights) in enumerate(tokens):
        ids[row, : len(sentence)] = torch.tensor(sentence)
        mask[row, : len(sentence)] = True
        pooling[row, : len(weights), : len(sentence)] = weights
    return TokenBatch(ids, mask, pooling)


class AdaptedMiniLM(nn.Module):
    """Frozen MiniLM in bfloat16 with trained updates of rank `rank` in every matrix of its layers.

    Args:
        minilm: its bundle.
        rank: of the updates.
        start: initial updates, as `updates` returns them; None = zero.
    """

    def __init__(self, minilm: Bundle, rank: int, start: Mapping[str, Tensor] | None = None) -> None:
        super().__init__()
        self._weights = load_weights(minilm)
        self._half = {name: self._weights[f"{name}.weight"].bfloat16() for name in NAMES}
        self._largest: dict[str, Tensor] | None = None  # inputs of matrices by feature, while they are looked at
        self.down = nn.ParameterDict()
        self.up = nn.ParameterDict()
        for name in NAMES:
            outputs, inputs = self._half[name].shape
            down, up = torch.randn(rank, inputs) / math.sqrt(inputs), torch.zeros(outputs, rank)
            if start:
                down, up = start[f"{name}.down"].clone(), start[f"{name}.up"] / SCALE
            self.down[_key(name)], self.up[_key(name)] = nn.Parameter(down), nn.Parameter(up)

    def forward(self, batch: TokenBatch, layers: Sequence[int]) -> Tensor:
        """Return states of words, (B, T, L, 384), of the requested layers (0 = embeddings)."""
        weights = self._weights
        table = weights["embeddings.position_embeddings.weight"][: batch.ids.shape[1]]
        hidden = F.embedding(batch.ids, weights["embeddings.word_embeddings.weight"]) + table
        hidden = self._norm(hidden + weights["embeddings.token_type_embeddings.weight"][0], "embeddings")
        bias = torch.zeros(batch.mask.shape).masked_fill(~batch.mask, -1e9)[:, None, None].bfloat16()
        states = [hidden]
        for layer in range(LAYERS):
            states.append(self._layer(states[-1], f"encoder.layer.{layer}.", bias))
        chosen = torch.stack([states[layer] for layer in layers], dim=2)  # (B, N, L, 384)
        return (batch.pooling @ chosen.flatten(2)).unflatten(2, chosen.shape[2:])

    @torch.no_grad()
    def updates(self, sentences: Sequence[TokenBatch] = ()) -> dict[str, Tensor]:
        """Return the updates as stored, exact in float16: `<matrix>.up` (out, rank), `<matrix>.down` (rank, in).

        Args:
            sentences: one at a time, to find `<matrix>.smooth` (in,) for int8 with.
        """
        kept: dict[str, Tensor] = {}
        for name in NAMES:
            kept[f"{name}.up"] = self.up[_key(name)] * SCALE
            kept[f"{name}.down"] = self.down[_key(name)].clone()
        return {name: value.half().float() for name, value in (kept | self._smoothing(sentences)).items()}

    def _smoothing(self, sentences: Sequence[TokenBatch]) -> dict[str, Tensor]:
        """Return divisors of the features of a matrix's input: above 1 for large inputs with small weights."""
        self._largest = {}
        for sentence in sentences:
            self(sentence, (LAYERS,))
        largest, self._largest = self._largest, None
        smooth: dict[str, Tensor] = {}
        for name, inputs in largest.items():
            together = [name.replace("query", each) for each in ("query", "key", "value")]
            matrices = torch.cat([self._matrix(each) for each in dict.fromkeys(together)]).float()
            ratio = inputs.clamp(min=1e-3) ** SMOOTHING / matrices.abs().amax(0).clamp(min=1e-3) ** (1 - SMOOTHING)
            smooth[f"{name}.smooth"] = ratio / ratio.median()
        return smooth

    def _layer(self, hidden: Tensor, prefix: str, bias: Tensor) -> Tensor:
        x = hidden.bfloat16()
        query, key, value = (
            self._linear(x, f"{prefix}{name}").unflatten(-1, (HEADS, -1)).transpose(1, 2) for name in PROJECTIONS
        )
        mixed = F.scaled_dot_product_attention(query, key, value, attn_mask=bias).transpose(1, 2).flatten(2)
        attended = self._linear(mixed, f"{prefix}attention.output.dense")
        hidden = self._norm(hidden + attended, f"{prefix}attention.output")
        inner = F.gelu(self._linear(hidden.bfloat16(), f"{prefix}intermediate.dense"))
        return self._norm(hidden + self._linear(inner, f"{prefix}output.dense"), f"{prefix}output")

    def _linear(self, x: Tensor, name: str) -> Tensor:
        if self._largest is not None and not name.endswith((".key", ".value")):
            largest = x.abs().flatten(0, -2).amax(0).float()
            self._largest[name] = torch.maximum(self._largest.get(name, largest), largest)
        return F.linear(x, self._matrix(name), self._weights[f"{name}.bias"].bfloat16())

    def _matrix(self, name: str) -> Tensor:
        return self._half[name] + ((self.up[_key(name)] @ self.down[_key(name)]) * SCALE).bfloat16()

    def _norm(self, x: Tensor, name: str) -> Tensor:
        weight, bias = self._weights[f"{name}.LayerNorm.weight"], self._weights[f"{name}.LayerNorm.bias"]
        return F.layer_norm(x.float(), (WIDTH,), weight, bias, EPS)


def _key(name: str) -> str:
    return name.replace(".", "/")  # parameters' names have no dots
