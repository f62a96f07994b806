"""Training stage of the masked transformer over all scales (eq. 7, with replacing and remasking)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from marey.data.manifest import Clip
from marey.models.momaskpp.captions import WordData
from marey.models.momaskpp.config import MoMaskPPConfig
from marey.models.momaskpp.decoding import bucket_positions
from marey.models.momaskpp.model import ScaleTransformer, TextStates
from marey.models.momaskpp.scales import Scales
from marey.models.momaskpp.tokens import ScaleTokens
from marey.nn.losses import token_losses
from marey.nn.masking import cosine_schedule, easy_to_hard_mask, mask_counts
from marey.training.pairs import Pairs, pieces_of
from marey.training.stages import StepContext


@dataclass(frozen=True)
class ScaleSample:
    """Part of a batch of (clip, caption) pairs, with all random choices but those of replaced tokens made."""

    tokens: Tensor  # (B, S), NO_TOKEN where a clip has none
    positions: Tensor  # (S,) in the row of all scales
    valid: Tensor  # (B, S) bool, tokens that exist
    text: TextStates
    masked: Tensor  # (B, S) bool, tokens to predict
    dropped: Tensor  # (B,) bool: without condition


def choose_masks(scales: Scales, lengths: Tensor, progress: Tensor, noise: Tensor, *, padded: bool) -> Tensor:
    """Choose the tokens to predict, (B, N) bool: round(cos(πτ/2)·n) of the n that a clip has, all scales together.

    Args:
        scales: of the model.
        lengths: (B,) of the full scale.
        progress: τ (B,).
        noise: (B, N) uniform numbers, whose order is the choice.
        padded: as published: count and choose among all N positions, then leave out those that the clip lacks.
    """
    valid = scales.valid(lengths)
    zero = torch.zeros_like(noise)
    if padded:
        counts = (cosine_schedule(progress) * scales.size).round().long().clamp(min=1)
        return easy_to_hard_mask(zero, noise, torch.ones_like(valid), counts, 0.0) & valid
    return easy_to_hard_mask(zero, noise, valid, mask_counts(progress, valid.sum(1)), 0.0)


class ScaleStage:
    """Predicts masked tokens from the others and the words of a caption."""

    name = "masked"

    def __init__(self, config: MoMaskPPConfig, clips: Sequence[Clip], tokens: ScaleTokens, words: WordData) -> None:
        """Train on these clips, tokens and captions."""
        self.config = config
        self.optimisation = config.train_masked
        self.tokens, self.words = tokens.first_phases(config.phases), words
        self.scales = tokens.scales
        self.module = ScaleTransformer(config).to(tokens.tokens.device)
        self.pairs = Pairs(clips, self.tokens, words.sentences, config.min_tokens, speeds=config.speeds)
        mean, std = words.statistics(self.pairs.train.tolist())
        self.module.words.normalizer.mean.copy_(mean)
        self.module.words.normalizer.std.copy_(std)
        with torch.no_grad():
            self.module.codes.bias.copy_(self.tokens.log_shares(config.tokenizer.codes, self.pairs.train)[0])

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """Return one group."""
        return [list(self.module.parameters())]

    @property
    def recordable(self) -> bool:
        """Return True."""
        return True

    def batch(self, context: StepContext) -> ScaleSample:
        """Return a batch with the positions of the longest clip and the words of the longest caption."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        (sample,) = self.samples(clips, context.rng, size=len(clips), whole=True)
        return sample

    def batch_loss(self, batch: ScaleSample) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch; see `RecordableStage`."""
        return _mean_loss(*masked_losses(self.module, batch, self.shown(batch)))

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the mean cross-entropy of masked tokens."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        return _mean_loss(*self._batch(clips, context.rng))

    def parts(self, context: StepContext, size: int) -> Iterator[tuple[Tensor, Mapping[str, Tensor]]]:
        """Yield the losses of parts of one batch; see `SplitStage`."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        samples = list(self.samples(clips, context.rng, size=size))
        asked = torch.stack([sample.masked.sum() for sample in samples]).sum().clamp(min=1)
        for sample in samples:
            losses, right, _ = masked_losses(self.module, sample, self.shown(sample))
            loss = losses / asked
            yield loss, {"loss": loss.detach(), "accuracy": right / asked}

    def after_step(self, context: StepContext) -> None:
        """Do nothing: the stage has no state to update."""

    @torch.no_grad()
    def validate(self) -> Mapping[str, float]:
        """Return cross-entropy and accuracy of random masks on validation clips, all of which keep their captions."""
        rng = np.random.default_rng(0)
        totals = torch.zeros(3)
        for clips in self.pairs.validation_batches(self.optimisation.batch):
            totals += torch.stack([value.float().cpu() for value in self._batch(clips, rng, drop=False)])
        return {"loss": float(totals[0] / totals[2]), "accuracy": float(totals[1] / totals[2])}

    def samples(
        self, clips: NDArray[np.int64], rng: np.random.Generator, *,
        drop: bool = True, size: int | None = None, whole: bool = False,
    ) -> Iterator[ScaleSample]:  # fmt: skip
        """Draw phase, caption, τ, masks and drop of each clip, in pieces of similar lengths; with `drop` False, all
        keep their condition; `whole` keeps the positions and words that no clip of a piece has. `size` as in
        `pieces_of`."""
        device = self.tokens.tokens.device
        phases = torch.from_numpy(rng.integers(self.tokens.phases, size=len(clips))).to(device)
        tokens, lengths = self.tokens.rows(torch.from_numpy(clips).to(device), phases)
        captions = self.words.sentences.choose(clips, rng)
        progress = torch.from_numpy(rng.random(len(clips), np.float32)).to(device)
        noise = torch.from_numpy(rng.random(tuple(tokens.shape), np.float32)).to(device)
        dropped = torch.from_numpy(rng.random(len(clips)) < self.config.text.drop * drop).to(device)
        padded = self.config.perturbation.padded_counts
        masked = choose_masks(self.scales, lengths, progress, noise, padded=padded)
        for rows in pieces_of(lengths, size):
            longest = self.scales.longest if whole else int(lengths[rows].max())
            columns = bucket_positions(self.scales, longest).to(device)
            text = self.words.words(captions[rows], self.words.limit if whole else None)
            there = self.scales.valid(lengths[rows])[:, columns]
            own = tokens[rows][:, columns], columns, there, text, masked[rows][:, columns], dropped[rows]
            yield ScaleSample(*own)

    def shown(self, sample: ScaleSample) -> Tensor:
        """Return what the transformer sees of the tokens (B, S): masked ones as [MASK]; in training some of all are
        replaced."""
        p, codes = self.config.perturbation, self.config.tokenizer.codes
        if not self.module.training:
            return sample.tokens.masked_fill(sample.masked, self.module.mask_token)
        targets = sample.tokens.clamp(min=0)
        draw, second = torch.rand(2, *targets.shape, device=targets.device)
        foreign = torch.where(sample.masked, draw < p.replace_random, draw < p.perturb)
        hidden = sample.masked & ~foreign & (second < p.replace_mask)
        shown = torch.where(foreign, torch.randint_like(targets, codes), targets)
        return shown.masked_fill(hidden, self.module.mask_token)

    def _batch(
        self, clips: NDArray[np.int64], rng: np.random.Generator, *, drop: bool = True
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return summed loss, correct answers and masked tokens of a batch."""
        samples = self.samples(clips, rng, drop=drop)
        found = [masked_losses(self.module, sample, self.shown(sample)) for sample in samples]
        losses, right, counts = zip(*found, strict=True)
        return torch.stack(losses).sum(), torch.stack(right).sum(), torch.stack(counts).sum()


def _mean_loss(losses: Tensor, right: Tensor, count: Tensor) -> tuple[Tensor, Mapping[str, Tensor]]:
    """Return the loss of a batch, and values to log, from sums over its masked tokens."""
    loss = losses / count.clamp(min=1)
    return loss, {"loss": loss.detach(), "accuracy": right / count.clamp(min=1)}


def masked_losses(model: ScaleTransformer, sample: ScaleSample, shown: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Return summed loss, correct answers and masked tokens of a part of a batch, of which the model is `shown` the
    tokens (B, S)."""
    words = model.words(sample.text.states, sample.dropped)
    logits = model(shown, sample.positions, sample.valid, words, sample.text.present)
    losses = token_losses(logits, sample.tokens) * sample.masked
    right = (logits.argmax(-1) == sample.tokens) & sample.masked
    return losses.sum(), right.sum(), sample.masked.sum()
