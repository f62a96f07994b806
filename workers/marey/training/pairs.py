"""Pairs of training clips and captions, and their sampling."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.data.manifest import Clip
from marey.data.sampling import Draws, sampling_weights
from marey.data.text_sequences import ANYWHERE
from marey.training.motions import Cuts, TokenData
from marey.training.sentences import SentenceData


class Pairs:
    """Clips that have captions and are long enough; with `natural`, without those made longer or shorter than
    captured; without `speeds`, at their captured speed alone. With `crops`, a share of the draws of actions that may
    begin and end at any frame (walks, runs, idles) is a part of the clip: captures of them are long, and prompts also
    ask for two seconds of a walk."""

    def __init__(
        self,
        clips: Sequence[Clip],
        tokens: TokenData,
        captions: SentenceData,
        min_tokens: int,
        *,
        natural: bool = False,
        speeds: bool = True,
        draws: Draws = Draws(),
        crops: float = 0.0,
    ) -> None:
        usable = (tokens.lengths[:, 0].cpu().numpy() >= min_tokens) & (captions.count > 0)
        if natural:
            usable &= [len(clip.acts) > 1 or not clip.spliced for clip in clips]
        if not speeds:
            usable &= [clip.speed == 1 for clip in clips]
        splits = np.array([c.split for c in clips])
        self.train = np.flatnonzero(usable & (splits == "train"))
        self.validation = np.flatnonzero(usable & (splits == "val"))
        self.weights = sampling_weights([clips[int(i)] for i in self.train], draws)
        self.crops, self._least = crops, min_tokens
        self._loose = np.array([len(clip.acts) == 1 and clip.content in ANYWHERE for clip in clips])

    def draw(self, rng: np.random.Generator, batch: int) -> NDArray[np.int64]:
        """Draw training clips (B,)."""
        chosen: NDArray[np.int64] = rng.choice(self.train, size=batch, p=self.weights)
        return chosen

    def cuts(self, clips: NDArray[np.int64], rng: np.random.Generator, device: torch.device) -> Cuts | None:
        """Draw which part of each clip (B,) is learned; None where all are learned whole."""
        if self.crops == 0:
            return None
        kept, place, cut = rng.random((3, len(clips)), np.float32)
        kept[~self._loose[clips] | (cut >= self.crops)] = 1.0
        return Cuts(torch.from_numpy(kept).to(device), torch.from_numpy(place).to(device), self._least)

    def validation_batches(self, batch: int) -> Iterator[NDArray[np.int64]]:
        """Return all validation clips."""
        for at in range(0, len(self.validation), batch):
            yield self.validation[at : at + batch]


def pieces_of(lengths: Tensor, size: int | None = None) -> list[Tensor]:
    """Split rows (B,) of a batch into four pieces of similar length, each padded to its own longest: less padding.

    One piece on an accelerator, where launches cost more than padding. With `size`, pieces of at most so many rows,
    which is for memory.
    """
    order = torch.argsort(lengths, stable=True)
    if size is not None:
        return list(order.split(size))
    return list(order.chunk(min(4, len(order)))) if lengths.device.type == "cpu" else [order]
