"""Low-rank updates of the last layers of MiniLM, as they are trained (Hu et al. 2021, arXiv 2106.09685)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.text.minilm import EPS, HEADS
from marey.text.minilm_bundle import LAYERS

RANK = 16
DROPOUT = 0.1
MATRICES = {
    "project": ("attention.self.query", "attention.self.key", "attention.self.value"),
    "attended": ("attention.output.dense",),
    "inner": ("intermediate.dense",),
    "outer": ("output.dense",),
}
"""Matrices of a layer, by those of BERT that are rows of each."""


class UpdatedMatrices(nn.Module):
    """Frozen matrices of BERT, one behind the other, each with a low-rank update."""

    def __init__(self, weights: Mapping[str, Tensor], names: Sequence[str]) -> None:
        super().__init__()
        self.weight, self.bias = (
            torch.cat([weights[f"{name}.{part}"] for name in names]) for part in ("weight", "bias")
        )
        out, width = self.weight.shape
        self.downs = nn.Parameter(torch.randn(len(names) * RANK, width) * width**-0.5)
        self.ups = nn.Parameter(torch.zeros(out, RANK))
        self._many = len(names)

    def up(self) -> Tensor:
        """Return the second factor (out, rank), in which the rows of a matrix read the columns of its own update."""
        return torch.block_diag(*self.ups.chunk(self._many))

    def forward(self, x: Tensor) -> Tensor:
        """(…, in) to (…, out)."""
        return F.linear(x, self.weight, self.bias) + F.linear(F.linear(x, self.downs), self.up())


class UpdatedLayer(nn.Module):
    """A layer of BERT with updates."""

    def __init__(self, weights: Mapping[str, Tensor], number: int) -> None:
        super().__init__()
        prefix = f"encoder.layer.{number}."
        parts = {name: UpdatedMatrices(weights, [prefix + part for part in of]) for name, of in MATRICES.items()}
        self.parts = nn.ModuleDict(parts)
        self.drop = nn.Dropout(DROPOUT)
        self._norms = [
            (weights[f"{prefix}{name}.LayerNorm.weight"], weights[f"{prefix}{name}.LayerNorm.bias"])
            for name in ("attention.output", "output")
        ]

    def forward(self, hidden: Tensor, real: Tensor) -> Tensor:
        """(B, T, W) states and (B, T) marks of tokens to (B, T, W) states."""
        many, tokens, width = hidden.shape
        projected = self.parts["project"](hidden).view(many, tokens, 3, HEADS, -1).permute(2, 0, 3, 1, 4)
        mixed = F.scaled_dot_product_attention(*projected.unbind(), attn_mask=real[:, None, None, :])
        attended = self.parts["attended"](mixed.transpose(1, 2).reshape(many, tokens, width))
        hidden = F.layer_norm(hidden + self.drop(attended), (width,), *self._norms[0], EPS)
        outer = self.parts["outer"](F.gelu(self.parts["inner"](hidden)))
        return F.layer_norm(hidden + self.drop(outer), (width,), *self._norms[1], EPS)


class UpdatedLayers(nn.Module):
    """The last layers of MiniLM with updates.

    Attributes:
        below: number of the states that they read, those of the embeddings being 0.
    """

    def __init__(self, weights: Mapping[str, Tensor], count: int) -> None:
        super().__init__()
        self.below = LAYERS - count
        self.layers = nn.ModuleList(UpdatedLayer(weights, number) for number in range(self.below, LAYERS))

    def forward(self, states: Tensor, real: Tensor) -> Tensor:
        """(B, T, W) states below, and (B, T) marks of tokens, to (B, T, W) states."""
        for layer in self.layers:
            states = layer(states, real)
        return states

    def updates(self) -> dict[str, Tensor]:
        """Return the updates by their names in a file, as `MiniLM.tuned` reads them."""
        found: dict[str, Tensor] = {}
        for number, layer in enumerate(self.layers, self.below):
            assert isinstance(layer, UpdatedLayer)
            for name, part in layer.parts.items():
                assert isinstance(part, UpdatedMatrices)
                found |= {f"{number}.{name}.down": part.downs, f"{number}.{name}.up": part.up()}
        return found
