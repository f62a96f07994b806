"""What live sessions are, as plain tensors that stay where they are."""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from marey.models.mogo.packed_model import PackedModel

NEVER = 2**62
"""More frames than any session makes."""


@dataclass(frozen=True)
class StreamState:
    """Sessions as rows of tensors: S of them, L lanes, V levels, W frames of window, H heads, w wide."""

    seeds: Tensor  # (S,) int64
    made: Tensor  # (S,) int64 frames drawn so far
    skipped: Tensor  # (S,) int64 frames that were made before the cache begins
    ends_from: Tensor  # (S,) int64: frames after which the session may draw END; NEVER: it runs until it is stopped
    began: Tensor  # (S,) int64 frames made when the act that plays began
    stops: Tensor  # (S,) int64 frames of it after which its clock stops; NEVER where nobody says how long it takes
    ended: Tensor  # (S,) bool: it drew END, and from then on columns of -1
    last: Tensor  # (S, V) int64, the newest column; -1 before the first
    opening: Tensor  # (S, L, w) states of position 0, from which frame 1 is drawn
    told: Tensor  # (S, L, w) what the prompt in force adds to every frame
    memory: Tensor  # (layers, 2, S, H, L, 1 + W, w / H) keys and values

    @classmethod
    def empty(cls, packed: PackedModel, sessions: int, branches: int, window: int) -> StreamState:
        """Room for so many sessions."""
        model, device = packed.network, packed.device
        t, lanes = model.config.transformer, branches * model.lanes
        slots = (t.layers, 2, sessions, t.heads, lanes, 1 + window, t.width // t.heads)
        whole = torch.zeros(6, sessions, dtype=torch.long, device=device)
        return cls(
            seeds=whole[0],
            made=whole[1],
            skipped=whole[2],
            ends_from=whole[3] + NEVER,
            began=whole[4],
            stops=whole[5] + NEVER,
            ended=whole[3].bool(),
            last=torch.full((sessions, model.levels), -1, device=device),
            opening=torch.zeros(sessions, lanes, t.width, device=device),
            told=torch.zeros(sessions, lanes, t.width, device=device),
            memory=torch.zeros(slots, dtype=packed.kept, device=device),
        )

    def row(self, index: int) -> dict[str, Tensor]:
        """Views of one session's tensors."""
        rows = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "memory"}
        return {**rows, "memory": self.memory[:, :, index]}
