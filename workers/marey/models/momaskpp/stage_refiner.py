"""Training stages of the root refiner, and of the length estimator (after MoMask)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import torch
import torch.nn.functional as F
from numpy.typing import NDArray
from torch import Tensor, nn

from marey.data.manifest import Clip
from marey.data.sampling import sampling_weights
from marey.models.momaskpp.captions import WordData
from marey.models.momaskpp.config import MoMaskPPConfig
from marey.models.momaskpp.model import ROOT_VELOCITY, LengthHead, RootRefiner, inputs_of
from marey.models.momaskpp.tokens import ScaleTokens
from marey.nn.motion_tokenizer import biased_std
from marey.training.length import LengthStage
from marey.training.motions import MotionData
from marey.training.pairs import Pairs
from marey.training.stages import StepContext


class RefinerStage:
    """Predicts the root's velocity of captured windows from noisy versions of everything else.

    The published trainer cannot run as it stands; this is what it says it does.
    """

    name = "refiner"

    def __init__(self, config: MoMaskPPConfig, data: MotionData) -> None:
        """Train on windows of the training clips that are long enough."""
        self.config = config
        self.optimisation = config.train_refiner
        self.data = data
        self.module = RootRefiner(config).to(data.features.device)
        self.std = biased_std(data.std, config.tokenizer.feature_bias)
        window = config.refiner.window
        self.clips = {split: [c for c in data.originals(split) if c.length >= window] for split in ("train", "val")}
        self.weights = sampling_weights(self.clips["train"])

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """Return one group."""
        return [list(self.module.parameters())]

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """Return the smooth L1 of the normalised velocity."""
        rng, clips = context.rng, self.clips["train"]
        chosen = [clips[i] for i in rng.choice(len(clips), size=self.optimisation.batch, p=self.weights)]
        slack = np.array([c.length - self.config.refiner.window for c in chosen])
        offsets = np.floor(rng.random(len(chosen)) * (slack + 1)).astype(np.int64)
        loss = self._error(np.array([c.start for c in chosen]) + offsets, float(rng.random()))
        return loss, {"loss": loss.detach()}

    def after_step(self, context: StepContext) -> None:
        """Do nothing: the stage has no state to update."""

    @torch.no_grad()
    def validate(self) -> Mapping[str, float]:
        """Return the loss on the first windows of validation clips, without noise."""
        clips = self.clips["val"]
        return {"loss": float(self._error(np.array([c.start for c in clips]), 0.0))} if clips else {}

    def _error(self, starts: NDArray[np.int64], share: float) -> Tensor:
        at = torch.from_numpy(starts).to(self.data.features.device)
        features = (self.data.windows(at, self.config.refiner.window) - self.data.mean) / self.std
        inputs = features[..., inputs_of(self.config)]
        noisy = inputs + torch.randn_like(inputs) * (share * self.config.refiner.noise)
        return F.smooth_l1_loss(self.module(noisy).float(), features[..., ROOT_VELOCITY])


def length_stage(config: MoMaskPPConfig, clips: Sequence[Clip], tokens: ScaleTokens, words: WordData) -> LengthStage:
    """Return the training stage of the length estimator."""
    pairs = Pairs(clips, tokens, words.sentences, config.min_tokens, natural=True)
    module = LengthHead(config).to(tokens.tokens.device)
    mean, std = words.sentence_statistics(pairs.train.tolist())
    module.normalizer.mean.copy_(mean)
    module.normalizer.std.copy_(std)
    return LengthStage(module, config.train_length, pairs, words.sentences, tokens.lengths[:, 0])
