"""Training stage of the RQHC-Transformer: all levels of all frames of a batch at once."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import reduce
from operator import add

import numpy as np
import torch
from torch import Tensor, nn

from marey.core.errors import InvalidInput
from marey.data.manifest import Clip
from marey.models.mogo.config import MOGOConfig
from marey.models.mogo.level_token import build_transformer
from marey.models.mogo.losses import LevelSums, ahead_loss, level_sums
from marey.models.mogo.model import NOT_ASKED, RQHCTransformer, next_targets
from marey.models.mogo.samples import MIN_FRAMES, Samples, SequenceSample
from marey.models.mogo.steers import Steers
from marey.training.motions import TokenData
from marey.training.pairs import Pairs
from marey.training.sentences import SentenceData, text_statistics
from marey.training.stages import StepContext


class TransformerStage:
    """Training stage of the transformer; `samples` draws its batches."""

    name = "transformer"

    def __init__(
        self,
        config: MOGOConfig,
        clips: Sequence[Clip],
        tokens: TokenData,
        captions: SentenceData,
        steers: Steers | None = None,
    ) -> None:
        self.config = config
        self.optimisation = config.train_transformer
        self.module = build_transformer(config).to(tokens.tokens.device)
        self.pairs = Pairs(clips, tokens, captions, MIN_FRAMES)
        self.samples = Samples(
            clips, tokens, captions, steers, config.max_frames, split=config.split_actions, crops=config.crops
        )
        spoken = captions.sentence[captions.captions_of(self.pairs.train.tolist())]
        if config.condition.standardised:
            mean, std = text_statistics(captions.strings, spoken)
            self.module.prompt.mean.copy_(mean)
            self.module.prompt.std.copy_(std)
        actions, frames = self.samples.captioned_actions(self.pairs.train)
        self.module.pace.fit(self.module.prompt.standardised(captions.sentences(actions)), frames)
        with torch.no_grad():  # the head starts at the codes' frequencies
            shares = tokens.log_shares(self.module.codes, self.pairs.train)
            self.module.head.bias[: self.module.codes] = shares.logsumexp(0)

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """Return one group."""
        return [list(self.module.parameters())]

    @property
    def recordable(self) -> bool:
        """Return True."""
        return True

    def batch(self, context: StepContext) -> SequenceSample:
        """Return a batch, padded to the longest sample."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        return self.samples.collate(self.samples.draw(clips, context.rng), self.config.max_frames)

    def batch_loss(self, batch: SequenceSample) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch; see `RecordableStage`."""
        return self._mean_loss([self._losses(batch, self.config.depth.share)])

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of one batch, computed in pieces."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        pieces = list(self.samples.collate(self.samples.draw(clips, context.rng)).pieces())
        return self._mean_loss([self._losses(piece, self.config.depth.share) for piece in pieces])

    def _mean_loss(self, found: Sequence[tuple[LevelSums, Tensor]]) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the loss of a batch, and values to log, from the losses of its pieces."""
        sums = reduce(add, [levels for levels, _ in found])
        ahead = torch.stack([later for _, later in found]).mean()
        loss, means = sums.loss(self.config.first_level), sums.means.detach()
        shown = {"loss": loss.detach(), "level_0": means[0], "level_last": means[-1], "ahead": ahead.detach()}
        return loss + self.config.ahead_weight * ahead, shown

    def parts(self, context: StepContext, size: int) -> Iterator[tuple[Tensor, Mapping[str, Tensor]]]:
        """Yield the losses of parts of one batch; see `SplitStage`.

        Raises:
            InvalidInput: a loss whose mean is known only at the end.
        """
        config = self.config
        if config.ahead or config.depth.share < 1:
            raise InvalidInput("excludes `ahead` and `depth.share`, whose frames are drawn", where="--micro-batch")
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        pieces = list(self.samples.collate(self.samples.draw(clips, context.rng)).pieces(size))
        targets = (next_targets(p.tokens, p.lengths, self.module.end, ends=p.ends, skipped=p.skipped) for p in pieces)
        asked = torch.stack([(each != NOT_ASKED).sum((0, 2)) for each in targets]).sum(0)
        for piece in pieces:
            sums, _ = self._losses(piece, 1.0)
            part = LevelSums(sums.losses, sums.right, asked)
            loss, means = part.loss(config.first_level), part.means.detach()
            yield loss, {"loss": loss.detach(), "level_0": means[0], "level_last": means[-1]}

    def after_step(self, context: StepContext) -> None:
        """Do nothing: the stage has no state to update."""

    @torch.no_grad()
    def validate(self) -> Mapping[str, float]:
        """Return cross-entropy and accuracy on validation clips, per level; the spans are the same at every call."""
        rng = np.random.default_rng(0)
        batches = self.pairs.validation_batches(self.optimisation.batch)
        stretches = ([self.samples.of_clip(int(clip), rng) for clip in clips] for clips in batches)
        pieces = (piece for some in stretches for piece in self.samples.collate(some).pieces())
        found = [self._losses(piece, 1.0) for piece in pieces]
        sums = reduce(add, [levels for levels, _ in found])
        metrics = {"loss": float(sums.loss(self.config.first_level))}
        metrics["ahead"] = float(torch.stack([later for _, later in found]).mean())
        metrics |= {f"loss/{level}": float(mean) for level, mean in enumerate(sums.means)}
        return metrics | {f"accuracy/{level}": float(share) for level, share in enumerate(sums.right / sums.asked)}

    def _losses(self, piece: SequenceSample, share: float) -> tuple[LevelSums, Tensor]:
        return piece_losses(self.module, piece, share)


def piece_losses(model: RQHCTransformer, piece: SequenceSample, share: float) -> tuple[LevelSums, Tensor]:
    """Return the sums of the losses of samples, and the loss of `ahead`; arguments as those of `level_sums`."""
    states = model.states(piece.prompts, piece.tokens, skipped=piece.skipped, seam=piece.seam)
    targets = next_targets(piece.tokens, piece.lengths, model.end, ends=piece.ends, skipped=piece.skipped)
    ahead = ahead_loss(model, states, targets, piece.seam, share)
    return level_sums(model, states, targets, share), ahead
