"""The depth head (ours): a small causal transformer across the levels of one frame; level l sees the codes below it."""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from marey.models.mogo.config import DepthConfig
from marey.nn.stored_names import keep_stored_names
from marey.nn.transformer import Block


class DepthHead(nn.Module):
    """Transformer from trunk states and the codes below them to states that depend on those codes."""

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
        self.out_proj = nn.Linear(config.width, width)
        keep_stored_names(self)

    @property
    def layers(self) -> list[Block]:
        """Return the blocks, typed."""
        return [block for block in self.blocks if isinstance(block, Block)]

    def forward(self, states: Tensor, below: Tensor) -> Tensor:
        """States (N, V or 1, w), one per level or one for all, and embeddings (N, V - 1, w) of the codes below each, to
        (N, V, w)."""
        size = below.shape[1] + 1
        x = self.state(states) + self.level[:size] + F.pad(self.code(below), (0, 0, 1, 0))
        mask = torch.ones(size, size, dtype=torch.bool, device=x.device).tril()[None, None]
        for block in self.layers:
            x = block(x, mask)
        return states + self.out_proj(self.norm(x)).float()


class DepthFrame:
    """One frame's pass through the depth head, level by level as codes are drawn; keeps keys and values of lower
    levels."""

    def __init__(self, head: DepthHead, step: DepthStep, states: Tensor) -> None:
        """Start with trunk states (S, b, V or 1, w) of S sessions, b branches each; `step` is the head's."""
        sessions, branches, lanes, _ = states.shape
        levels = len(head.level)
        self._step, self._level = step, 0
        self._states = states.expand(-1, -1, levels, -1)
        self._entered = head.state(states.flatten(1, 2)).view(sessions, branches, lanes, -1) + head.level
        heads, width = head.layers[0].attention.heads, self._entered.shape[-1]
        self._memory = states.new_empty(len(head.layers), sessions, branches, 2, heads, levels, width // heads)

    def keep_first_branch(self) -> None:
        """Continue with the first branch alone."""
        self._states, self._entered = self._states[:, :1], self._entered[:, :1]
        self._memory = self._memory[:, :, :1]

    def next(self, below: Tensor | None) -> Tensor:
        """Return the state (S, b, w) of the next level, given the embedding (S, w) of the last code (None: level 0)."""
        level = self._level
        self._level += 1
        return self._step(self._states[:, :, level], self._entered[:, :, level], below, self._memory, level)


class DepthStep(nn.Module):
    """One level of the depth head: the layers of `DepthHead.forward`, over cached keys and values."""

    def __init__(self, head: DepthHead) -> None:
        """Share the layers of `head`, packed or not."""
        super().__init__()
        self.code, self.norm, self.out_proj = head.code, head.norm, head.out_proj
        self.blocks = nn.ModuleList(_StepBlock(block) for block in head.layers)

    def forward(self, state: Tensor, x: Tensor, below: Tensor | None, memory: Tensor, level: int) -> Tensor:
        """Return the level's state (S, b, w).

        Args:
            state: (S, b, w) of the trunk.
            x: (S, b, dw) the level's input to the head.
            below: (S, w) embedding of the code of the level below; None on level 0.
            memory: (blocks, S, b, 2, H, V, dw / H) keys and values; this level's are written into it.
            level: from 0.
        """
        if below is not None:
            x = x + self.code(below[:, None])
        for number, block in enumerate(self.blocks):
            x = block(x, memory[number], level)
        return state + self.out_proj(self.norm(x))


class _StepBlock(nn.Module):
    """`Block` for one level."""

    def __init__(self, block: Block) -> None:
        super().__init__()
        self.heads = block.attention.heads
        self.norm1, self.qkv, self.out = block.norm1, block.attention.qkv, block.attention.out
        self.norm2, self.wide, self.gelu, self.narrow = block.norm2, block.wide, block.gelu, block.narrow

    def forward(self, x: Tensor, memory: Tensor, level: int) -> Tensor:
        """Attend from (S, b, dw) of one level to it and the levels below."""
        qkv = self.qkv(self.norm1(x)).view(x.size(0), x.size(1), 3, self.heads, 1, -1)
        memory[..., level : level + 1, :] = qkv[:, :, 1:]
        past = memory[..., : level + 1, :].flatten(0, 1)  # (S · b, 2, H, level + 1, dw / H)
        mixed = F.scaled_dot_product_attention(qkv[:, :, 0].flatten(0, 1), past[:, 0], past[:, 1])
        x = x + self.out(mixed.reshape(x.size(0), x.size(1), x.size(2)))
        return x + self.narrow(self.gelu(self.wide(self.norm2(x))))
