"""Time since the start of an action, as an input to every frame of it (ours, beyond MOGO).

Standing before a bow looks like standing after it, and a lowered arm looks like one that was never raised: the window
of the past does not show whether an action is still to come. The number of frames since its start does.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from marey.nn.transformer import sinusoidal_positions

UNKNOWN_TIME = -1
"""Stands for the time where it is unknown or hidden from the model."""


class Clock(nn.Module):
    """Embedding of the frames since an action began, added to a frame; zero before training and for `UNKNOWN_TIME`."""

    sinusoids: Tensor  # (D + 1, w) of 0 … D frames

    def __init__(self, width: int, farthest: int, hidden_share: float = 0.0) -> None:
        """Create the embedding.

        Args:
            width: w, of the embedding.
            farthest: D, frames beyond which all times share one embedding.
            hidden_share: share of actions whose time training hides.
        """
        super().__init__()
        self.hidden_share = hidden_share
        self.project = nn.Linear(width, width, bias=False)
        self.register_buffer("sinusoids", sinusoidal_positions(farthest + 1, width), persistent=False)

    def forward(self, frames: Tensor) -> Tensor:
        """Embed frames (…,) int64 since the action began, or `UNKNOWN_TIME`, as (…, w)."""
        embedded = self.project(self.sinusoids[frames.clamp(0, len(self.sinusoids) - 1)])
        return embedded.masked_fill((frames < 0)[..., None], 0)

    def of_actions(self, batch: int, size: int, skipped: Tensor | None, seam: Tensor | None) -> Tensor:
        """Embed the times of frames 1 … n of clips, (B, n, w); training hides those of some actions.

        Args:
            batch: B.
            size: n.
            skipped, seam: (B,) as in `RQHCTransformer.states`: frames of the first action that were cut off, and frames
                made when the second began.
        """
        device = self.sinusoids.device
        position = torch.arange(1, size + 1, device=device)
        since = position.expand(batch, -1) if skipped is None else position + skipped[:, None]
        second = torch.zeros_like(since)  # number of the action that each frame plays
        if seam is not None:
            second = (position >= seam[:, None]).long()
            since = torch.where(second > 0, position - seam[:, None], since)
        if self.training:
            hidden = torch.rand(batch, 2, device=device) < self.hidden_share
            since = since.masked_fill(hidden.gather(1, second), UNKNOWN_TIME)
        return self(since)
