"""Multi-scale residual quantizer with one codebook for all scales (eq. 5)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import torch
from torch import Tensor

from marey.models.momaskpp.config import TokenizerConfig
from marey.models.momaskpp.scales import Scales, enlarging, shrinking
from marey.nn.convolution import frame_mask
from marey.nn.quantizer import NO_TOKEN, Quantized, ResidualQuantizer


@dataclass(frozen=True)
class _Scale:
    """One scale of a batch, quantized."""

    index: Tensor  # (B, P), NO_TOKEN where a clip has no such position
    vectors: Tensor  # (B, P, d) that were quantized
    valid: Tensor  # (B, P) bool
    total: Tensor  # (B, T, d): sum of the codes of this scale and those before it, enlarged


class MultiScaleQuantizer(ResidualQuantizer):
    """Scale v quantizes the residual of the scales before it, shrunk to its number of positions.

    The codebook is the only one of the base class, trained by the vectors of all scales; the base class's draws of
    first codes and of those that replace dead ones stand in for the published order of the batch.
    """

    def __init__(self, config: TokenizerConfig, scales: Scales) -> None:
        """Build an empty codebook; the first training batch fills it from the coarsest scale."""
        super().__init__(1, config.codes, config.code_width, decay=config.decay, dropout=0.0)
        self.scales = scales
        self.temperature = config.gumbel

    def quantize(self, latent: Tensor, lengths: Tensor) -> Quantized:
        """Quantize latents (B, T, d) of clips of `lengths` (B,) tokens; in training also update the codebook.

        Returns:
            tokens are (B, N, 1); the commitment is the mean over scales of the mean squared distance between the
            latents and the sum up to that scale.
        """
        with torch.autocast(latent.device.type, enabled=False):
            return self._quantize(latent.float(), lengths)

    def _quantize(self, latent: Tensor, lengths: Tensor) -> Quantized:
        inside = frame_mask(lengths, latent.shape[1])[..., None]  # (B, T, 1)
        found: list[_Scale] = []
        commitment = latent.new_zeros(())
        for scale in self._each_scale(latent, lengths):
            found.append(scale)
            distance = (latent - scale.total).square().mean(-1, keepdim=True)
            commitment = commitment + (distance * inside).sum() / inside.sum()
        index = torch.cat([scale.index for scale in found], 1)
        valid, chosen = torch.cat([scale.valid for scale in found], 1), index.clamp(min=0)
        usage = self._usage(chosen, valid)
        if self.training:
            vectors = torch.cat([scale.vectors for scale in found], 1)
            self._update(0, vectors, valid, chosen, usage, self._draw(0, vectors, valid))
            self.initialized.fill_(True)
        share = usage / usage.sum().clamp(min=1)
        perplexity = torch.exp(-(share * torch.log(share + 1e-10)).sum())[None]
        masked = latent * inside
        output = self.straight_through(masked, found[-1].total * inside)
        return Quantized(output, index[..., None], commitment / len(found), perplexity)

    @torch.no_grad()
    def indices(self, latent: Tensor, lengths: Tensor) -> Tensor:
        """Return tokens (B, N) of latents (B, T, d), NO_TOKEN where clips of `lengths` (B,) have none."""
        return torch.cat([scale.index for scale in self._each_scale(latent.float(), lengths)], 1)

    def vectors(self, tokens: Tensor, lengths: Tensor, size: int) -> Tensor:
        """Return the sum (B, size, d) of the enlarged codes of tokens (B, N); it is not zero beyond a clip's end."""
        total = self.codebooks.new_zeros(len(tokens), size, self.codebooks.shape[-1])
        for scale, index in enumerate(self.scales.split(tokens)):
            total = total + self._enlarged(index, lengths, scale, size)
        return total

    def _each_scale(self, latent: Tensor, lengths: Tensor) -> Iterator[_Scale]:
        """Quantize scale by scale, coarse to fine."""
        size = latent.shape[1]
        inside = frame_mask(lengths, size)[..., None]
        residual = latent.detach()
        total = torch.zeros_like(residual)
        for scale, width in enumerate(self.scales.widths):
            span, positions = self.scales.span(lengths), self.scales.positions(lengths, scale)
            vectors = shrinking(span, positions, size, width) @ (residual * inside)  # (B, P, d)
            valid = frame_mask(self.scales.counts(lengths, scale), width)
            if self.training and scale == 0:
                self._initialize(0, self._draw(0, vectors, valid))
            index = self._chosen(vectors).masked_fill(~valid, NO_TOKEN)
            enlarged = self._enlarged(index, lengths, scale, size)
            residual, total = residual - enlarged, total + enlarged
            yield _Scale(index, vectors, valid, total)

    def _enlarged(self, index: Tensor, lengths: Tensor, scale: int, size: int) -> Tensor:
        codes = self.codebooks[0][index.clamp(min=0)] * (index >= 0)[..., None]  # (B, P, d)
        positions = self.scales.positions(lengths, scale)
        return enlarging(self.scales.span(lengths), positions, size, index.shape[1]) @ codes

    def _chosen(self, vectors: Tensor) -> Tensor:
        """Return the nearest code of vectors (B, P, d); in training one drawn by distance, at `temperature`."""
        if not self.training or self.temperature == 0:
            return self.nearest(vectors, 0)
        distance = torch.cdist(vectors, self.codebooks[0][None]).square()
        noise = -torch.log(-torch.log(torch.rand_like(distance).clamp(1e-9, 1 - 1e-7)))
        return (-distance / self.temperature + noise).argmax(-1)
