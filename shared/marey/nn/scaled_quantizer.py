"""MoSA-VQ: a residual quantizer whose levels scale and shift their input (MOGO Sec. 2.1, eq. 1-6).

Fu et al., "MOGO: Residual Quantized Hierarchical Causal Transformer", 2025. The codebooks are in the scaled space;
averages, resets and dropped levels are those of `ResidualQuantizer`.
"""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor, nn

from marey.nn.quantizer import ResidualQuantizer

Scale = Literal["elementwise", "scalar", "none"]

MIN_SCALE = 0.05
"""Lower limit of |s|, the divisor of eq. 3."""


class ScaledQuantizer(ResidualQuantizer):
    """Level l quantizes |s|·r + bias and returns (code - bias) / |s| (eq. 1-3), s and bias learned.

    |s| is read elementwise: the paper writes a norm of a vector that its regularizer pulls to 1, and only elementwise
    is identity its fixed point. Scales and biases are vectors, one parameter a level: the training loop decays
    matrices only, and decay would pull s to 0.
    """

    def __init__(
        self,
        levels: int,
        codes: int,
        width: int,
        *,
        decay: float = 0.99,
        dropout: float = 0.2,
        revive: float = 1.0,
        scale: Scale = "elementwise",
    ) -> None:
        """See `ResidualQuantizer`.

        Args:
            levels: V.
            codes: K.
            width: d.
            decay: of the codebooks' averages.
            dropout: share of training samples that lose upper levels.
            revive: usage under which a code is dead.
            scale: one s an element, one a level ("scalar"), or neither s nor bias ("none").
        """
        super().__init__(levels, codes, width, decay=decay, dropout=dropout, revive=revive)
        learnt = 0 if scale == "none" else levels
        size = 1 if scale == "scalar" else width
        self.scales = nn.ParameterList(torch.ones(size) for _ in range(learnt))
        self.biases = nn.ParameterList(torch.zeros(width) for _ in range(learnt))

    def scaled(self, vectors: Tensor, level: int) -> Tensor:
        """Return |s|·r + bias (eq. 1)."""
        return vectors * self._scale(level) + self.biases[level] if len(self.scales) else vectors

    def restored(self, codes: Tensor, level: int) -> Tensor:
        """Return (code - bias) / |s| (eq. 3); s and bias get their gradient here alone."""
        return (codes - self.biases[level]) / self._scale(level) if len(self.scales) else codes

    def straight_through(self, latent: Tensor, total: Tensor) -> Tensor:
        """Return the value of `total`; its own gradient goes to s and bias, that of the identity to `latent` (ours).

        Inside the scaling, straight-through would cancel the bias and give s a gradient that inflates it.
        """
        return total + (latent - latent.detach())

    def regularizer(self) -> Tensor:
        """Return the last term of eq. 6 without γ: sum over levels of (s - 1)² and bias², each a mean over elements
        (ours)."""
        total = self.codebooks.new_zeros(())
        for scale, bias in zip(self.scales, self.biases, strict=True):
            total = total + (scale - 1).square().mean() + bias.square().mean()
        return total

    def _scale(self, level: int) -> Tensor:
        return self.scales[level].abs().clamp(min=MIN_SCALE)
