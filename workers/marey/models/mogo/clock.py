"""How long ago an act began, told to every frame of it (ours, beyond MOGO).

Standing before a bow looks like standing after it, and an arm that came down like one that was never raised: the past
within reach does not say whether an act is still to be done. How many frames it is in force does.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from marey.nn.transformer import sinusoidal_positions

UNTOLD = -1
"""In place of frames where nobody knows, or where it is not to be told."""


class Clock(nn.Module):
    """Frames since an act began, as something to be added to a frame: nothing before training, and where untold."""

    sinusoids: Tensor  # (D + 1, w) of 0 … D frames

    def __init__(self, width: int, farthest: int, untold: float = 0.0) -> None:
        """Tell the time.

        Args:
            width: w, of what is added.
            farthest: D, frames beyond which all are alike.
            untold: share of the acts that training is not told the time of.
        """
        super().__init__()
        self.untold = untold
        self.project = nn.Linear(width, width, bias=False)
        self.register_buffer("sinusoids", sinusoidal_positions(farthest + 1, width), persistent=False)

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (…,) int64 since the act began, or `UNTOLD`, to (…, w)."""
        told = self.project(self.sinusoids[frames.clamp(0, len(self.sinusoids) - 1)])
        return told.masked_fill((frames < 0)[..., None], 0)

    def of_acts(self, batch: int, size: int, skipped: Tensor | None, seam: Tensor | None) -> Tensor:
        """What the frames 1 … n of clips are told, (B, n, w); in training the acts of some are not.

        Args:
            batch: B.
            size: n.
            skipped, seam: (B,) as in `RQHCTransformer.states`: frames of the first act that were cut off, and frames
                made when the second began.
        """
        device = self.sinusoids.device
        position = torch.arange(1, size + 1, device=device)
        since = position.expand(batch, -1) if skipped is None else position + skipped[:, None]
        second = torch.zeros_like(since)  # number of the act that each frame plays
        if seam is not None:
            second = (position >= seam[:, None]).long()
            since = torch.where(second > 0, position - seam[:, None], since)
        if self.training:
            untold = torch.rand(batch, 2, device=device) < self.untold
            since = since.masked_fill(untold.gather(1, second), UNTOLD)
        return self(since)
