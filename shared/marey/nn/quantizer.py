"""Residual vector quantizer with exponential-moving-average codebooks.

HGM³ eq. 1-2; averages and resets after van den Oord et al. (2017), T2M-GPT (Zhang 2023) and MoMask (Guo 2024).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from marey.nn.distributed import all_reduce_sum, broadcast_any

NO_TOKEN = -1
"""Token of a level that was dropped, or of a position beyond the clip: decodes to the zero vector."""


@dataclass(frozen=True)
class Quantized:
    """Result of one pass through the quantizer."""

    output: Tensor  # (B, n, d), straight-through: its gradient is passed to the input unchanged
    tokens: Tensor  # (B, n, V) int64, NO_TOKEN where dropped or invalid
    commitment: Tensor  # scalar: sum over levels of the mean squared distance (eq. 2, without β)
    perplexity: Tensor  # (V,), exp of the entropy of each level's code usage in this batch


class ResidualQuantizer(nn.Module):
    """V codebooks of K codes; level v quantizes the residual of the levels below it (eq. 1)."""

    codebooks: Tensor  # (V, K, d)
    counts: Tensor  # (V, K), moving average of the number of vectors per batch that chose the code
    sums: Tensor  # (V, K, d), moving average of the sum of those vectors
    initialized: Tensor  # (), bool

    def __init__(
        self, levels: int, codes: int, width: int, *, decay: float = 0.99, dropout: float = 0.2, revive: float = 1.0
    ) -> None:
        """Build empty codebooks; the first training batch fills them.

        Args:
            levels: V, number of residual levels.
            codes: K, codes a level.
            width: d, width of a code.
            decay: of the moving averages.
            dropout: share of training samples that lose their upper levels (a random number of them, at least one).
            revive: a code chosen by fewer vectors a batch than this (moving average) is dead and is reset.
        """
        super().__init__()
        self.decay = decay
        self.dropout = dropout
        self.revive = revive
        self.register_buffer("codebooks", torch.zeros(levels, codes, width))
        self.register_buffer("counts", torch.ones(levels, codes))
        self.register_buffer("sums", torch.zeros(levels, codes, width))
        self.register_buffer("initialized", torch.tensor(False))

    @property
    def levels(self) -> int:
        """V."""
        return self.codebooks.shape[0]

    @property
    def codes(self) -> int:
        """K."""
        return self.codebooks.shape[1]

    def forward(self, latent: Tensor, valid: Tensor | None = None) -> Quantized:
        """Quantize; in training mode also update the codebooks and drop upper levels.

        Args:
            latent: (B, n, d).
            valid: (B, n) bool, None = all. Invalid positions neither train nor count, and their output is zero.
        """
        with torch.autocast(latent.device.type, enabled=False):
            return self._forward(latent.float(), valid)

    def _forward(self, latent: Tensor, valid: Tensor | None) -> Quantized:
        if valid is None:
            valid = torch.ones(latent.shape[:2], dtype=torch.bool, device=latent.device)
        kept = self._kept_levels(latent)  # (B,)
        residual = latent
        total = torch.zeros_like(latent)
        commitment = latent.new_zeros(())
        tokens: list[Tensor] = []
        perplexity: list[Tensor] = []
        for level in range(self.levels):
            active = valid & (level < kept)[:, None]  # (B, n)
            vectors = self.scaled(residual.detach(), level).detach()  # (B, n, d)
            if self.training:
                self._initialize(level, vectors[active])
            index = self.nearest(vectors, level)  # (B, n)
            restored = self.restored(self.codebooks[level][index], level) * active[..., None]  # (B, n, d)
            chosen = restored.detach()
            distance = (residual - chosen).square().mean(-1)  # (B, n)
            commitment = commitment + (distance * active).sum() / active.sum().clamp(min=1)
            usage = torch.bincount(index[active], minlength=self.codes).float()
            perplexity.append(_perplexity(usage))
            if self.training:
                self._update(level, vectors[active], index[active], usage)
            residual = residual - chosen
            total = total + restored
            tokens.append(index.masked_fill(~active, NO_TOKEN))
        if self.training:
            self.initialized.fill_(True)
        masked = latent * valid[..., None]
        output = self.straight_through(masked, total)
        return Quantized(output, torch.stack(tokens, -1), commitment, torch.stack(perplexity))

    def scaled(self, vectors: Tensor, level: int) -> Tensor:
        """Return vectors (..., d) as the codebook of `level` sees them: here unchanged."""
        return vectors

    def restored(self, codes: Tensor, level: int) -> Tensor:
        """Invert `scaled`, for codes (..., d)."""
        return codes

    def straight_through(self, latent: Tensor, total: Tensor) -> Tensor:
        """Return the value of `total`, with its gradient passed to `latent` alone."""
        return latent + (total - latent).detach()

    @torch.no_grad()
    def encode(self, latent: Tensor) -> Tensor:
        """Return tokens (B, n, V) of `latent` (B, n, d), all levels, without training."""
        residual = latent.float()
        tokens: list[Tensor] = []
        for level in range(self.levels):
            index = self.nearest(self.scaled(residual, level), level)
            residual = residual - self.restored(self.codebooks[level][index], level)
            tokens.append(index)
        return torch.stack(tokens, -1)

    def decode(self, tokens: Tensor) -> Tensor:
        """Return the sum of the codes (B, n, d) of tokens (B, n, V' <= V); NO_TOKEN adds nothing."""
        total = self.codebooks.new_zeros((*tokens.shape[:-1], self.codebooks.shape[-1]))
        for level in range(tokens.shape[-1]):
            index = tokens[..., level]
            chosen = self.restored(self.codebooks[level][index.clamp(min=0)], level)
            total = total + chosen * (index >= 0)[..., None]
        return total

    def nearest(self, vectors: Tensor, level: int) -> Tensor:
        """Return the index (...) of the code of `level` nearest to each vector (..., d), Euclidean."""
        codebook = self.codebooks[level]
        flat = vectors.reshape(-1, vectors.shape[-1])
        # |x|² is the same for every code: left out
        scores = torch.addmm(codebook.square().sum(-1), flat, codebook.T, beta=1.0, alpha=-2.0)
        return scores.argmin(-1).view(vectors.shape[:-1])

    def _kept_levels(self, latent: Tensor) -> Tensor:
        """Return the number of levels that each sample keeps (B,): all, or in training for a share of the samples 1 to
        V - 1."""
        batch = latent.shape[0]
        everything = torch.full((batch,), self.levels, device=latent.device)
        if not self.training or self.dropout == 0 or self.levels == 1:
            return everything
        fewer = torch.randint(1, self.levels, (batch,), device=latent.device)
        return torch.where(torch.rand(batch, device=latent.device) < self.dropout, fewer, everything)

    @torch.no_grad()
    def _initialize(self, level: int, vectors: Tensor) -> None:
        """Fill a codebook with vectors of the first batch (repeated with a little noise if there are too few)."""
        if bool(self.initialized):
            return
        drawn = self._draw_any(level, vectors)
        if drawn is None:
            return
        self.codebooks[level] = drawn
        self.sums[level] = self.codebooks[level]
        self.counts[level] = 1.0

    @torch.no_grad()
    def _update(self, level: int, vectors: Tensor, index: Tensor, usage: Tensor) -> None:
        """Move the averages, then reset dead codes to vectors of this batch."""
        sums = torch.zeros_like(self.sums[level]).index_add_(0, index, vectors)
        usage = all_reduce_sum(usage.clone())
        sums = all_reduce_sum(sums)
        self.counts[level].mul_(self.decay).add_(usage, alpha=1 - self.decay)
        self.sums[level].mul_(self.decay).add_(sums, alpha=1 - self.decay)
        alive = self.counts[level] >= self.revive  # (K,)
        self.codebooks[level] = self.sums[level] / self.counts[level].clamp(min=1e-6)[:, None]
        if bool(alive.all()):  # the same in every process
            return
        # A revived code starts at the limit: it is reset again after the next batch unless vectors enough choose it
        # there. So dead codes are drawn anew in every batch until they lie where vectors are.
        fresh = self._draw_any(level, vectors)
        if fresh is None:
            return
        dead = ~alive
        self.codebooks[level][dead] = fresh[dead]
        self.sums[level][dead] = fresh[dead] * self.revive
        self.counts[level][dead] = self.revive

    def _draw_any(self, level: int, vectors: Tensor) -> Tensor | None:
        """Return K of the vectors (N, d) of the first process that has any at this level; None if none has."""
        mine = _draw(vectors, self.codes) if len(vectors) else None
        return broadcast_any(mine, self.codebooks[level])


def _draw(vectors: Tensor, count: int) -> Tensor:
    """Return `count` vectors drawn from (N, d) without replacement; if N < count, repeated with a little noise."""
    rows = len(vectors)
    if rows >= count:
        return vectors[torch.randperm(rows, device=vectors.device)[:count]].clone()
    repeated = vectors[torch.randint(rows, (count,), device=vectors.device)]
    return repeated + torch.randn_like(repeated) * (0.01 / vectors.shape[-1] ** 0.5)


def _perplexity(usage: Tensor) -> Tensor:
    """Return exp(entropy) of a histogram (K,)."""
    share = usage / usage.sum().clamp(min=1)
    return torch.exp(-(share * torch.log(share + 1e-10)).sum())
