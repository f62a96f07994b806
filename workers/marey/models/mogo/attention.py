"""Causal self-attention with relative positions (MOGO eq. 9-10; Dai et al. 2019, Transformer-XL), whole or cached.

    A_ij = q_i·k_j + q_i·φ_{i−j} + u·k_j + v·φ_{i−j} = (q_i + u)·k_j + (q_i + v)·φ_{i−j}

φ_d = W_r·(sinusoids of d), one learned matrix W_r per layer, as in Transformer-XL (ours: the paper does not say).
A sequence is [prompts | frames]: every prompt is at position 0 and reads itself alone, frame i is at i.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

HIDDEN = -1e30
"""Added to the attention score of a hidden position."""


@dataclass(frozen=True)
class Reach:
    """Positions that the frames of a batch may read, beside all frames up to themselves."""

    prompts: int  # P
    to_prompt: Tensor  # (1 or N, n) int64: relative distance of each frame to position 0
    hidden: Tensor  # (1 or N, 1, n, P + n) bool: prompts and later frames that a frame may not read


class RelativeAttention(nn.Module):
    """Multi-head attention of eq. 9."""

    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        if width % heads:
            raise ValueError(f"width {width} does not divide into {heads} heads")
        self.heads = heads
        self.qkv = nn.Linear(width, 3 * width)
        self.relative = nn.Linear(width, width, bias=False)  # W_r
        self.u = nn.Parameter(torch.zeros(width))
        self.v = nn.Parameter(torch.zeros(width))
        self.out = nn.Linear(width, width)

    def terms(self, sinusoids: Tensor) -> Tensor:
        """Return φ of all distances 0 … D from their sinusoids (D + 1, w): (H, w / H, D + 1), divided by √(w / H)."""
        phi = self.relative(sinusoids).view(len(sinusoids), self.heads, -1)
        return phi.permute(1, 2, 0) * phi.shape[-1] ** -0.5

    def project(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Return queries, keys and values (…, H, w / H) of (…, w)."""
        query, key, value = self.qkv(x).view(*x.shape[:-1], 3, self.heads, -1).unbind(-3)
        return query, key, value

    def forward(self, x: Tensor, terms: Tensor, reach: Reach) -> Tensor:
        """Attend in whole sequences: (N, P + n, w) -> (N, P + n, w)."""
        return self.out(self.mix(*self.project(x), terms, reach))

    def mix(self, query: Tensor, key: Tensor, value: Tensor, terms: Tensor, reach: Reach) -> Tensor:
        """Attend with the queries, keys and values (N, P + n, H, w / H) of `project`; returns (N, P + n, w)."""
        query, key, value = (part.transpose(1, 2) for part in (query, key, value))  # (N, H, P + n, w / H)
        frames = query[:, :, reach.prompts :]
        bias = self._positions(frames, terms, reach)
        scores = (frames + self._heads(self.u)) @ key.transpose(2, 3) * frames.shape[-1] ** -0.5 + bias
        weights = scores.masked_fill(reach.hidden, HIDDEN).float().softmax(-1).to(value.dtype)
        mixed = torch.cat([value[:, :, : reach.prompts], weights @ value], 2)  # a prompt reads itself
        return mixed.transpose(1, 2).flatten(2)

    def _positions(self, query: Tensor, terms: Tensor, reach: Reach) -> Tensor:
        """Return (q_i + v)·φ_{i−j} of frames (N, H, n, w / H) over prompts and frames: (N, H, n, P + n)."""
        size = query.shape[2]
        positions = (query + self._heads(self.v)) @ terms  # (N, H, n, D + 1)
        distance = reach.to_prompt[:, None, :, None].expand(len(positions), self.heads, -1, -1)
        to_prompt = positions.gather(3, distance).expand(-1, -1, -1, reach.prompts)
        among = positions[..., :size].flip(-1)  # (N, H, n, n), column c is distance n - 1 - c
        # Transformer-XL's shift: row i moves left by n - 1 - i; wrapped entries lie above the diagonal
        shifted = F.pad(among, (1, 0)).view(*among.shape[:2], size + 1, size)[:, :, 1:]
        return torch.cat([to_prompt, shifted], -1)

    def _heads(self, vector: Tensor) -> Tensor:
        return vector.view(1, self.heads, 1, -1)


class Slots(NamedTuple):
    """Positions of S sessions in their caches: computed once per frame, for all layers."""

    rows: Tensor  # (S,) 0 … S - 1
    newest: Tensor  # (S,) int64: the slot of the newest frame
    distance: Tensor  # (S, 1, 1, slots) int64: relative distance of each slot
    hidden: Tensor  # (S, 1, 1, slots): `HIDDEN` where a slot is not readable, else 0


class LookBack(nn.Module):
    """`RelativeAttention` for one new position of S sessions, L lanes each, over kept keys and values."""

    def __init__(self, attention: RelativeAttention) -> None:
        """Share the layers of `attention`, packed or not."""
        super().__init__()
        self.heads = attention.heads
        self.qkv, self.out = attention.qkv, attention.out
        self.rowwise = attention.u.device.type == "cpu"
        self.u = attention.u.detach().view(1, attention.heads, 1, -1)
        self.v = attention.v.detach().view(1, attention.heads, 1, -1)

    def forward(self, x: Tensor, memory: Tensor, terms: Tensor, slots: Slots) -> Tensor:
        """Attend from one new position: (S, L, w) -> (S, L, w).

        Args:
            x: (S, L, w).
            memory: (2, S, H, L, slots, w / H) keys and values, in the type of the products over them; the new
                position's are written into it.
            terms: from `RelativeAttention.terms`.
            slots: positions of the sessions.
        """
        sessions, lanes = x.size(0), x.size(1)
        qkv = self.qkv(x).view(sessions, lanes, 3, self.heads, -1).permute(0, 2, 3, 1, 4)  # (S, 3, H, L, w / H)
        query = qkv[:, 0]
        memory[:, slots.rows, :, :, slots.newest] = qkv[:, 1:].to(memory.dtype)
        positions = self._positions(query + self.v, terms)  # (S, H, L, D + 1)
        bias = positions.gather(3, slots.distance.expand(-1, self.heads, lanes, -1)) + slots.hidden
        key, value = memory[0].flatten(0, 2), memory[1].flatten(0, 2)  # (S · H · L, slots, w / H)
        content = (query + self.u).reshape(key.size(0), 1, -1).to(key.dtype)
        bias = bias.view(key.size(0), 1, -1).to(key.dtype)
        scores = torch.baddbmm(bias, content, key.transpose(1, 2), alpha=key.size(2) ** -0.5)
        weights = scores.float().softmax(-1).to(value.dtype)
        mixed = torch.bmm(weights, value).view(sessions, self.heads, lanes, -1).to(x.dtype)
        return self.out(mixed.transpose(1, 2).reshape(sessions, lanes, -1))

    def _positions(self, query: Tensor, terms: Tensor) -> Tensor:
        """Return (q + v)·φ_d of all distances (S, H, L, D + 1), from q + v (S, H, L, w / H)."""
        if self.rowwise:  # session by session: with more rows some processors' products add in another order
            return torch.stack([torch.bmm(each, terms) for each in query.unbind()])
        together = torch.bmm(query.transpose(0, 1).flatten(1, 2), terms)  # one product for each head
        return together.view(self.heads, query.size(0), query.size(2), -1).transpose(0, 1)
