"""Building blocks of motion tokenizers: frame masks and the residual block of MoMask's encoders.

Everything beyond a clip's own length is zero after every convolution: a bias would otherwise make the padding
non-zero, and the next convolution would leak it into the clip's end.
"""

from __future__ import annotations

import torch
import torch.nn.functional as F
from torch import Tensor, nn


def frame_mask(lengths: Tensor, size: int) -> Tensor:
    """Convert lengths (B,) to a mask (B, size) bool, True within the clip."""
    return torch.arange(size, device=lengths.device)[None] < lengths[:, None]


def masked(x: Tensor, mask: Tensor | None) -> Tensor:
    """Return `x` with zeros outside the mask, or `x` unchanged without one."""
    return x if mask is None else x * mask


class ResidualBlock(nn.Module):
    """ReLU, dilated conv k3, ReLU, conv k1, plus the input."""

    def __init__(self, width: int, dilation: int, dropout: float) -> None:
        super().__init__()
        self.wide = nn.Conv1d(width, width, 3, padding=dilation, dilation=dilation)
        self.narrow = nn.Conv1d(width, width, 1)
        self.dropout = dropout

    def forward(self, x: Tensor, mask: Tensor | None) -> Tensor:
        """(B, C, T) -> (B, C, T)."""
        h = masked(self.wide(F.relu(x)), mask)
        h = F.dropout(self.narrow(F.relu(h)), self.dropout, self.training)
        return masked(x + h, mask)
