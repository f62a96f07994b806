"""The network of the `light` role labeller: a small head on frozen MiniLM states (ours, after He et al. 2017).

A trunk reads the sentence once and finds predicates. For each of them a body, given its position, scores BIO
tags of every word. About one million weights.
"""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.nn.compiled import CompiledLater
from marey.text.minilm_bundle import WIDTH as STATE_WIDTH

SUFFIX_BUCKETS = 1024
SUFFIXES = 2  # of two and three letters
ENDINGS = 3  # none, comma, full stop
REACH = 16  # distances beyond it are one


@dataclass(frozen=True)
class LightConfig:
    """Sizes of the network, stored in the bundle's manifest."""

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
        self.dropout = drop
        self.states = nn.Linear(STATE_WIDTH * len(config.layers), width)
        self.suffixes = nn.Embedding(SUFFIX_BUCKETS * SUFFIXES, config.suffix_width)
        self.suffixes_out = nn.Linear(config.suffix_width * SUFFIXES, width)
        self.endings = nn.Embedding(ENDINGS, width)
        self.trunk = nn.ModuleList(EncoderBlock(width, config.heads, drop) for _ in range(config.trunk))
        self.body = nn.ModuleList(EncoderBlock(width, config.heads, drop) for _ in range(config.body))
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
        self.tables: Tensor  # the first bucket of each length of suffix
        self.register_buffer("tables", torch.arange(SUFFIXES) * SUFFIX_BUCKETS, persistent=False)
        nn.init.normal_(self.distance.weight, std=0.1)

    @torch.inference_mode()  # so that its tensors carry nothing for gradients
    def for_inference(self) -> CompiledLater[LightNetwork]:
        """A copy for labelling that takes half the time: compiled once it is used often, and its matrices stored by
        columns, which is quicker to multiply few rows with."""
        copied = deepcopy(self).eval().requires_grad_(False)
        for module in copied.modules():
            if isinstance(module, nn.Linear):
                module.weight = nn.Parameter(module.weight.t().contiguous().t(), False)
        return CompiledLater(copied)

    def read(self, states: Tensor, surface: Tensor, mask: Tensor | None = None) -> Tensor:
        """The words of sentences, (B, T, width).

        Args:
            states: (B, T, L, 384) of the configured layers.
            surface: (B, T, 3) integer: two suffix buckets, ending.
            mask: (B, T) true on words; None = everywhere.
        """
        flat = F.layer_norm(states, states.shape[-1:]).flatten(2)  # (B, T, L * 384)
        drop = self.dropout if self.training else 0.0
        suffixes = sentence_dropout(self.suffixes(surface[..., :-1] + self.tables).flatten(2), drop)
        hidden = self.states(sentence_dropout(flat, drop))
        hidden = hidden + self.suffixes_out(suffixes) + self.endings(surface[..., -1])
        distances = word_distances(hidden)
        for block in self.trunk:
            hidden = block(hidden, distances, mask)
        return hidden

    def predicate_logits(self, hidden: Tensor) -> Tensor:
        """(B, T) from `read`."""
        return self.predicate(hidden)[..., 0]

    def tag_logits(self, hidden: Tensor, predicates: Tensor, mask: Tensor | None = None) -> Tensor:
        """(B, T, K), one row a frame.

        Args:
            hidden: (B, T, width) from `read`, repeated for each predicate of a sentence.
            predicates: (B,) word index.
            mask: (B, T) true on words; None = everywhere.
        """
        at_predicate = predicates[:, None, None].expand(-1, 1, hidden.shape[2])  # for gather
        distances = word_distances(hidden)
        near = self.distance(distances.index_select(0, predicates))  # (B, T, width)
        hidden = hidden + near + self.condition(hidden.gather(1, at_predicate))
        for block in self.body:
            hidden = block(hidden, distances, mask)
        hidden = self.norm(hidden)
        predicate = hidden.gather(1, at_predicate).expand_as(hidden)
        return self.tags(torch.cat([hidden, predicate], dim=-1))

    @torch.jit.export
    def find(self, states: Tensor, surface: Tensor, threshold: float) -> tuple[Tensor, Tensor]:
        """One sentence as it is read (1, T, width), and those of its words (N,) that are predicates.

        Args:
            states: (T, L, 384) as in `read`.
            surface: (T, 3) as in `read`.
            threshold: the probability above which a word is a predicate.
        """
        hidden = self.read(states[None], surface[None], None)
        return hidden, (self.predicate_logits(hidden)[0].sigmoid() > threshold).nonzero()[:, 0]

    @torch.jit.export
    def tag_scores(self, hidden: Tensor, predicates: list[int]) -> Tensor:
        """Log-probabilities (N, T, K) in float64 of the tags of a sentence (1, T, width) for N >= 1 of its words."""
        frames = hidden.expand(len(predicates), -1, -1)
        logits = self.tag_logits(frames, torch.tensor(predicates, device=hidden.device), None)
        return logits.log_softmax(-1).double()


def word_distances(hidden: Tensor, reach: int = REACH) -> Tensor:
    """Return the distance of each word behind each other word, (T, T) for `hidden` (B, T, width).

    0 = `reach` or more before it.
    """
    words = torch.arange(hidden.shape[1], device=hidden.device)
    return (words - words[:, None]).clamp(-reach, reach) + reach


def sentence_dropout(values: Tensor, probability: float) -> Tensor:
    """Drop the same features of all words of a sentence (Gal & Ghahramani 2016); `values` (B, T, D)."""
    if probability == 0:
        return values
    keep = torch.rand([values.shape[0], 1, values.shape[2]], device=values.device) > probability
    return values * keep / (1 - probability)


class EncoderBlock(nn.Module):
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

    def forward(self, hidden: Tensor, distances: Tensor, mask: Tensor | None) -> Tensor:
        """(B, T, width) to the same; `distances` (T, T) of `word_distances`, `mask` (B, T)."""
        batch, length, width = hidden.shape
        drop = self.dropout if self.training else 0.0
        projected = self.project(self.attention_norm(hidden)).view(batch, length, 3, self.heads, -1)
        query, key, value = projected.permute(2, 0, 3, 1, 4).unbind()  # (B, H, T, width / H)
        bias = self.bias.index_select(1, distances.flatten()).view(1, self.heads, length, length)
        if mask is not None:
            bias = bias.masked_fill(~mask[:, None, None], -1e9)  # (B, H, T, T)
        mixed = F.scaled_dot_product_attention(query, key, value, attn_mask=bias)
        mixed = mixed.transpose(1, 2).reshape(batch, length, width)
        hidden = hidden + sentence_dropout(self.attended(mixed), drop)
        return hidden + sentence_dropout(self.outer(F.gelu(self.inner(self.feed_norm(hidden)))), drop)
