"""State of live sessions, as plain tensors that stay in place."""

from __future__ import annotations

from dataclasses import dataclass, fields

import torch
from torch import Tensor

from marey.models.mogo.packed_model import PackedModel

NEVER = 2**62
"""A number of frames that no session reaches."""


@dataclass(frozen=True)
class SessionState:
    """Sessions as rows of tensors: S of them, L lanes, V levels, W frames of window, m positions before them, H heads,
    w wide."""

    seeds: Tensor  # (S,) int64
    made: Tensor  # (S,) int64 frames drawn so far
    skipped: Tensor  # (S,) int64 frames that were made before the cache begins
    ends_from: Tensor  # (S,) int64: frames after which the session may draw END; NEVER: it runs until it is stopped
    began: Tensor  # (S,) int64 frames made when the current action began
    stops: Tensor  # (S,) int64 frames of it after which its clock stops; NEVER where its usual length is unknown
    ended: Tensor  # (S,) bool: it drew END, and from then on columns of -1
    last: Tensor  # (S, V) int64, the newest column; -1 before the first
    opening: Tensor  # (S, L, w) states of position 0, from which frame 1 is drawn
    prompt_term: Tensor  # (S, L, w) term that the current prompt adds to every frame
    memory: Tensor  # (layers, 2, S, H, L, m + W, w / H) keys and values

    @classmethod
    def empty(cls, packed: PackedModel, sessions: int, branches: int, window: int) -> SessionState:
        """Allocate the state of `sessions` sessions."""
        model, device = packed.network, packed.device
        t, lanes = model.config.transformer, branches * model.lanes
        slots = (t.layers, 2, sessions, t.heads, lanes, model.leads + window, t.width // t.heads)
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
            prompt_term=torch.zeros(sessions, lanes, t.width, device=device),
            memory=torch.zeros(slots, dtype=packed.kept, device=device),
        )

    def row(self, index: int) -> dict[str, Tensor]:
        """Return views of one session's tensors."""
        rows = {f.name: getattr(self, f.name)[index] for f in fields(self) if f.name != "memory"}
        return {**rows, "memory": self.memory[:, :, index]}
