"""The network of the `light` role labeller: a small head on frozen MiniLM states (ours, after He et al. 2017).

A trunk reads the sentence once and finds predicates. For each of them a body, told where the predicate is, scores BIO
tags of every word. About one million weights.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import nn

from shared.text.minilm import WIDTH as STATE_WIDTH

SUFFIX_BUCKETS = 1024
SUFFIXES = 2  # of two and three letters
ENDINGS = 3  # none, comma, full stop
REACH = 16  # distances beyond it are one


@dataclass(frozen=True)
class LightConfig:
    """Sizes of the network; stands whole in the bundle's manifest."""

    tags: tuple[str, ...]
    layers: tuple[int, ...] = (1, 2, 3, 4, 5, 6)
    """Hidden states of MiniLM it reads (0 = embeddings)."""
    width: int = 144
    heads: int = 6
    trunk: int = 1
    body: int = 2
    suffix_width: int = 48
    dropout: float = 0.3


class LightNetwork(nn.Module):
    """Predicate and tag scores of words. `B` sentences (or frames), `T` words, `K` tags."""

    def __init__(self, config: LightConfig) -> None:
        super().__init__()
        width, drop = config.width, config.dropout
        self.config = config
        self.states = nn.Linear(STATE_WIDTH * len(config.layers), width)
        self.suffixes = nn.Embedding(SUFFIX_BUCKETS * SUFFIXES, config.suffix_width)
        self.suffixes_out = nn.Linear(config.suffix_width * SUFFIXES, width)
        self.endings = nn.Embedding(ENDINGS, width)
        self.trunk = nn.ModuleList(Block(width, config.heads, drop) for _ in range(config.trunk))
        self.body = nn.ModuleList(Block(width, config.heads, drop) for _ in range(config.body))
        self.predicate = nn.Sequential(
            nn.LayerNorm(width), nn.Linear(width, width), nn.GELU(), nn.Dropout(drop), nn.Linear(width, 1)
        )
        self.distance = nn.Embedding(2 * REACH + 1, width)
        self.condition = nn.Linear(width, width)
        self.norm = nn.LayerNorm(width)
        self.tags = nn.Sequential(
            nn.Linear(2 * width, width), nn.GELU(), nn.Dropout(drop), nn.Linear(width, len(config.tags))
        )
        self.transitions = nn.Parameter(torch.zeros(len(config.tags), len(config.tags)))
        nn.init.normal_(self.distance.weight, std=0.1)

    def read(self, states: torch.Tensor, surface: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
        """The words of sentences, (B, T, width).

        Args:
            states: (B, T, L, 384) of the configured layers.
            surface: (B, T, 3) integer: two suffix buckets, ending.
            mask: (B, T) true on words.
        """
        flat = F.layer_norm(states, (STATE_WIDTH,)).flatten(2)  # (B, T, L * 384)
        buckets = surface[..., :SUFFIXES] + SUFFIX_BUCKETS * torch.arange(SUFFIXES, device=surface.device)
        drop = self.config.dropout if self.training else 0.0
        suffixes = sentence_dropout(self.suffixes(buckets).flatten(2), drop)
        hidden = self.states(sentence_dropout(flat, drop))
        hidden = hidden + self.suffixes_out(suffixes) + self.endings(surface[..., SUFFIXES])
        for block in self.trunk:
            hidden = block(hidden, mask)
        return hidden

    def predicate_logits(self, hidden: torch.Tensor) -> torch.Tensor:
        """(B, T) from `read`."""
        return self.predicate(hidden)[..., 0]

    def tag_logits(self, hidden: torch.Tensor, predicates: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
        """(B, T, K), one row a frame.

        Args:
            hidden: (B, T, width) from `read`, repeated for each predicate of a sentence.
            predicates: (B,) word index.
            mask: (B, T).
        """
        rows = torch.arange(len(hidden), device=hidden.device)
        words = torch.arange(hidden.shape[1], device=hidden.device)
        distance = (words[None] - predicates[:, None]).clamp(-REACH, REACH) + REACH
        hidden = hidden + self.distance(distance) + self.condition(hidden[rows, predicates])[:, None]
        for block in self.body:
            hidden = block(hidden, mask)
        hidden = self.norm(hidden)
        at_predicate = hidden[rows, predicates][:, None].expand_as(hidden)
        return self.tags(torch.cat([hidden, at_predicate], dim=-1))


def sentence_dropout(values: torch.Tensor, probability: float) -> torch.Tensor:
    """Drop the same features of all words of a sentence (Gal & Ghahramani 2016); `values` (B, T, D)."""
    if probability == 0:
        return values
    keep = torch.rand(values.shape[0], 1, values.shape[2], device=values.device) > probability
    return values * keep / (1 - probability)


class Block(nn.Module):
    """Pre-norm self-attention with a learned bias for each distance, and a feed-forward of twice the width."""

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads, self.dropout = heads, dropout
        self.attention_norm = nn.LayerNorm(width)
        self.project = nn.Linear(width, 3 * width)
        self.attended = nn.Linear(width, width)
        self.bias = nn.Parameter(torch.zeros(heads, 2 * REACH + 1))
        self.feed_norm = nn.LayerNorm(width)
        self.inner = nn.Linear(width, 2 * width)
        self.outer = nn.Linear(2 * width, width)

    def forward(self, hidden: torch.Tensor, mask: torch.Tensor) -> torch.Tensor:
        """(B, T, width) to the same; `mask` (B, T)."""
        batch, length, width = hidden.shape
        drop = self.dropout if self.training else 0.0
        projected = self.project(self.attention_norm(hidden)).view(batch, length, 3, self.heads, -1)
        query, key, value = projected.permute(2, 0, 3, 1, 4)  # (B, H, T, width / H)
        words = torch.arange(length, device=hidden.device)
        distance = (words[None] - words[:, None]).clamp(-REACH, REACH) + REACH
        bias = self.bias[:, distance][None].masked_fill(~mask[:, None, None], -1e9)  # (B, H, T, T)
        mixed = F.scaled_dot_product_attention(query, key, value, attn_mask=bias)
        mixed = mixed.transpose(1, 2).reshape(batch, length, width)
        hidden = hidden + sentence_dropout(self.attended(mixed), drop)
        return hidden + sentence_dropout(self.outer(F.gelu(self.inner(self.feed_norm(hidden)))), drop)
