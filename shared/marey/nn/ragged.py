"""Sequences of different lengths without their padding: for inference on a CPU.

All operations but attention act on each row alone, so only existing rows are computed, (R, w) for the whole batch; for
attention they are laid out in sequences padded to whole vectors (`ROWS`, `pad_length`). Packed products give a row the
same bits beside any others (`marey.nn.packed`), so a batch does not change a row's.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

SEQUENCE_MULTIPLE = 16
"""Sequences padded to a multiple of this give the same bits however much padding follows (see `pad_length`)."""
ROWS = 32
"""The number of rows is rounded up to a multiple of this: few rows use other kernels on some processors."""


def pad_length(size: int, multiple: int = SEQUENCE_MULTIPLE) -> int:
    """Return `size` rounded up to a multiple of 16, or of another number.

    A softmax over keys sums in vectors of 16 lanes and treats a last incomplete vector apart. Where all readable keys
    lie in whole vectors, masked keys behind them add exact zeros: measured with torch 2.13 on AVX-512, float32 and
    bfloat16, outputs are equal bit by bit.
    """
    return -(-size // multiple) * multiple


def key_bias(readable: Tensor, dtype: torch.dtype) -> Tensor:
    """Return the attention bias of keys: 0 where a key may be read, else far below any score. Same shape."""
    return torch.zeros(readable.shape, dtype=dtype, device=readable.device).masked_fill(~readable, -1e30)


@dataclass(frozen=True)
class Ragged:
    """Layout of the rows of B padded sequences for H heads: R computed rows, P places of a sequence.

    A chunk is the part of one row that one head reads: D numbers.
    """

    taken: Tensor  # (R,) places of the rows among B · S
    spread: Tensor  # (3 · B · H · P,) chunks of queries, keys and values among those of (R, 3, H)
    alone: Tensor  # (B · H · P,) chunks of one of these among those of (R, H)
    collect: Tensor  # (R, H) chunks of the rows among those of (B, H, P)
    bias: Tensor  # (B · H, 1, P) added to scores
    heads: int
    size: int  # S
    places: int  # P

    @classmethod
    def of(cls, valid: Tensor, heads: int, dtype: torch.dtype) -> Ragged:
        """Build the layout from `valid` (B, S) bool; each sequence needs one valid row. `dtype` is that of the
        scores."""
        batch, size = valid.shape
        places = pad_length(size)
        rows = valid.flatten().nonzero().squeeze(1)
        taken = torch.cat([rows, rows[:1].expand(-len(rows) % ROWS)])
        row = torch.zeros(batch, places, dtype=torch.long)  # masked places may hold any row
        row[rows // size, rows % size] = torch.arange(len(rows))
        part, head = torch.arange(3).view(3, 1, 1, 1), torch.arange(heads).view(1, 1, heads, 1)
        spread = (row[None, :, None] * 3 + part) * heads + head  # (3, B, H, P)
        alone = row[:, None] * heads + head[0]  # (B, H, P)
        sequence, place = taken[:, None] // size, taken[:, None] % size
        collect = (sequence * heads + torch.arange(heads)) * places + place
        exists = torch.zeros(batch, places, dtype=torch.bool)
        exists[:, :size] = valid
        bias = key_bias(exists, dtype)[:, None, None].expand(-1, heads, -1, -1).reshape(-1, 1, places)
        return cls(taken, spread.flatten(), alone.flatten(), collect, bias, heads, size, places)

    def first(self, rows: int) -> tuple[Tensor, Tensor]:
        """Return the layout's first `rows` places of each sequence.

        Returns:
            kept (R',), those among the R rows; place (B, rows), their index among the kept ones, 0 where a row does not
            exist.
        """
        inside = self.taken % self.size < rows
        inside[1:] &= self.taken[1:] > self.taken[:-1]  # without the rows that round up their number
        kept = inside.nonzero().squeeze(1)
        batch = len(self.bias) // self.heads
        place = torch.zeros(batch, rows, dtype=torch.long)
        taken = self.taken[kept]
        place[taken // self.size, taken % self.size] = torch.arange(len(kept))
        return torch.cat([kept, kept[:1].expand(-len(kept) % ROWS)]), place

    def sequences(self, qkv: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Spread (R, 3 · H · D) to queries, keys and values, each (B · H, P, D)."""
        chunks = qkv.view(len(qkv) * 3 * self.heads, -1).index_select(0, self.spread)
        query, key, value = chunks.view(3, len(self.bias), self.places, -1).unbind()
        return query, key, value

    def among(self, other: Ragged) -> Tensor:
        """Return where the rows (R,) of this layout are among those of another one of the same sequences, which has
        them all."""
        place = torch.zeros(len(self.bias) // self.heads * self.size, dtype=torch.long)
        place[other.taken] = torch.arange(len(other.taken))
        return place[self.taken]

    def queries(self, query: Tensor) -> Tensor:
        """Spread (R, H · D) to (B · H, P, D)."""
        chunks = query.view(len(query) * self.heads, -1).index_select(0, self.alone)
        return chunks.view(len(self.bias), self.places, -1)

    def rows(self, mixed: Tensor, kept: Tensor | None = None) -> Tensor:
        """Collect (B · H, P, D) to (R, H · D), or to the rows `kept`."""
        collect = self.collect if kept is None else self.collect[kept]
        return mixed.flatten(0, 1).index_select(0, collect.flatten()).view(len(collect), -1)
