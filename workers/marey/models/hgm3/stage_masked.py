"""Training stage of the masked transformer F_θ and the loss predictor G_φ: hard token mining (HGM³ Sec. 3.2-3.3)."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from marey.data.manifest import Clip
from marey.data.sampling import Draws
from marey.models.hgm3.conditions import LEVELS, GraphBatch
from marey.models.hgm3.config import HGM3Config
from marey.models.hgm3.data import CaptionData
from marey.models.hgm3.model import LossPredictor, MaskedTransformer
from marey.nn.convolution import frame_mask
from marey.nn.ema import update_average, warm_momentum
from marey.nn.losses import hits, ranking_loss, token_losses
from marey.nn.masking import easy_to_hard_mask, mask_counts
from marey.training.motions import TokenData
from marey.training.pairs import Pairs, pieces_of
from marey.training.stages import StepContext

CONDITIONS = ("motion", "action", "specific")
"""Names of the levels of condition, each with those before it."""
EVEN = (1 / LEVELS,) * LEVELS
"""Probability of each level, where one is drawn per sample."""


@dataclass(frozen=True)
class MaskedSample:
    """Part of a batch of (clip, caption) pairs, with all random choices made."""

    tokens: Tensor  # (B, n) base tokens, -1 beyond a clip's own length
    lengths: Tensor  # (B,)
    graphs: GraphBatch
    progress: Tensor  # τ (B,)
    noise: Tensor  # (B, n)
    dropped: Tensor  # (B,) bool: without condition, at every level and for G
    level: Tensor  # (B,) condition level

    def select(self, rows: Tensor) -> MaskedSample:
        """Return the samples at `rows`, cut to their longest."""
        size = int(self.lengths[rows].max())
        return MaskedSample(
            self.tokens[rows, :size],
            self.lengths[rows],
            self.graphs.select(rows),
            self.progress[rows],
            self.noise[rows, :size],
            self.dropped[rows],
            self.level[rows],
        )

    def at_level(self, level: int) -> MaskedSample:
        """Return the same samples, noise and τ under another condition."""
        return replace(self, level=torch.full_like(self.level, level))


class MaskedModule(nn.Module):
    """Student F and G, and the teacher of G (eq. 6)."""

    def __init__(self, config: HGM3Config) -> None:
        super().__init__()
        self.masked = MaskedTransformer(config)
        self.predictor = LossPredictor(config)
        self.teacher = copy.deepcopy(self.predictor).requires_grad_(False)


class MaskedObjective:
    """Losses of F and G on samples."""

    def __init__(self, config: HGM3Config, module: MaskedModule) -> None:
        self.config, self.module = config, module

    def masks(self, sample: MaskedSample, nodes: Tensor, alpha: float) -> Tensor:
        """Return the tokens to mask (B, n): the hardest by the teacher, which sees the unmasked tokens; the rest at
        random."""
        valid = frame_mask(sample.lengths, sample.tokens.shape[1])
        counts = mask_counts(sample.progress, sample.lengths)
        if alpha == 0:
            return easy_to_hard_mask(torch.zeros_like(sample.noise), sample.noise, valid, counts, 0.0)
        teacher = self.module.teacher.eval()
        with torch.no_grad():
            difficulty = self._predict(teacher, sample, nodes, valid)
        return easy_to_hard_mask(difficulty, sample.noise, valid, counts, alpha)

    def piece(self, sample: MaskedSample, alpha: float, *, trim: bool = True) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Return ℓ (B, n), mask (B, n), correct predictions (B, n), ranking loss (B,); `trim` as in
        `SequenceModel`."""
        model = self.module.masked
        valid = frame_mask(sample.lengths, sample.tokens.shape[1])
        nodes = model.text(sample.graphs)  # C, (B, S, W)
        masked = self.masks(sample, nodes.detach(), alpha)
        targets = sample.tokens.clamp(min=0)
        condition = model.condition(nodes, sample.dropped)
        visible = model.condition.visible(sample.graphs.present, sample.level, sample.dropped)
        logits = model(self._shown(targets, masked), valid, condition, visible, masked, trim=trim)
        losses = token_losses(logits, targets)
        return losses, masked, hits(logits.detach(), targets), self._ranking(sample, nodes.detach(), losses, masked)

    def _ranking(self, sample: MaskedSample, nodes: Tensor, losses: Tensor, masked: Tensor) -> Tensor:
        """Return G's loss (B,): zero with random masks, which do not ask it; it took a third of a step."""
        if self.config.mining.mask == "random":
            return losses.new_zeros(len(losses))
        valid = frame_mask(sample.lengths, sample.tokens.shape[1])
        return ranking_loss(self._predict(self.module.predictor, sample, nodes, valid), losses, masked)

    def _predict(self, predictor: LossPredictor, sample: MaskedSample, nodes: Tensor, valid: Tensor) -> Tensor:
        condition = predictor.condition(nodes, sample.dropped)
        visible = predictor.condition.visible(sample.graphs.present, sample.level, sample.dropped)
        return predictor(sample.tokens.clamp(min=0), valid, condition, visible)

    def _shown(self, targets: Tensor, masked: Tensor) -> Tensor:
        """Replace masked tokens by [MASK] (eq. 3), or sometimes by another token (MoMask)."""
        mining, codes = self.config.mining, self.config.tokenizer.codes
        shown = targets.masked_fill(masked, self.module.masked.mask_token)
        if mining.replace_random == 0 and mining.replace_mask == 1:
            return shown
        draw = torch.rand_like(targets, dtype=torch.float32)
        foreign = masked & (draw < mining.replace_random)
        rest = masked & ~foreign & (torch.rand_like(draw) >= mining.replace_mask)
        shown = torch.where(foreign, torch.randint_like(targets, codes), shown)
        return torch.where(rest, targets, shown)


