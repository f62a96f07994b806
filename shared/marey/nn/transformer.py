"""Bidirectional transformer encoder: fused QKV, scaled dot-product attention, either norm placement.

Sequences are laid out [tokens | condition slots] in memory although positions count the slots first: attention does not
depend on memory order, positions are added to the inputs, and trailing padding (of tokens within their bucket, or of
slots) can be cut off without moving anything else.
"""

from __future__ import annotations

import math
from collections.abc import Generator
from contextlib import contextmanager
from contextvars import ContextVar

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.nn.batch_threads import CALLING_THREAD, BatchThreads
from marey.nn.packed import can_pack, pack_linears, packed_gelu
from marey.nn.ragged import SEQUENCE_MULTIPLE, Ragged, key_bias

_LIKE_A_GPU = ContextVar("like_a_gpu", default=False)


@contextmanager
def like_a_gpu() -> Generator[None]:
    """Let self-attention on a CPU save for the backward pass what a GPU's fused kernel saves, to count memory."""
    token = _LIKE_A_GPU.set(True)
    try:
        yield
    finally:
        _LIKE_A_GPU.reset(token)


def dropout(x: Tensor, rate: float, *, training: bool) -> Tensor:
    """Dropout; on a CPU eight elements share one draw of the generator.

    `torch.nn.functional.dropout` draws one number an element on one thread: a quarter of a training step.
    The rate is rounded to 1/256 there.
    """
    if not training or rate == 0:
        return x
    if x.device.type != "cpu":
        return F.dropout(x, rate)
    cut = round(rate * 256)
    words = torch.empty(-(-x.numel() // 8), dtype=torch.int64, device=x.device).random_(-(2**63), None)
    kept = words.view(torch.uint8)[: x.numel()].view(x.shape) >= cut
    return x * (kept.to(x.dtype) * (256 / (256 - cut)))


def attend(query: Tensor, key: Tensor, value: Tensor, bias: Tensor, rate: float) -> Tensor:
    """Compute scaled dot-product attention step by step, for CPUs: queries (B · H, Q, D), keys and values (B · H, S,
    D), `bias` of the scores (B · H or 1, Q or 1, S or 1).

    At 64 rows torch's fused CPU kernel takes twice as long forward, and a third of a training step backward.
    """
    scores = torch.baddbmm(bias, query, key.transpose(1, 2), alpha=query.shape[-1] ** -0.5)  # (B · H, Q, S)
    if rate > 0 or torch.is_grad_enabled():
        weights = dropout(scores.float().softmax(-1), rate, training=True).to(value.dtype)
    else:
        weights = scores.softmax(-1)
    return torch.bmm(weights, value)


class Attention(nn.Module):
    """Multi-head self-attention."""

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        """`dropout` acts on the attention weights; 0 keeps the fused kernel in training."""
        super().__init__()
        if width % heads:
            raise ValueError(f"width {width} does not divide into {heads} heads")
        self.heads = heads
        self.dropout = dropout
        self.qkv = nn.Linear(width, 3 * width)
        self.out = nn.Linear(width, width)

    def forward(self, x: Tensor, mask: Tensor | None, rows: int | None = None) -> Tensor:
        """(B, S, w) -> (B, S, w), or the first `rows` of it; `mask` (B, 1, 1, S) bool, true where a key may be read."""
        batch, size, width = x.shape
        qkv = self.qkv(x).view(batch, size, 3, self.heads, width // self.heads)
        query, key, value = qkv.permute(2, 0, 3, 1, 4)  # each (B, H, S, w / H)
        rate = self.dropout if self.training else 0.0
        if x.device.type != "cpu" or _LIKE_A_GPU.get():
            rate = 0.0 if x.device.type == "cpu" else rate  # fused kernels of a CPU have no dropout; it saves nothing
            # Rows that are not wanted are left out before: cutting them off behind gives wrong gradients where torch
            # chooses the attention of cuDNN (2.11 with cuDNN 9.19, bfloat16 on Hopper: off by 140 %).
            query = query[:, :, :rows]
            mixed = F.scaled_dot_product_attention(query, key, value, attn_mask=mask, dropout_p=rate)
        else:
            bias = query.new_zeros(1, 1, 1)
            if mask is not None:
                bias = key_bias(mask, query.dtype).expand(batch, self.heads, -1, -1).flatten(0, 1)
            query, key, value = (part.reshape(batch * self.heads, size, part.shape[-1]) for part in (query, key, value))
            mixed = attend(query, key, value, bias, rate).view(batch, self.heads, size, query.shape[-1])
            # Not before: float32 products of few rows add in another order on some processors.
            mixed = mixed[:, :, :rows]
        return self.out(mixed.transpose(1, 2).flatten(2))

    def ragged(self, x: Tensor, where: Ragged, kept: Tensor | None = None) -> Tensor:
        """`forward` of rows without padding: (R, w) -> (R, w), or the rows `kept` of it; no gradient."""
        query, key, value = where.sequences(self.qkv(x))
        return self.out(where.rows(attend(query, key, value, where.bias, 0.0), kept))


class Block(nn.Module):
    """Attention and feed-forward (GELU), each with residual, dropout and norm."""

    def __init__(
        self, width: int, heads: int, feedforward: int, dropout: float, attention_dropout: float, *, norm_first: bool
    ) -> None:
        super().__init__()
        self.norm_first = norm_first
        self.dropout = dropout
        self.attention = Attention(width, heads, attention_dropout)
        self.wide: nn.Module = nn.Linear(width, feedforward)
        self.gelu: nn.Module = nn.GELU()
        self.narrow = nn.Linear(feedforward, width)
        self.norm1 = nn.LayerNorm(width)
        self.norm2 = nn.LayerNorm(width)

    def forward(self, x: Tensor, mask: Tensor | None, rows: int | None = None) -> Tensor:
        """(B, S, w) -> (B, S, w), or the first `rows` of it, which read all S."""
        if self.norm_first:
            x = x[:, :rows] + self._drop(self.attention(self.norm1(x), mask, rows))
            return x + self.feedforward(self.norm2(x))
        x = self.norm1(x[:, :rows] + self._drop(self.attention(x, mask, rows)))
        return self.norm2(x + self.feedforward(x))

    def ragged(self, x: Tensor, where: Ragged, kept: Tensor | None = None) -> Tensor:
        """`forward` of rows without padding: (R, w) -> (R, w), or the rows `kept` of it; no gradient."""
        mine = x if kept is None else x[kept]
        if self.norm_first:
            x = mine + self.attention.ragged(self.norm1(x), where, kept)
            return x + self.feedforward(self.norm2(x))
        x = self.norm1(mine + self.attention.ragged(x, where, kept))
        return self.norm2(x + self.feedforward(x))

    def pack(self, dtype: torch.dtype) -> None:
        """Pack the matrices for inference on a CPU, GELU into the first of the feed-forward."""
        self.wide, self.gelu = packed_gelu(self.wide, self.gelu, dtype)
        pack_linears(self, dtype)

    def feedforward(self, x: Tensor) -> Tensor:
        """The second half of the block: (…, w) -> (…, w), no norm and no residual."""
        return self._drop(self.narrow(self._drop(self.gelu(self.wide(x)))))

    def _drop(self, x: Tensor) -> Tensor:
        return dropout(x, self.dropout, training=self.training)


class Transformer(nn.Module):
    """A stack of blocks; with `norm_first` a last norm follows."""

    def __init__(
        self,
        layers: int,
        width: int,
        heads: int,
        feedforward: int,
        dropout: float,
        attention_dropout: float = 0.0,
        *,
        norm_first: bool = False,
    ) -> None:
        super().__init__()
        self.blocks = nn.ModuleList(
            Block(width, heads, feedforward, dropout, attention_dropout, norm_first=norm_first) for _ in range(layers)
        )
        self.norm = nn.LayerNorm(width) if norm_first else nn.Identity()
        self.heads = heads
        self.dropout = dropout
        self.dtype = torch.float32
        self.multiple = SEQUENCE_MULTIPLE  # of rows, for bits that do not depend on padding
        self.packed = False
        self.batch_threads = CALLING_THREAD

    def forward(self, x: Tensor, valid: Tensor | None, rows: int | None = None) -> Tensor:
        """(B, S, w) -> (B, S, w) float32; `valid` (B, S) bool, None = all; every sample needs one valid position.

        Where only the first `rows` of the output are wanted, the last block computes no others.
        After `prepare_inference`, and under autocast, everything between runs in bfloat16: casting around each matrix
        costs more than it saves.
        """
        if self.packed:
            valid = torch.ones(x.shape[:2], dtype=torch.bool) if valid is None else valid
            parts = self.batch_threads.parts(len(x))
            return torch.cat(self.batch_threads.map(lambda part: self._ragged(x[part], valid[part], rows), parts))
        mask = None if valid is None else valid[:, None, None, :]
        kind = x.device.type
        dtype = torch.get_autocast_dtype(kind) if torch.is_autocast_enabled(kind) else self.dtype
        x = dropout(x, self.dropout, training=self.training).to(dtype)
        for block in self.blocks[:-1]:
            x = block(x, mask)
        return self.norm(self.blocks[-1](x, mask, rows)).float()

    def _ragged(self, x: Tensor, valid: Tensor, rows: int | None) -> Tensor:
        where = Ragged.of(valid, self.heads, self.dtype)
        kept, place = where.first(x.shape[1] if rows is None else rows)
        x = x.flatten(0, 1)[where.taken].to(self.dtype)
        blocks = [block for block in self.blocks if isinstance(block, Block)]
        for block in blocks[:-1]:
            x = block.ragged(x, where)
        return self.norm(blocks[-1].ragged(x, where, kept))[place].float()

    def prepare_inference(self, dtype: torch.dtype, batch_threads: BatchThreads = CALLING_THREAD) -> None:
        """Cast to `dtype` for inference, permanently; input and output stay float32. On a CPU sequences are divided
        among `batch_threads`."""
        self.to(dtype)
        self.dtype, self.batch_threads = dtype, batch_threads
        if can_pack(self):
            for block in self.blocks:
                if isinstance(block, Block):
                    block.pack(dtype)
            self.packed, self.multiple = True, 1


def sinusoidal_positions(size: int, width: int) -> Tensor:
    """Position encodings (size, width) of Vaswani et al. (2017): sines on even columns, cosines on odd ones."""
    position = torch.arange(size, dtype=torch.float32)[:, None]
    rate = torch.exp(torch.arange(0, width, 2, dtype=torch.float32) * (-math.log(10000.0) / width))
    table = torch.zeros(size, width)
    table[:, 0::2] = torch.sin(position * rate)
    table[:, 1::2] = torch.cos(position * rate[: width // 2])
    return table


def initialize(module: nn.Module, *, std: float = 0.02, embedding_std: float = 0.5) -> None:
    """Initialise with Normal(0, `std`) matrices, zero biases (BERT, MoMask) and larger embeddings (ours).

    Sinusoidal positions have a root mean square of 0.7: embeddings of 0.02 have no effect beside them for the first
    thousand steps.
    """
    for part in module.modules():
        if isinstance(part, nn.Embedding):
            nn.init.normal_(part.weight, std=embedding_std)
        if isinstance(part, nn.Linear):
            nn.init.normal_(part.weight, std=std)
        if isinstance(part, nn.Linear) and part.bias is not None:  # pyright: ignore[reportUnnecessaryComparison]
            nn.init.zeros_(part.bias)
