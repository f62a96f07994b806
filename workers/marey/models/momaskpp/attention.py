"""Transformer whose blocks also read a text: self-attention, cross-attention, feed-forward (Sec. 4.2.2)."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from marey.models.momaskpp.config import TransformerConfig
from marey.nn.batch_threads import CALLING_THREAD, BatchThreads
from marey.nn.packed import can_pack, pack_linears, packed_gelu
from marey.nn.ragged import Ragged, key_bias
from marey.nn.transformer import Attention, attend, dropout


class WordMemory(NamedTuple):
    """Words as one attention reads them, for H heads."""

    keys: Tensor  # (B · H, L, D)
    values: Tensor  # (B · H, L, D)
    bias: Tensor  # (B · H, 1, L) of the scores


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
        rate = self.dropout if self.training else 0.0
        mixed = attend(self._heads(self.query(x)), *self.read(words, present), rate)
        return self.out(mixed.unflatten(0, (len(x), self.heads)).transpose(1, 2).flatten(2))

    def ragged(self, x: Tensor, where: Ragged, words: WordMemory) -> Tensor:
        """`forward` of rows without padding: (R, w) -> (R, w); no gradient."""
        return self.out(where.rows(attend(where.queries(self.query(x)), *words, 0.0)))

    def read(self, words: Tensor, present: Tensor) -> WordMemory:
        """Read words (B, L, w), those `present` (B, L) bool."""
        key, value = self.memory(words).chunk(2, -1)
        bias = key_bias(present, key.dtype)[:, None, None].expand(-1, self.heads, -1, -1).flatten(0, 1)
        return WordMemory(self._heads(key), self._heads(value), bias)

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

    def ragged(self, x: Tensor, where: Ragged, words: WordMemory, wanted: Ragged | None = None) -> Tensor:
        """`forward` of rows without padding: (R, w) -> (R, w), or the rows `wanted` of them; no gradient."""
        kept, where_kept = (None, where) if wanted is None else (wanted.among(where), wanted)
        mine = x if kept is None else x[kept]
        if self.norm_first:
            x = mine + self.attention.ragged(self.norm1(x), where, kept)
            x = x + self.cross.ragged(self.norm2(x), where_kept, words)
            return x + self._feedforward(self.norm3(x))
        x = self.norm1(mine + self.attention.ragged(x, where, kept))
        x = self.norm2(x + self.cross.ragged(x, where_kept, words))
        return self.norm3(x + self._feedforward(x))

    def pack(self, dtype: torch.dtype) -> None:
        """Pack the matrices for inference on a CPU, GELU into the first of the feed-forward."""
        self.wide, self.gelu = packed_gelu(self.wide, self.gelu, dtype)
        pack_linears(self, dtype)

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
        self.heads = config.heads
        self.dropout = config.dropout
        self.dtype = torch.float32
        self.packed = False
        self.batch_threads = CALLING_THREAD

    def prepare_inference(self, dtype: torch.dtype, batch_threads: BatchThreads) -> None:
        """Cast to `dtype` for inference, permanently; input and output stay float32. On a CPU the matrices are packed,
        and sequences divided among `batch_threads`."""
        self.to(dtype)
        self.dtype, self.batch_threads = dtype, batch_threads
        if can_pack(self):
            for block in self.blocks:
                if isinstance(block, CrossBlock):
                    block.pack(dtype)
            self.packed = True

    def forward(self, x: Tensor, valid: Tensor, words: Tensor, present: Tensor, wanted: Tensor | None = None) -> Tensor:
        """(B, S, w) -> (B, S, w) float32, or (M, w) of the M tokens that are wanted.

        Args:
            x: tokens with their positions.
            valid: (B, S) bool, tokens that may be read; one at least in each row.
            words: (B, L, w) with their positions.
            present: (B, L) bool; one at least in each row.
            wanted: (B, S) bool, tokens whose output is wanted, one after another; None = all, also those not valid.
        """
        x, words = (dropout(part, self.dropout, training=self.training).to(self.dtype) for part in (x, words))
        if not self.packed or torch.is_grad_enabled():
            for block in self.blocks:
                x = block(x, valid, words, present)
            hidden = self.norm(x).float()
            return hidden if wanted is None else hidden[wanted]
        some = valid if wanted is None else wanted
        parts = self.batch_threads.parts(len(x))
        made = self.batch_threads.map(lambda p: self._ragged(x[p], valid[p], words[p], present[p], some[p]), parts)
        rows = torch.cat(made)
        return rows if wanted is not None else rows.new_zeros(x.shape).masked_scatter_(valid[..., None], rows)

    def _ragged(self, x: Tensor, valid: Tensor, words: Tensor, present: Tensor, wanted: Tensor) -> Tensor:
        """Return the rows (M, w) `wanted`, in their order."""
        where, last = (Ragged.of(rows, self.heads, self.dtype) for rows in (valid, wanted))
        x = x.flatten(0, 1)[where.taken]
        blocks = [block for block in self.blocks if isinstance(block, CrossBlock)]
        for block in blocks[:-1]:
            x = block.ragged(x, where, block.cross.read(words, present))
        x = blocks[-1].ragged(x, where, blocks[-1].cross.read(words, present), last)
        return self.norm(x)[: int(wanted.sum())].float()
