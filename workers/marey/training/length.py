"""Training stage of a length estimator (after MoMask), the same for every model that has one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from marey.training.optimisation import StageConfig
from marey.training.pairs import Pairs
from marey.training.sentences import SentenceData
from marey.training.stages import StepContext


class LengthStage:
    """Training stage of the length: number of tokens from the sentence, on clips of natural length. Looped and held
    clips have drawn lengths, and a hand that stays up for long looks like a wave.
    """

    name = "length"

    def __init__(
        self, module: nn.Module, optimisation: StageConfig, pairs: Pairs, sentences: SentenceData, lengths: Tensor
    ) -> None:
        """Train a network of sentence features (B, W) to logits (B, n_max), class k means k + 1 tokens.

        Args:
            module: the network, with its statistics, on the device of the data.
            optimisation: of the stage.
            pairs: of clips of natural length.
            sentences: of their captions.
            lengths: (C,) tokens of every clip, at most n_max.
        """
        self.module = module
        self.optimisation = optimisation
        self.pairs = pairs
        self.sentences = sentences
        self.lengths = lengths

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """Return one group."""
        return [list(self.module.parameters())]

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the cross-entropy of the length class."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        loss, error = self._batch(clips, context.rng)
        return loss, {"loss": loss.detach(), "error_tokens": error}

    def after_step(self, context: StepContext) -> None:
        """Do nothing: the stage has no state to update."""

    @torch.no_grad()
    def validate(self) -> Mapping[str, float]:
        """Return cross-entropy and mean absolute error of the expected length, in tokens."""
        rng = np.random.default_rng(0)
        found = [self._batch(clips, rng) for clips in self.pairs.validation_batches(self.optimisation.batch)]
        return {
            "loss": float(np.mean([float(loss) for loss, _ in found])),
            "error_tokens": float(np.mean([float(error) for _, error in found])),
        }

    def _batch(self, clips: NDArray[np.int64], rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        lengths = self.lengths[torch.from_numpy(clips).to(self.lengths.device)]
        logits = self.module(self.sentences.sentences(self.sentences.choose(clips, rng))).float()
        expected = (torch.softmax(logits, -1) * torch.arange(1, logits.shape[1] + 1, device=logits.device)).sum(-1)
        return F.cross_entropy(logits, lengths - 1), (expected - lengths).abs().mean().detach()
