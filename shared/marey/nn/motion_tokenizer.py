"""Interface of motion tokenizers for training and generation."""

from __future__ import annotations

from abc import ABC, abstractmethod

import torch
from torch import Tensor, nn

from marey.nn.quantizer import Quantized

ROOT = slice(0, 4)
"""Yaw rate, X and Z displacement, height: the first columns of every HumanML3D-like layout."""
CONTACTS = slice(-4, None)


class MotionTokenizer(nn.Module, ABC):
    """Tokenizer of features in their own units; its statistics are inside."""

    mean: Tensor  # (D,)
    std: Tensor  # (D,), as the network uses it

    def __init__(self, features: int, frames_per_token: int) -> None:
        super().__init__()
        self.frames_per_token = frames_per_token
        self.register_buffer("mean", torch.zeros(features))
        self.register_buffer("std", torch.ones(features))

    @property
    @abstractmethod
    def codebooks(self) -> Tensor:
        """(V, K, d)."""

    @abstractmethod
    def forward(self, features: Tensor, lengths: Tensor | None = None) -> tuple[Tensor, Quantized]:
        """Reconstruct (training): features (B, T, D) in their own units, `lengths` (B,) in frames or None = all T.

        Returns:
            reconstruction (B, T, D), normalised, and the quantizer's result. T and lengths divide by the rate.
        """

    @abstractmethod
    def encode(self, features: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Encode features (B, T, D) as tokens (B, n, V); -1 beyond a clip's own length (B,), in frames."""

    @abstractmethod
    def decode(self, tokens: Tensor, lengths: Tensor | None = None) -> Tensor:
        """Decode tokens to features (B, T, D) in their own units; `lengths` (B,) in TOKENS; zero beyond them."""

    def set_statistics(self, mean: Tensor, std: Tensor) -> None:
        """Set mean and std (D,) as the network uses them (`biased_std` makes the latter from the data's)."""
        self.mean.copy_(mean)
        self.std.copy_(std)

    def normalize(self, features: Tensor) -> Tensor:
        """Normalise (…, D) in their own units to zero mean and unit std."""
        return (features - self.mean) / self.std

    def restore(self, normalized: Tensor) -> Tensor:
        """Invert `normalize`."""
        return normalized * self.std + self.mean


def biased_std(std: Tensor, bias: float) -> Tensor:
    """Divide the std of root and contact columns by `bias` (MoMask), which gives their errors more weight."""
    scaled = std.clone()
    scaled[ROOT] /= bias
    scaled[CONTACTS] /= bias
    return scaled
