"""Transformer whose blocks also read a text: self-attention, cross-attention, feed-forward (Sec. 4.2.2)."""

from __future__ import annotations

import torch
from torch import Tensor, nn

from marey.models.momaskpp.config import TransformerConfig
from marey.nn.batch_threads import CALLING_THREAD, BatchThreads
from marey.nn.packed import can_pack, pack_linears, packed_gelu
from marey.nn.ragged import key_bias
from marey.nn.transformer import Attention, attend, dropout


class CrossAttention(nn.Module):
    """Multi-head attention from tokens to words."""

    def __init__(self, width: int, heads: int, rate: float) -> None:
        super().__init__()
        self.heads = heads
        self.dropout = rate
        self.query = nn.Linear(width, width)
        self.memory = nn.Linear(width, 2 * width)  # keys, then values
        self.out = nn.Linear(width, width)

    def forward(self, x: Tensor, words: Tensor, present: Tensor) -> Tensor:
        """(B, S, w) reads words (B, L, w), those `present` (B, L) bool: (B, S, w)."""
        key, value = self.memory(words).chunk(2, -1)
        bias = key_bias(present, x.dtype)[:, None, None].expand(-1, self.heads, -1, -1).flatten(0, 1)
        rate = self.dropout if self.training else 0.0
        mixed = attend(self._heads(self.query(x)), self._heads(key), self._heads(value), bias, rate)
        return self.out(mixed.unflatten(0, (len(x), self.heads)).transpose(1, 2).flatten(2))

    def _heads(self, x: Tensor) -> Tensor:
        """(B, S, w) -> (B · H, S, w / H)."""
        return x.unflatten(-1, (self.heads, -1)).transpose(1, 2).flatten(0, 1)


class CrossBlock(nn.Module):
    """Self-attention, cross-attention and feed-forward (GELU), each with residual, dropout and norm."""

    def __init__(self, config: TransformerConfig) -> None:
        super().__init__()
        c = config
        self.norm_first = c.norm_first
        self.dropout = c.dropout
        self.attention = Attention(c.width, c.heads, c.attention_dropout)
        self.cross = CrossAttention(c.width, c.heads, c.attention_dropout)
        self.wide: nn.Module = nn.Linear(c.width, c.feedforward)
        self.gelu: nn.Module = nn.GELU()
        self.narrow = nn.Linear(c.feedforward, c.width)
        self.norm1 = nn.LayerNorm(c.width)
        self.norm2 = nn.LayerNorm(c.width)
        self.norm3 = nn.LayerNorm(c.width)

    def forward(self, x: Tensor, valid: Tensor, words: Tensor, present: Tensor) -> Tensor:
        """(B, S, w) -> (B, S, w)."""
        mask = valid[:, None, None]
        if self.norm_first:
            x = x + self._drop(self.attention(self.norm1(x), mask))
            x = x + self._drop(self.cross(self.norm2(x), words, present))
            return x + self._feedforward(self.norm3(x))
        x = self.norm1(x + self._drop(self.attention(x, mask)))
        x = self.norm2(x + self._drop(self.cross(x, words, present)))
        return self.norm3(x + self._feedforward(x))

    def pack(self) -> None:
        """Pack the matrices for inference on a CPU, GELU into the first of the feed-forward."""
        self.wide, self.gelu = packed_gelu(self.wide, self.gelu, torch.float32)
        pack_linears(self)

    def _feedforward(self, x: Tensor) -> Tensor:
        return self._drop(self.narrow(self._drop(self.gelu(self.wide(x)))))

    def _drop(self, x: Tensor) -> Tensor:
        return dropout(x, self.dropout, training=self.training)


class CrossTransformer(nn.Module):
    """A stack of such blocks; with `norm_first` a last norm follows."""

    def __init__(self, config: TransformerConfig) -> None:
        super().__init__()
        self.blocks = nn.ModuleList(CrossBlock(config) for _ in range(config.layers))
        self.norm = nn.LayerNorm(config.width) if config.norm_first else nn.Identity()
        self.dropout = config.dropout
        self.batch_threads = CALLING_THREAD

    def prepare_inference(self, batch_threads: BatchThreads) -> None:
        """Pack the matrices where possible; sequences are divided among `batch_threads`."""
        self.batch_threads = batch_threads
        if can_pack(self):
            for block in self.blocks:
                if isinstance(block, CrossBlock):
                    block.pack()

    def forward(self, x: Tensor, valid: Tensor, words: Tensor, present: Tensor) -> Tensor:
        """(B, S, w) -> (B, S, w) float32.

        Args:
            x: tokens with their positions.
            valid: (B, S) bool, tokens that may be read; one at least in each row.
            words: (B, L, w) with their positions.
            present: (B, L) bool; one at least in each row.
        """
        x, words = (dropout(part, self.dropout, training=self.training) for part in (x, words))
        if torch.is_grad_enabled():
            return self._blocks(x, valid, words, present)
        parts = self.batch_threads.parts(len(x))
        made = self.batch_threads.map(lambda p: self._blocks(x[p], valid[p], words[p], present[p]), parts)
        return torch.cat(made)

    def _blocks(self, x: Tensor, valid: Tensor, words: Tensor, present: Tensor) -> Tensor:
        for block in self.blocks:
            x = block(x, valid, words, present)
        return self.norm(x).float()
