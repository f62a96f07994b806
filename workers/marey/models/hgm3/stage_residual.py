"""Training stages of the residual transformer (HGM³ App. A.2) and of the length estimator (after MoMask)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from marey.data.manifest import Clip
from marey.data.sampling import Draws
from marey.models.hgm3.config import HGM3Config
from marey.models.hgm3.data import CaptionData
from marey.models.hgm3.model import LengthEstimator, ResidualTransformer
from marey.nn.convolution import frame_mask
from marey.nn.losses import hits, token_losses
from marey.training.length import LengthStage
from marey.training.motions import TokenData
from marey.training.pairs import Pairs, pieces_of
from marey.training.stages import StepContext


@dataclass(frozen=True)
class ResidualSample:
    """A batch of clips with captions, and all random choices made."""

    tokens: Tensor  # (B, n, V), -1 beyond a clip's own length
    lengths: Tensor  # (B,)
    sentences: Tensor  # (B, W)
    levels: Tensor  # (B,) the level that is predicted
    dropped: Tensor  # (B,) bool: without condition

    def pieces(self, size: int | None) -> Iterator[ResidualSample]:
        """Yield the samples in `pieces_of` similar length, each cut to its longest."""
        for rows in pieces_of(self.lengths, size):
            fields = {name: getattr(self, name)[rows] for name in self.__dataclass_fields__}
            longest = int(self.lengths[rows].max())
            yield ResidualSample(**{**fields, "tokens": fields["tokens"][:, :longest]})


class ResidualStage:
    """Training stage that predicts level v + 1 from the true levels up to v; one random level per sample."""

    name = "residual"

    def __init__(
        self,
        config: HGM3Config,
        clips: Sequence[Clip],
        tokens: TokenData,
        captions: CaptionData,
        codebooks: Tensor,
    ) -> None:
        self.config = config
        self.optimisation = config.train_residual
        self.tokens, self.captions = tokens.first_phases(config.phases), captions
        self.module = ResidualTransformer(config).to(tokens.tokens.device)
        self.module.set_codebooks(codebooks)
        draws = Draws(config.class_power, config.sequences)
        self.pairs = Pairs(
            clips, self.tokens, captions, config.min_tokens, speeds=config.speeds, draws=draws, crops=config.crops
        )
        captions.standardise(self.module.normalizer, self.pairs.train.tolist(), config.condition)
        with torch.no_grad():
            self.module.bias.copy_(self.tokens.log_shares(config.tokenizer.codes, self.pairs.train)[1:])

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """Return one group."""
        return [list(self.module.parameters())]

    @property
    def recordable(self) -> bool:
        """Return True."""
        return True

    def batch(self, context: StepContext) -> ResidualSample:
        """Return a batch, padded to the longest clip."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        return self._draw(clips, context.rng, None, size=self.config.max_tokens)

    def batch_loss(self, batch: ResidualSample) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch; see `RecordableStage`."""
        return _mean_loss(*piece_losses(self.module, batch, trim=False))

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the mean cross-entropy over the tokens of the drawn levels (App. A.2, eq. 1, as a mean)."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        return _mean_loss(*self._batch(clips, context.rng, None))

    def parts(self, context: StepContext, size: int) -> Iterator[tuple[Tensor, Mapping[str, Tensor]]]:
        """Yield the losses of parts of one batch; see `SplitStage`."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        drawn = self._draw(clips, context.rng, None)
        total = drawn.lengths.sum()
        for piece in drawn.pieces(size):
            losses, right, _ = piece_losses(self.module, piece)
            yield losses.sum() / total, {"loss": losses.sum().detach() / total, "accuracy": right.sum() / total}

    def after_step(self, context: StepContext) -> None:
        """Do nothing: the stage has no state to update."""

    @torch.no_grad()
    def validate(self) -> Mapping[str, float]:
        """Return cross-entropy and accuracy on validation clips, per level."""
        rng = np.random.default_rng(0)
        result: dict[str, float] = {}
        for level in range(1, self.module.levels):
            sums = torch.zeros(3)
            for clips in self.pairs.validation_batches(self.optimisation.batch):
                sums += torch.stack([v.sum().cpu() for v in self._batch(clips, rng, level)])
            result[f"loss/{level}"] = float(sums[0] / sums[2])
            result[f"accuracy/{level}"] = float(sums[1] / sums[2])
        return result

    def _batch(
        self, clips: NDArray[np.int64], rng: np.random.Generator, level: int | None
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return summed loss, correct answers and tokens (B,) of a batch; `level` None = one drawn per sample, some of
        which lose their condition."""
        pieces = [piece_losses(self.module, piece) for piece in self._draw(clips, rng, level).pieces(None)]
        losses, right, counts = (torch.cat(parts) for parts in zip(*pieces, strict=True))
        return losses, right, counts

    def _draw(
        self, clips: NDArray[np.int64], rng: np.random.Generator, level: int | None, *, size: int | None = None
    ) -> ResidualSample:
        device = self.tokens.tokens.device
        phases = torch.from_numpy(rng.integers(self.tokens.phases, size=len(clips))).to(device)
        chosen = torch.from_numpy(clips).to(device)
        cuts = self.pairs.cuts(clips, rng, device) if level is None else None
        tokens, lengths = self.tokens.batch(chosen, phases, self.config.max_tokens, size=size, cuts=cuts)
        sentences = self.captions.sentences(self.captions.choose(clips, rng))
        drawn = rng.integers(1, self.module.levels, size=len(clips))
        levels = torch.from_numpy(drawn).to(device) if level is None else torch.full_like(lengths, level)
        drop = self.config.residual_drop if level is None else 0.0
        dropped = torch.from_numpy(rng.random(len(clips)) < drop).to(device)
        return ResidualSample(tokens, lengths, sentences, levels, dropped)


def _mean_loss(losses: Tensor, right: Tensor, counts: Tensor) -> tuple[Tensor, Mapping[str, Tensor]]:
    """Return the loss of a batch, and values to log, from sums (B,) of its samples."""
    total = counts.sum().clamp(min=1)
    loss = losses.sum() / total
    return loss, {"loss": loss.detach(), "accuracy": right.sum() / total}


def piece_losses(
    model: ResidualTransformer, sample: ResidualSample, *, trim: bool = True
) -> tuple[Tensor, Tensor, Tensor]:
    """Return summed loss, correct answers and tokens (B,) of a part of a batch; `trim` as in `SequenceModel`."""
    tokens, levels = sample.tokens, sample.levels
    valid = frame_mask(sample.lengths, tokens.shape[1])
    below = [model.embed(tokens[..., v], v) * (levels > v)[:, None, None].float() for v in range(model.levels - 1)]
    sentence = model.sentence(sample.sentences, sample.dropped)
    logits = model(torch.stack(below).sum(0), valid, levels, sentence, trim=trim)
    targets = tokens.gather(-1, levels[:, None, None].expand(-1, tokens.shape[1], 1)).squeeze(-1)
    losses = token_losses(logits, targets) * valid
    right = hits(logits.detach(), targets) * valid
    return losses.sum(1), right.sum(1), valid.sum(1).float()


def length_stage(config: HGM3Config, clips: Sequence[Clip], tokens: TokenData, captions: CaptionData) -> LengthStage:
    """Return the training stage of the length estimator."""
    pairs = Pairs(clips, tokens, captions, config.min_tokens, natural=True)
    module = LengthEstimator(config).to(tokens.tokens.device)
    captions.standardise(module.normalizer, pairs.train.tolist(), config.condition)
    return LengthStage(module, config.train_length, pairs, captions, tokens.lengths[:, 0].clamp(max=config.max_tokens))
