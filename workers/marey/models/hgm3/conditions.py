"""Text graphs as conditions: fixed slots of a batch, graph attention (eq. 9-11), three levels of condition tokens.

Shapes: B batch, W text width, w transformer width, S = 1 + A + P slots: the motion node, A actions, P specifics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.core.errors import InvalidInput
from marey.models.hgm3.config import LEVELS, ConditionConfig
from marey.text.features import TextFeatures

EDGE_TYPES = 12
MOTION, ACTION, SPECIFIC = 0, 1, 2
"""Levels of condition: C^m, [C^m; C^a], [C^m; C^a; C^s]."""


@dataclass(frozen=True)
class GraphBatch:
    """Semantic graphs of a batch in fixed slots."""

    nodes: Tensor  # (B, S, W) encoder features of each node's text; zeros in absent slots
    adjacency: Tensor  # (B, S, S) int64 edge type, -1 = no edge; self-loops on real nodes
    present: Tensor  # (B, S) bool

    def select(self, rows: Tensor) -> GraphBatch:
        """Return the graphs at `rows` (indices or bool)."""
        return GraphBatch(self.nodes[rows], self.adjacency[rows], self.present[rows])


def graph_batch(texts: Sequence[TextFeatures], config: ConditionConfig, device: torch.device) -> GraphBatch:
    """Put nodes into slots: motion 0, then actions, then specifics; absent slots are zero.

    Raises:
        InvalidInput: features of another encoder's width.
    """
    size = config.slots
    nodes = np.zeros((len(texts), size, config.text_width), np.float32)
    adjacency = np.full((len(texts), size, size), -1, np.int64)
    present = np.zeros((len(texts), size), bool)
    for row, text in enumerate(texts):
        if text.nodes.shape[1] != config.text_width:
            raise InvalidInput(
                f"text features have width {text.nodes.shape[1]}; this bundle reads {config.text_width}",
                where=text.prompt[:60],
                hint="They come from another encoder. Parse the prompt again for this bundle.",
            )
        slots = np.array(text.graph.slots(config.max_actions, config.max_specifics))
        present[row] = slots >= 0
        nodes[row, present[row]] = text.nodes[slots[present[row]]]
        adjacency[row] = text.graph.adjacency(config.max_actions, config.max_specifics)
    return GraphBatch(
        torch.from_numpy(nodes).to(device), torch.from_numpy(adjacency).to(device), torch.from_numpy(present).to(device)
    )


class TextNormalizer(nn.Module):
    """Standardisation of text features by the training set's mean and std, separate for the three node levels (ours).

    Sentence encoders map "left hand" and "right hand" to nearly parallel vectors; their difference is small compared
    with the part that all motion captions share. Noise in training stands in for phrasings that the captions lack.
    """

    mean: Tensor  # (3, W)
    std: Tensor  # (3, W)

    def __init__(self, config: ConditionConfig) -> None:
        super().__init__()
        self.noise = config.noise
        self.register_buffer("mean", torch.zeros(LEVELS, config.text_width))
        self.register_buffer("std", torch.ones(LEVELS, config.text_width))
        level = [MOTION] + [ACTION] * config.max_actions + [SPECIFIC] * config.max_specifics
        self.register_buffer("slot_level", torch.tensor(level), persistent=False)

    def forward(self, nodes: Tensor, present: Tensor) -> Tensor:
        """Standardise (B, S, W); zeros in absent slots."""
        index: Tensor = self.get_buffer("slot_level")
        return self._noisy((nodes.float() - self.mean[index]) / self.std[index]) * present[..., None]

    def sentence(self, features: Tensor) -> Tensor:
        """Standardise encodings (B, W) of whole sentences."""
        return self._noisy((features.float() - self.mean[MOTION]) / self.std[MOTION])

    def _noisy(self, x: Tensor) -> Tensor:
        return x + self.noise * torch.randn_like(x) if self.training and self.noise > 0 else x


class GraphAttention(nn.Module):
    """One layer of attention over the graph, eq. 9-11; width = text width."""

    def __init__(self, width: int, dropout: float) -> None:
        super().__init__()
        self.dropout = dropout
        self.project = nn.Linear(width, width, bias=False)  # W
        # M and the E columns of M_r, cut into the half for i and the half for j: M·[h_i; h_j] = a_i + b_j
        self.source = nn.Linear(width, 1 + EDGE_TYPES, bias=False)
        self.target = nn.Linear(width, 1 + EDGE_TYPES, bias=False)

    def forward(self, nodes: Tensor, adjacency: Tensor) -> Tensor:
        """(B, S, W) nodes and (B, S, S) edge types (-1 = none) to (B, S, W); absent slots stay zero.

        The softmax runs over the NEIGHBOURS j of node i (GraphMotion's code runs it over the queries).
        """
        h = self.project(nodes)  # (B, S, W), eq. 9
        attention = self.attention(h, adjacency)
        attention = F.dropout(attention, self.dropout, self.training)
        return F.elu(attention @ h) + nodes  # eq. 11

    def attention(self, h: Tensor, adjacency: Tensor) -> Tensor:
        """ẽ_ij of eq. 10: (B, S, S), rows sum to 1 over the neighbours, zero rows for absent slots."""
        edge = adjacency >= 0
        logits = self.source(h)[:, :, None] + self.target(h)[:, None]  # (B, S, S, 1 + E)
        typed = logits[..., 1:].gather(-1, adjacency.clamp(min=0)[..., None]).squeeze(-1)
        logits = F.leaky_relu(logits[..., 0], 0.2) + F.leaky_relu(typed, 0.2)  # e_ij
        logits = logits.float().masked_fill(~edge, torch.finfo(torch.float32).min)
        return (torch.softmax(logits, -1) * edge).to(h.dtype)


class GraphEncoder(nn.Module):
    """Encoder of a graph batch as node embeddings C (B, S, W): standardise, then one layer of graph attention."""

    def __init__(self, config: ConditionConfig) -> None:
        super().__init__()
        self.normalizer = TextNormalizer(config)
        self.graph = GraphAttention(config.text_width, config.dropout)

    def forward(self, batch: GraphBatch) -> Tensor:
        """Encode a batch as (B, S, W)."""
        return self.graph(self.normalizer(batch.nodes, batch.present), batch.adjacency)


class Condition(nn.Module):
    """Projection of node embeddings to condition tokens of width w, with the null condition of guidance."""

    def __init__(self, config: ConditionConfig, width: int) -> None:
        super().__init__()
        self.config = config
        self.project = nn.Linear(config.text_width, width)
        self.null = nn.Parameter(torch.zeros(width))  # in slot 0, the rest masked; the same at all levels (ours)

    def forward(self, nodes: Tensor, dropped: Tensor | None = None) -> Tensor:
        """Project (B, S, W) to (B, S, w); samples marked in `dropped` (B,) bool carry the null token in slot 0."""
        tokens = self.project(nodes)
        if dropped is None:
            return tokens
        first = torch.where(dropped[:, None], self.null.to(tokens.dtype), tokens[:, 0])
        return torch.cat([first[:, None], tokens[:, 1:]], 1)

    def visible(self, present: Tensor, level: int | Tensor, dropped: Tensor | None = None) -> Tensor:
        """Return the slots (B, S) bool that a transformer may read at `level` (one for all, or (B,))."""
        slots = torch.arange(self.config.slots, device=present.device)
        slot_level = (slots > 0).long() + (slots > self.config.max_actions).long()  # 0, 1 … 1, 2 … 2
        level = torch.as_tensor(level, device=present.device).expand(present.shape[0])
        seen = present & (slot_level[None] <= level[:, None])
        return seen if dropped is None else seen & ~(dropped[:, None] & (slots > 0))
