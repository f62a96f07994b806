"""The depth head (ours): a small causal transformer across the levels of one frame; level l sees the codes below it."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from shared.nn.transformer import Block
from workers.mogo.config import DepthConfig


class DepthHead(nn.Module):
    """Trunk states and the codes drawn below them to states that know those codes."""

    def __init__(self, config: DepthConfig, levels: int, width: int) -> None:
        super().__init__()
        self.state = nn.Linear(width, config.width)
        self.code = nn.Linear(width, config.width, bias=False)
        self.level = nn.Parameter(torch.randn(levels, config.width) * 0.02)
        self.blocks = nn.ModuleList(
            Block(config.width, config.heads, config.feedforward, 0.0, 0.0, norm_first=True)
            for _ in range(config.layers)
        )
        self.norm = nn.LayerNorm(config.width)
        self.leave = nn.Linear(config.width, width)

    @property
    def layers(self) -> list[Block]:
        """The blocks, typed."""
        return [block for block in self.blocks if isinstance(block, Block)]

    def forward(self, states: Tensor, below: Tensor) -> Tensor:
        """States (N, L, w) of the levels 0 … L - 1 and embeddings (N, L - 1, w) of the codes below each: (N, L, w)."""
        size = states.shape[1]
        x = self.state(states) + self.level[:size] + F.pad(self.code(below), (0, 0, 1, 0))
        mask = torch.ones(size, size, dtype=torch.bool, device=x.device).tril()[None, None]
        for block in self.layers:
            x = block(x, mask)
        return states + self.leave(self.norm(x)).float()


class DepthFrame:
    """One frame through the depth head level by level, as codes are drawn; keys and values below are kept."""

    def __init__(self, head: DepthHead, states: Tensor) -> None:
        """Begin with trunk states (S, b, V, w) of S sessions, b branches each."""
        sessions, branches, levels, _ = states.shape
        self._head, self._states, self._level = head, states, 0
        self._entered = head.state(states.flatten(1, 2)).view(sessions, branches, levels, -1) + head.level
        heads, width = head.layers[0].attention.heads, self._entered.shape[-1]
        self._memory = states.new_empty(len(head.layers), sessions, branches, 2, heads, levels, width // heads)

    def next(self, below: Tensor | None) -> Tensor:
        """The state (S, b, w) of the next level, given the embedding (S, w) of the code just drawn (None: level 0)."""
        head, level = self._head, self._level
        self._level += 1
        x = self._entered[:, :, level]
        if below is not None:
            x = x + head.code(below[:, None])
        for block, memory in zip(head.layers, self._memory, strict=True):
            x = x + self._attend(block, x, memory, level)
            x = x + block.feedforward(block.norm2(x))
        return self._states[:, :, level] + head.leave(head.norm(x))

    @staticmethod
    def _attend(block: Block, x: Tensor, memory: Tensor, level: int) -> Tensor:
        """(S, b, dw) of one level over it and those below; `memory` (S, b, 2, H, V, dw / H)."""
        qkv = block.attention.qkv(block.norm1(x)).view(*x.shape[:2], 3, block.attention.heads, 1, -1)
        memory[..., level : level + 1, :] = qkv[:, :, 1:]
        key, value = memory[..., : level + 1, :].flatten(0, 1).unbind(1)  # (S · b, H, level + 1, dw / H)
        mixed = F.scaled_dot_product_attention(qkv[:, :, 0].flatten(0, 1), key, value)
        return block.attention.out(mixed.view(x.shape))
