"""Causal self-attention with relative positions (MOGO eq. 9-10; Dai et al. 2019, Transformer-XL), whole or cached.

    A_ij = q_i·k_j + q_i·φ_{i−j} + u·k_j + v·φ_{i−j} = (q_i + u)·k_j + (q_i + v)·φ_{i−j}

φ_d = W_r·(sinusoids of d), one learnt matrix W_r a layer: "learned" as in Transformer-XL (ours, the paper is silent).
A sequence is [prompts | frames]: every prompt stands at position 0 and reads itself alone, frame i stands at i.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
import torch.nn.functional as F
from torch import Tensor, nn

_HIDDEN = -1e30


@dataclass(frozen=True)
class Reach:
    """What the frames of a batch may read, beside all frames up to themselves."""

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
        """φ of all distances 0 … D from their sinusoids (D + 1, w): (H, w / H, D + 1), already over √(w / H)."""
        phi = self.relative(sinusoids).view(len(sinusoids), self.heads, -1)
        return phi.permute(1, 2, 0) * phi.shape[-1] ** -0.5

    def project(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Queries, keys and values (…, H, w / H) of (…, w)."""
        query, key, value = self.qkv(x).view(*x.shape[:-1], 3, self.heads, -1).unbind(-3)
        return query, key, value

    def forward(self, x: Tensor, terms: Tensor, reach: Reach) -> Tensor:
        """Whole sequences (N, P + n, w) -> (N, P + n, w)."""
        query, key, value = (part.transpose(1, 2) for part in self.project(x))  # (N, H, P + n, w / H)
        frames = query[:, :, reach.prompts :]
        bias = self._positions(frames, terms, reach)
        scores = (frames + self._heads(self.u)) @ key.transpose(2, 3) * frames.shape[-1] ** -0.5 + bias
        weights = scores.masked_fill(reach.hidden, _HIDDEN).float().softmax(-1).to(value.dtype)
        mixed = torch.cat([value[:, :, : reach.prompts], weights @ value], 2)  # a prompt reads itself
        return self.out(mixed.transpose(1, 2).reshape(x.shape))

    def _positions(self, query: Tensor, terms: Tensor, reach: Reach) -> Tensor:
        """(q_i + v)·φ_{i−j} of frames (N, H, n, w / H) over prompts and frames: (N, H, n, P + n)."""
        size = query.shape[2]
        query = query + self._heads(self.v)
        prompt = terms[:, :, reach.to_prompt].permute(2, 0, 3, 1)  # (1 or N, H, n, w / H)
        to_prompt = (query * prompt).sum(-1, keepdim=True).expand(-1, -1, -1, reach.prompts)
        among = query @ terms[..., :size].flip(-1)  # (N, H, n, n), column c is distance n - 1 - c
        # Transformer-XL's shift: row i moves left by n - 1 - i; what wraps around lies above the diagonal
        shifted = F.pad(among, (1, 0)).view(*among.shape[:2], size + 1, size)[:, :, 1:]
        return torch.cat([to_prompt, shifted], -1)

    def look_back(self, query: Tensor, key: Tensor, value: Tensor, terms: Tensor, distance: Tensor) -> Tensor:
        """One new position of S sessions, L lanes each, over cached slots: (S, L, w).

        Args:
            query: (S, L, H, w / H).
            key: (S, L, H, slots, w / H), the new position's own among them.
            value: like `key`.
            terms: from `terms`.
            distance: (S, slots) int64 relative distance of each slot, -1 where nothing may be read.
        """
        sessions, lanes, heads, width = query.shape
        about = (query + self.v.view(heads, width)).transpose(1, 2)  # (S, H, L, w / H)
        # session by session: with more rows some processors' products add in another order
        positions = torch.stack([torch.bmm(each, terms) for each in about]).transpose(1, 2)  # (S, L, H, D + 1)
        index = distance.clamp(min=0)[:, None, None].expand(-1, lanes, heads, -1)
        bias = positions.gather(-1, index).masked_fill((distance < 0)[:, None, None], _HIDDEN)  # (S, L, H, slots)
        content = (query + self.u.view(heads, width)) * width**-0.5
        scores = (content[..., None, :] @ key.transpose(-1, -2)).squeeze(-2) + bias
        mixed = scores.float().softmax(-1).to(value.dtype)[..., None, :] @ value  # (S, L, H, 1, w / H)
        return self.out(mixed.reshape(sessions, lanes, -1))

    def _heads(self, vector: Tensor) -> Tensor:
        return vector.view(1, self.heads, 1, -1)
