"""Training stage of the RQHC-Transformer: whole clips, crops, and clips whose prompt changes at a seam (ours).

Crops teach what a stream sees behind its window: the prompt far away, motion in full swing. Seams teach steering: of a
clip of several acts two that follow each other are kept, each said by its own caption, and the prompt changes where the
second begins.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from operator import add

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from workers.mogo.config import MOGOConfig
from workers.mogo.losses import LevelSums, level_sums
from workers.mogo.model import RQHCTransformer, next_targets
from workers.training.data.manifest import Clip
from workers.training.loop import StepContext
from workers.training.motions import TokenData
from workers.training.pairs import Pairs, pieces_of
from workers.training.sentences import SentenceData, text_statistics

MIN_FRAMES = 16
CROPPED, STEERED = 0.4, 0.7
"""Share of the clips that are cropped, and of the clips of several acts that are steered."""


@dataclass(frozen=True)
class Sample:
    """Sequences with their prompts; see `RQHCTransformer.forward`."""

    prompts: Tensor  # (B, 2, W)
    tokens: Tensor  # (B, n, V)
    lengths: Tensor  # (B,)
    skipped: Tensor  # (B,)
    seam: Tensor  # (B,), beyond the last frame where nothing is steered
    ends: Tensor  # (B,) bool

    def select(self, rows: Tensor) -> Sample:
        """The samples at `rows`, cut to their longest."""
        size = int(self.lengths[rows].max())
        fields = {name: getattr(self, name)[rows] for name in self.__dataclass_fields__}
        return Sample(**{**fields, "tokens": fields["tokens"][:, :size]})

    def pieces(self) -> Iterator[Sample]:
        """In `pieces_of` alike length, each padded to its own longest."""
        return map(self.select, pieces_of(self.lengths))


@dataclass(frozen=True)
class Cuts:
    """Which frames of clips are used, and where the prompt changes; all (B,) in frames of the clip."""

    first: NDArray[np.int64]
    stop: NDArray[np.int64]
    said: NDArray[np.int64]  # where the prompt was said; what comes between it and `first` is skipped
    seam: NDArray[np.int64]  # -1 = none
    act: NDArray[np.int64]  # the first of the two acts, where there is a seam


class TransformerStage:
    """All levels of all frames of a batch at once."""

    name = "transformer"

    def __init__(self, config: MOGOConfig, clips: Sequence[Clip], tokens: TokenData, captions: SentenceData) -> None:
        self.config = config
        self.optimisation = config.train_transformer
        self.clips, self.tokens, self.captions = clips, tokens, captions
        self.module = RQHCTransformer(config).to(tokens.tokens.device)
        self.pairs = Pairs(clips, tokens, captions, MIN_FRAMES)
        self.lengths = tokens.lengths[:, 0].cpu().numpy()
        spoken = captions.sentence[captions.captions_of(self.pairs.train.tolist())]
        mean, std = text_statistics(captions.strings, spoken)
        self.module.prompt.mean.copy_(mean)
        self.module.prompt.std.copy_(std)
        with torch.no_grad():  # the head starts at how often codes occur
            self.module.head.bias[: self.module.codes] = tokens.log_shares(self.module.codes).logsumexp(0)

    def clip_groups(self) -> Sequence[Sequence[nn.Parameter]]:
        """One group."""
        return [list(self.module.parameters())]

    def loss(self, context: StepContext) -> tuple[Tensor, Mapping[str, Tensor]]:
        """One batch in pieces."""
        clips = self.pairs.draw(context.rng, self.optimisation.batch)
        pieces = self.sample(clips, self.cut(clips, context.rng), context.rng).pieces()
        sums = reduce(add, [self._sums(piece, self.config.depth.share) for piece in pieces])
        loss, means = sums.loss(self.config.first_level), sums.means.detach()
        return loss, {"loss": loss.detach(), "level_0": means[0], "level_last": means[-1]}

    def after_step(self, context: StepContext) -> None:
        """Nothing."""

    @torch.no_grad()
    def validate(self) -> Mapping[str, float]:
        """Cross-entropy and accuracy of whole validation clips, per level."""
        rng = np.random.default_rng(0)
        batches = self.pairs.validation_batches(self.optimisation.batch)
        pieces = (piece for clips in batches for piece in self.sample(clips, self.whole(clips), rng).pieces())
        sums = reduce(add, [self._sums(piece, 1.0) for piece in pieces])
        found = {"loss": float(sums.loss(self.config.first_level))}
        found |= {f"loss/{level}": float(mean) for level, mean in enumerate(sums.means)}
        return found | {f"accuracy/{level}": float(share) for level, share in enumerate(sums.right / sums.asked)}

    def _sums(self, piece: Sample, share: float) -> LevelSums:
        states = self.module.states(piece.prompts, piece.tokens, skipped=piece.skipped, seam=piece.seam)
        targets = next_targets(piece.tokens, piece.lengths, self.module.end, ends=piece.ends, skipped=piece.skipped)
        return level_sums(self.module, states, targets, share)

    # -- what is cut out of clips --------------------------------------------------------------------------------------

    def whole(self, clips: NDArray[np.int64]) -> Cuts:
        """Clips from their beginning."""
        zero, none = np.zeros(len(clips), np.int64), np.full(len(clips), -1)
        stop = np.minimum(self.lengths[clips], self.config.max_frames)
        return Cuts(zero, stop, zero.copy(), none, none.copy())

    def cut(self, clips: NDArray[np.int64], rng: np.random.Generator) -> Cuts:
        """Some clips whole, some from the middle, some around a seam."""
        cuts = self.whole(clips)
        for row, (cropped, steered) in enumerate(rng.random((len(clips), 2))):
            clip = self.clips[int(clips[row])]
            length = int(self.lengths[clips[row]])
            if clip.seams and clip.act_captions and steered < STEERED:
                act = int(rng.integers(len(clip.seams)))
                edges = [0, *clip.seams, length]
                cuts.first[row], cuts.stop[row] = edges[act], edges[act + 2]
                cuts.seam[row], cuts.act[row] = edges[act + 1], act
                cuts.said[row] = edges[act] - (act > 0)  # a later act does not begin from rest: ask no first frame
            if cropped < CROPPED:
                # before a seam some frames are left, so that there is a prompt to be replaced
                last = cuts.seam[row] - 4 if cuts.seam[row] >= 0 else cuts.stop[row] - MIN_FRAMES
                if last > cuts.first[row]:
                    cuts.first[row] = rng.integers(cuts.first[row], last + 1)
        np.minimum(cuts.stop, cuts.first + self.config.max_frames, out=cuts.stop)
        return cuts

    def sample(self, clips: NDArray[np.int64], cuts: Cuts, rng: np.random.Generator) -> Sample:
        """Tokens and prompts of what was cut out."""
        device = self.tokens.tokens.device
        lengths = torch.from_numpy(cuts.stop - cuts.first).to(device)
        size = int(lengths.max())
        position = torch.arange(size, device=device)
        first = self.tokens.starts[torch.from_numpy(clips).to(device), 0] + torch.from_numpy(cuts.first).to(device)
        index = (first[:, None] + position).clamp(max=len(self.tokens.tokens) - 1)
        tokens = self.tokens.tokens[index].masked_fill(~(position[None] < lengths[:, None])[..., None], -1)
        steered = cuts.seam >= 0
        act = np.maximum(cuts.act, 0)
        chosen = self.captions.choose(clips, rng)
        where = torch.from_numpy(steered).to(device)
        before, after = (
            torch.where(where, self.captions.of_act(clips, np.where(steered, act + k, 0)), chosen) for k in range(2)
        )
        prompts = torch.stack([self.captions.sentences(before), self.captions.sentences(after)], 1)
        seam = np.where(steered, np.maximum(cuts.seam - cuts.first, 1), size + 1)
        return Sample(
            prompts,
            tokens,
            lengths,
            torch.from_numpy(cuts.first - cuts.said).to(device),
            torch.from_numpy(seam).to(device),
            torch.from_numpy(cuts.stop == self.lengths[clips]).to(device),
        )