class MaskedStage(MaskedObjective):
    """Training stage of F and G."""

    name = "masked"

    def __init__(self, config: HGM3Config, clips: Sequence[Clip], tokens: TokenData, captions: CaptionData) -> None:
        super().__init__(config, MaskedModule(config).to(tokens.tokens.device))
        self.optimisation = config.train_masked
        self.tokens, self.captions = tokens.first_phases(config.phases), captions
        draws = Draws(config.class_power, config.sequences)
        self.pairs = Pairs(
            clips, self.tokens, captions, config.min_tokens, speeds=config.speeds, draws=draws, crops=config.crops
        )
        captions.standardise(self.module.masked.text.normalizer, self.pairs.train.tolist(), config.condition)
        with torch.no_grad():
            self.module.masked.head.bias.copy_(self.tokens.log_shares(config.tokenizer.codes, self.pairs.train)[0])

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """Return F (with the graph) and G as separate groups."""
        return [list(self.module.masked.parameters()), list(self.module.predictor.parameters())]

    @property
    def recordable(self) -> bool:
        """Return whether masks are random: the share of hard ones changes with every step."""
        return self.config.mining.mask == "random"

    def batch(self, context: StepContext) -> tuple[MaskedSample, ...]:
        """Return a batch under each condition of a step, padded to the longest clip."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        return tuple(self._conditioned(self.sample(clips, context.rng, size=self.config.max_tokens)))

    def batch_loss(self, batch: tuple[MaskedSample, ...]) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch; see `RecordableStage`."""
        return self._mean_loss([self.piece(sample, 0.0, trim=False) for sample in batch])

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return L_rec + L_pred (eq. 7, 12, 13), averaged over levels."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        sample = self.sample(clips, context.rng)
        alpha = self._alpha(context)
        pieces = [self.piece(piece, alpha) for s in self._conditioned(sample) for piece in _pieces(s)]
        loss, logs = self._mean_loss(pieces)
        return loss, {**logs, "alpha": torch.tensor(alpha)}

    @staticmethod
    def _mean_loss(pieces: Sequence[tuple[Tensor, Tensor, Tensor, Tensor]]) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch, and values to log, from what `piece` gave for its parts."""
        counted = torch.stack([masked.sum() for _, masked, _, _ in pieces]).sum().clamp(min=1)
        rec = torch.stack([(losses * masked).sum() for losses, masked, _, _ in pieces]).sum() / counted
        pred = torch.cat([ranking for *_, ranking in pieces]).mean()
        correct = torch.stack([(right * masked).sum() for _, masked, right, _ in pieces]).sum()
        logs = {
            "loss": (rec + pred).detach(),
            "reconstruction": rec.detach(),
            "ranking": pred.detach(),
            "accuracy": correct / counted,
        }
        return rec + pred, logs

    def parts(self, context: StepContext, size: int) -> Iterator[tuple[Tensor, Mapping[str, Tensor]]]:
        """Yield the losses of parts of one batch; see `SplitStage`."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        sample = self.sample(clips, context.rng)
        alpha = self._alpha(context)
        samples = self._conditioned(sample)
        asked = len(samples) * mask_counts(sample.progress, sample.lengths).sum()
        for piece in (p for s in samples for p in _pieces(s, size)):
            losses, masked, right, ranking = self.piece(piece, alpha)
            rec = (losses * masked).sum() / asked
            pred = ranking.sum() / (self.optimisation.batch * len(samples))
            accuracy = (right * masked).sum() / asked
            logs = {"loss": rec + pred, "reconstruction": rec, "ranking": pred, "accuracy": accuracy}
            yield rec + pred, {name: value.detach() for name, value in logs.items()}

    def _alpha(self, context: StepContext) -> float:
        """Return the share of hard tokens among the masked ones (eq. 8)."""
        mining = self.config.mining
        if mining.mask != "hard":
            return 0.0
        return mining.alpha_start + context.fraction * (mining.alpha_end - mining.alpha_start)

    def _conditioned(self, sample: MaskedSample) -> list[MaskedSample]:
        """Return the samples under each condition of a step: all, the drawn ones, or the one that is trained."""
        mining = self.config.mining
        if mining.conditions != "all":
            return [sample.at_level(CONDITIONS.index(mining.conditions))]
        return [sample] if mining.levels_per_step == 1 else [sample.at_level(level) for level in range(LEVELS)]

    def after_step(self, context: StepContext) -> None:
        """Update the teacher as the student's moving average (eq. 6); with random masks neither is trained."""
        if self.config.mining.mask == "random":
            return
        momentum = warm_momentum(self.config.mining.momentum, context.step)
        update_average(self.module.teacher, self.module.predictor, momentum)

    def sample(
        self, clips: NDArray[np.int64], rng: np.random.Generator, *, drop: bool = True, size: int | None = None
    ) -> MaskedSample:
        """Draw phase, part, caption, τ, noise, drop and level for each clip; with `drop` False, all are whole and keep
        their condition. The sequences are padded to `size` tokens, or to the longest of them."""
        device = self.tokens.tokens.device
        phases = torch.from_numpy(rng.integers(self.tokens.phases, size=len(clips))).to(device)
        chosen = torch.from_numpy(clips).to(device)
        cuts = self.pairs.cuts(clips, rng, device) if drop else None
        tokens, lengths = self.tokens.batch(chosen, phases, self.config.max_tokens, size=size, cuts=cuts)
        captions = self.captions.choose(clips, rng)
        return MaskedSample(
            tokens[..., 0],
            lengths,
            self.captions.graphs(captions),
            torch.from_numpy(rng.random(len(clips), np.float32)).to(device),
            torch.from_numpy(rng.random(tokens.shape[:2], np.float32)).to(device),
            torch.from_numpy(rng.random(len(clips)) < self.config.condition.drop * drop).to(device),
            torch.from_numpy(rng.choice(LEVELS, size=len(clips), p=EVEN)).to(device),
        )

    @torch.no_grad()
    def validate(self) -> Mapping[str, float]:
        """Return cross-entropy and accuracy of random masks on validation clips, per level of condition."""
        rng = np.random.default_rng(0)
        totals = np.zeros((LEVELS, 3))
        ranks = 0.0
        for clips in self.pairs.validation_batches(self.optimisation.batch):
            sample = self.sample(clips, rng, drop=False)
            for level in range(LEVELS):
                for piece in _pieces(sample.at_level(level)):
                    losses, masked, right, ranking = self.piece(piece, 0.0)
                    totals[level] += [
                        float((losses * masked).sum()),
                        float((right * masked).sum()),
                        float(masked.sum()),
                    ]
                    ranks += float(ranking.sum()) / (LEVELS * len(self.pairs.validation))
        loss = {f"reconstruction/{n}": float(t[0] / t[2]) for n, t in zip(CONDITIONS, totals, strict=True)}
        accuracy = {f"accuracy/{n}": float(t[1] / t[2]) for n, t in zip(CONDITIONS, totals, strict=True)}
        return loss | accuracy | {"ranking": ranks}


def _pieces(sample: MaskedSample, size: int | None = None) -> Iterator[MaskedSample]:
    for rows in pieces_of(sample.lengths, size):
        yield sample.select(rows)
