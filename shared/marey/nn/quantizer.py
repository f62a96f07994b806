"""Residual vector quantizer with exponential-moving-average codebooks.

HGM³ eq. 1-2; averages and resets after van den Oord et al. (2017), T2M-GPT (Zhang 2023) and MoMask (Guo 2024).
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from marey.nn.distributed import all_reduce_sum, broadcast_any, is_distributed

NO_TOKEN = -1
"""Token of a level that was dropped, or of a position beyond the clip: decodes to the zero vector."""


@dataclass(frozen=True)
class Quantized:
    """Result of one pass through the quantizer."""

    output: Tensor  # (B, n, d), straight-through: its gradient is passed to the input unchanged
    tokens: Tensor  # (B, n, V) int64, NO_TOKEN where dropped or invalid
    commitment: Tensor  # scalar: sum over levels of the mean squared distance (eq. 2, without β)
    perplexity: Tensor  # (V,), exp of the entropy of each level's code usage in this batch


@dataclass(frozen=True)
class Fresh:
    """Vectors of a batch that may become codes."""

    codes: Tensor  # (K, d)
    exist: Tensor  # () bool, False where the batch has none


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
            fresh = self._draw(level, vectors, active) if self.training else None
            if fresh is not None:
                self._initialize(level, fresh)
            index = self.nearest(vectors, level)  # (B, n)
            restored = self.restored(self.codebooks[level][index], level) * active[..., None]  # (B, n, d)
            chosen = restored.detach()
            distance = (residual - chosen).square().mean(-1)  # (B, n)
            commitment = commitment + (distance * active).sum() / active.sum().clamp(min=1)
            usage = self._usage(index, active)
            perplexity.append(_perplexity(usage))
            if fresh is not None:
                self._update(level, vectors, active, index, usage, fresh)
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

    def _usage(self, index: Tensor, active: Tensor) -> Tensor:
        """Return how many of the `active` (…) vectors chose each code (K,), from the codes `index` (…) of all."""
        counts = torch.zeros(self.codes, device=index.device)
        return counts.index_add_(0, index.flatten(), active.flatten().float())

    # From here on no value of a tensor is read on the host: training steps are recorded on a GPU.

    @torch.no_grad()
    def _draw(self, level: int, vectors: Tensor, active: Tensor) -> Fresh:
        """Draw K of the `active` (…) vectors (…, d) of a batch; with several processes, those of the first that has
        any."""
        drawn, any_active = _draw(vectors.flatten(0, -2), active.flatten(), self.codes), active.any()
        if not is_distributed():
            return Fresh(drawn, any_active)
        shared = broadcast_any(drawn if bool(any_active) else None, self.codebooks[level])
        return Fresh(drawn if shared is None else shared, torch.tensor(shared is not None, device=drawn.device))

    @torch.no_grad()
    def _initialize(self, level: int, fresh: Fresh) -> None:
        """Fill a codebook with vectors of the first batch."""
        first = fresh.exist & ~self.initialized
        self.codebooks[level] = torch.where(first, fresh.codes, self.codebooks[level])
        self.sums[level] = torch.where(first, fresh.codes, self.sums[level])
        self.counts[level].masked_fill_(first, 1.0)

    @torch.no_grad()
    def _update(self, level: int, vectors: Tensor, active: Tensor, index: Tensor, usage: Tensor, fresh: Fresh) -> None:
        """Move the averages, then reset dead codes to vectors of this batch.

        Args:
            level: the codebook.
            vectors: (…, d) of this batch.
            active: (…) bool, vectors that count.
            index: (…) the code nearest to each.
            usage: (K,) active vectors of each code.
            fresh: codes in place of dead ones.
        """
        counted = (vectors * active[..., None]).flatten(0, -2)
        sums = torch.zeros_like(self.sums[level]).index_add_(0, index.flatten(), counted)
        usage = all_reduce_sum(usage.clone())
        sums = all_reduce_sum(sums)
        self.counts[level].mul_(self.decay).add_(usage, alpha=1 - self.decay)
        self.sums[level].mul_(self.decay).add_(sums, alpha=1 - self.decay)
        # A revived code starts at the limit: it is reset again after the next batch unless vectors enough choose it
        # there. So dead codes are drawn anew in every batch until they lie where vectors are.
        dead = (self.counts[level] < self.revive) & fresh.exist  # (K,), the same in every process
        moved = self.sums[level] / self.counts[level].clamp(min=1e-6)[:, None]
        self.codebooks[level] = torch.where(dead[:, None], fresh.codes, moved)
        self.sums[level] = torch.where(dead[:, None], fresh.codes * self.revive, self.sums[level])
        self.counts[level].masked_fill_(dead, self.revive)


def _draw(vectors: Tensor, active: Tensor, count: int) -> Tensor:
    """Return `count` of the `active` (N,) vectors (N, d), drawn without replacement; if they are fewer, they are
    repeated with a little noise."""
    order = torch.rand(len(active), device=active.device).masked_fill(~active, -1.0).argsort(descending=True)
    place = torch.arange(count, device=active.device)
    number = active.sum().clamp(min=1)
    chosen = vectors[order[place % number]]
    noise = torch.randn_like(chosen) * (0.01 / vectors.shape[-1] ** 0.5)
    return torch.where((place < number)[:, None], chosen, chosen + noise)


def _perplexity(usage: Tensor) -> Tensor:
    """Return exp(entropy) of a histogram (K,)."""
    share = usage / usage.sum().clamp(min=1)
    return torch.exp(-(share * torch.log(share + 1e-10)).sum())
