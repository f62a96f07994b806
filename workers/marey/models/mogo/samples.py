"""What the RQHC-Transformer is trained on: acts from beginning to end, crops, and acts whose prompt changes (ours).

A sample has one act, or two with a seam: a prompt of several acts is drawn as one steer after another
(`marey.text.actions`), and END says that an act is done. Crops teach what a stream sees behind its window: the prompt
far away, motion in full swing. Seams teach steering: between the acts of joined clips, and at any moment
(`marey.models.mogo.steers`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.data.manifest import Clip
from marey.models.mogo.steers import Steers
from marey.training.motions import TokenData
from marey.training.pairs import pieces_of
from marey.training.sentences import SentenceData

MIN_FRAMES = 16
BEFORE_SEAM = 4
"""Frames left before a seam, so that there is a prompt to be replaced."""
CROPPED = 0.4
"""Share of the samples that are cropped."""
STEERED = 0.5
"""Share of the samples of joined clips that have two acts."""
ANYTIME = 0.35
"""Share of all samples whose prompt changes at any moment, where there are such motions."""


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
class Stretch:
    """Tokens that belong together, and what is said of them."""

    first: int  # token of its first frame
    frames: int
    skipped: int  # frames between the prompt and the first; 1 = it does not begin from rest
    before: int  # caption, until the seam
    after: int  # caption, from the seam on
    seam: int  # frames before it; 0 = none
    ends: bool  # its last frame is the last of an act

    def cropped(self, by: int) -> Stretch:
        """Without its first frames."""
        return replace(
            self,
            first=self.first + by,
            frames=self.frames - by,
            skipped=self.skipped + by,
            seam=max(self.seam - by, 0),
        )

    def shortened(self, most: int) -> Stretch:
        """Its first `most` frames; a seam behind them is left out too."""
        if self.frames <= most:
            return self
        return replace(self, frames=most, seam=self.seam if self.seam <= most else 0, ends=False)


class Samples:
    """Draws stretches of clips and of steered motions."""

    def __init__(
        self, clips: Sequence[Clip], tokens: TokenData, captions: SentenceData, steers: Steers | None, most: int
    ) -> None:
        """Put together what is drawn from.

        Args:
            clips: all of them.
            tokens: theirs.
            captions: theirs.
            steers: motions that are steered at any moment.
            most: frames of the longest sample.
        """
        self.clips, self.captions, self.most, self.steers = clips, captions, most, steers
        self.lengths = tokens.lengths[:, 0].cpu().numpy()
        self._starts = tokens.starts[:, 0].cpu().numpy()
        self._steered_from = len(tokens.tokens)
        self.tokens = tokens.tokens if steers is None else torch.cat([tokens.tokens, steers.tokens])
        columns = {} if steers is None else vars(steers)
        self._columns = {name: column.cpu().numpy() for name, column in columns.items() if name != "tokens"}

    def draw(self, clips: NDArray[np.int64], rng: np.random.Generator) -> list[Stretch]:
        """A stretch a clip (B,); some are of any steered motion instead."""
        anytime = rng.random(len(clips)) < (ANYTIME if self.steers is not None else 0)
        return [
            self.anytime(rng) if other else self.of_clip(int(c), rng) for c, other in zip(clips, anytime, strict=True)
        ]

    def of_clip(self, clip: int, rng: np.random.Generator) -> Stretch:
        """An act, or two acts that follow each other, perhaps from the middle."""
        edges, says = self._acts(clip, rng)
        last = len(edges) - 2
        two = last > 0 and rng.random() < STEERED
        act = int(rng.integers(last if two else last + 1))
        stop = edges[act + 1 + two]
        start, seam = edges[act], edges[act + 1] - edges[act] if two else 0
        # a later act does not begin from rest: its first frame is not asked
        whole = Stretch(
            int(self._starts[clip]) + start, stop - start, int(act > 0), says[act], says[act + two], seam, True
        )  # fmt: skip
        return self._cut(whole, rng)

    def anytime(self, rng: np.random.Generator) -> Stretch:
        """One of the steered motions."""
        row = int(rng.integers(len(self._columns["starts"])))
        about = {name: int(column[row]) for name, column in self._columns.items()}
        whole = Stretch(
            self._steered_from + about["starts"], about["lengths"], 0, self._caption(about["left"], rng),
            self._caption(about["entered"], rng), about["seams"], bool(about["ends"]),
        )  # fmt: skip
        return self._cut(whole, rng)

    def acts_said(self, clips: NDArray[np.int64]) -> tuple[Tensor, Tensor]:
        """Captions (N,) of all acts of some clips, and the frames (N,) of each act."""
        said: list[tuple[int, int]] = []
        for clip in clips.tolist():
            first, count = int(self.captions.first[clip]), int(self.captions.count[clip])
            edges = [0, *self.clips[clip].seams, int(self.lengths[clip])]
            acts = np.diff(edges).tolist()
            if len(acts) > 1:
                said += [(first + count + act, frames) for act, frames in enumerate(acts)]
            else:
                said += [(first + k, acts[0]) for k in range(count)]
        captions, frames = torch.tensor(said, device=self.tokens.device).unbind(1)
        return captions, frames

    def collate(self, stretches: Sequence[Stretch]) -> Sample:
        """Tokens and prompts of stretches."""
        device = self.tokens.device
        columns = np.array([(s.first, s.frames, s.skipped, s.before, s.after, s.seam) for s in stretches])
        first, lengths, skipped, before, after, seam = torch.from_numpy(columns).to(device).unbind(1)
        size = int(lengths.max())
        position = torch.arange(size, device=device)
        index = (first[:, None] + position).clamp(max=len(self.tokens) - 1)
        tokens = self.tokens[index].masked_fill(~(position < lengths[:, None])[..., None], -1)
        prompts = torch.stack([self.captions.sentences(before), self.captions.sentences(after)], 1)
        seam = torch.where(seam > 0, seam, size + 1)
        ends = torch.tensor([s.ends for s in stretches], device=device)
        return Sample(prompts, tokens, lengths, skipped, seam, ends)

    def _acts(self, clip: int, rng: np.random.Generator) -> tuple[list[int], list[int]]:
        """Where the acts of a clip begin and end, and a caption of each."""
        about, length = self.clips[clip], int(self.lengths[clip])
        if not about.seams:
            return [0, length], [self._caption(clip, rng)]
        own = int(self.captions.first[clip] + self.captions.count[clip])
        return [0, *about.seams, length], [own + act for act in range(len(about.seams) + 1)]

    def _caption(self, clip: int, rng: np.random.Generator) -> int:
        return int(self.captions.first[clip] + rng.integers(self.captions.count[clip]))

    def _cut(self, whole: Stretch, rng: np.random.Generator) -> Stretch:
        """Perhaps from the middle on, and no longer than the longest."""
        if rng.random() < CROPPED:
            last = whole.seam - BEFORE_SEAM if whole.seam else whole.frames - MIN_FRAMES
            if last > 0:
                whole = whole.cropped(int(rng.integers(1, last + 1)))
        return whole.shortened(self.most)
