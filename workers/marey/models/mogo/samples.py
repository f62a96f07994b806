"""Training samples of the RQHC-Transformer: whole actions, crops, and actions whose prompt changes (ours).

A sample has one action, or two with a seam: a prompt of several actions is drawn as one steer after another
(`marey.text.actions`), and END marks the end of an action. Crops teach the situation of a stream past its window: the
prompt is far away, and motion is in progress. Seams teach steering: between the actions of joined clips, and at any
moment (`marey.models.mogo.steers`).
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
"""Smallest number of frames before a seam, so that there is a prompt to replace."""
STEERED = 0.5
"""Share of the samples of joined clips that have two actions."""
ANYTIME = 0.35
"""Share of all samples whose prompt changes at any moment, if there are such motions."""


@dataclass(frozen=True)
class SequenceSample:
    """Sequences with their prompts; see `RQHCTransformer.forward`."""

    prompts: Tensor  # (B, 2, W)
    tokens: Tensor  # (B, n, V)
    lengths: Tensor  # (B,)
    skipped: Tensor  # (B,)
    seam: Tensor  # (B,), beyond the last frame without a steer
    ends: Tensor  # (B,) bool

    def select(self, rows: Tensor) -> SequenceSample:
        """Return the samples at `rows`, cut to their longest."""
        size = int(self.lengths[rows].max())
        fields = {name: getattr(self, name)[rows] for name in self.__dataclass_fields__}
        return SequenceSample(**{**fields, "tokens": fields["tokens"][:, :size]})

    def pieces(self, size: int | None = None) -> Iterator[SequenceSample]:
        """Yield the samples in `pieces_of` similar length, each padded to its own longest."""
        return map(self.select, pieces_of(self.lengths, size))


@dataclass(frozen=True)
class TokenSpan:
    """A range of tokens with its captions."""

    first: int  # token of its first frame
    frames: int
    skipped: int  # frames between the prompt and the first; 1 = it starts in motion
    before: int  # caption, until the seam
    after: int  # caption, from the seam on
    seam: int  # frames before it; 0 = none
    ends: bool  # its last frame is the last of an action

    def cropped(self, by: int) -> TokenSpan:
        """Return the span without its first frames."""
        return replace(
            self,
            first=self.first + by,
            frames=self.frames - by,
            skipped=self.skipped + by,
            seam=max(self.seam - by, 0),
        )

    def shortened(self, most: int) -> TokenSpan:
        """Return its first `most` frames; a seam behind them is dropped too."""
        if self.frames <= most:
            return self
        return replace(self, frames=most, seam=self.seam if self.seam <= most else 0, ends=False)


class Samples:
    """Source of spans of clips and of steered motions."""

    def __init__(
        self,
        clips: Sequence[Clip],
        tokens: TokenData,
        captions: SentenceData,
        steers: Steers | None,
        most: int,
        *,
        split: bool = True,
        crops: float = 0.0,
    ) -> None:
        """Collect the sources.

        Args:
            clips: all clips.
            tokens: tokens of the clips.
            captions: captions of the clips.
            steers: motions that are steered at any moment.
            most: frames of the longest sample.
            split: the actions of joined clips are samples of their own; else a clip is one with the whole caption.
            crops: share of the samples that begin in motion.
        """
        self.seams = [clip.seams if split else () for clip in clips]
        self.clips, self.captions, self.most, self.steers = clips, captions, most, steers
        self.crops = crops
        self.lengths = tokens.lengths[:, 0].cpu().numpy()
        self._starts = tokens.starts[:, 0].cpu().numpy()
        self._steered_from = len(tokens.tokens)
        self.tokens = tokens.tokens if steers is None else torch.cat([tokens.tokens, steers.tokens])
        columns = {} if steers is None else vars(steers)
        self._columns = {name: column.cpu().numpy() for name, column in columns.items() if name != "tokens"}

    def draw(self, clips: NDArray[np.int64], rng: np.random.Generator) -> list[TokenSpan]:
        """Draw one span per clip (B,); some are of a steered motion instead."""
        anytime = rng.random(len(clips)) < (ANYTIME if self.steers is not None else 0)
        return [
            self.anytime(rng) if other else self.of_clip(int(c), rng) for c, other in zip(clips, anytime, strict=True)
        ]

    def of_clip(self, clip: int, rng: np.random.Generator) -> TokenSpan:
        """Draw one action, or two consecutive actions, of a clip; some are cropped."""
        edges, says = self._actions(clip, rng)
        last = len(edges) - 2
        two = last > 0 and rng.random() < STEERED
        action = int(rng.integers(last if two else last + 1))
        stop = edges[action + 1 + two]
        start, seam = edges[action], edges[action + 1] - edges[action] if two else 0
        # a later action does not begin from rest: its first frame is not asked
        whole = TokenSpan(
            int(self._starts[clip]) + start, stop - start, int(action > 0), says[action], says[action + two], seam, True
        )  # fmt: skip
        return self._cut(whole, rng)

    def anytime(self, rng: np.random.Generator) -> TokenSpan:
        """Draw one of the steered motions."""
        row = int(rng.integers(len(self._columns["starts"])))
        about = {name: int(column[row]) for name, column in self._columns.items()}
        whole = TokenSpan(
            self._steered_from + about["starts"], about["lengths"], 0, self._caption(about["left"], rng),
            self._caption(about["entered"], rng), about["seams"], bool(about["ends"]),
        )  # fmt: skip
        return self._cut(whole, rng)

    def captioned_actions(self, clips: NDArray[np.int64]) -> tuple[Tensor, Tensor]:
        """Return captions (N,) of all actions of some clips, and the frames (N,) of each action."""
        said: list[tuple[int, int]] = []
        for clip in clips.tolist():
            first, count = int(self.captions.first[clip]), int(self.captions.authors[clip].sum())
            edges = [0, *self.seams[clip], int(self.lengths[clip])]
            actions = np.diff(edges).tolist()
            if len(actions) > 1:
                said += [(first + count + action, frames) for action, frames in enumerate(actions)]
            else:
                said += [(first + k, actions[0]) for k in range(count)]
        captions, frames = torch.tensor(said, device=self.tokens.device).unbind(1)
        return captions, frames

    def collate(self, stretches: Sequence[TokenSpan], size: int | None = None) -> SequenceSample:
        """Collect tokens and prompts of spans, padded to `size` frames or to the longest of them."""
        device = self.tokens.device
        columns = np.array([(s.first, s.frames, s.skipped, s.before, s.after, s.seam) for s in stretches])
        first, lengths, skipped, before, after, seam = torch.from_numpy(columns).to(device).unbind(1)
        size = int(columns[:, 1].max()) if size is None else size
        position = torch.arange(size, device=device)
        index = (first[:, None] + position).clamp(max=len(self.tokens) - 1)
        tokens = self.tokens[index].masked_fill(~(position < lengths[:, None])[..., None], -1)
        prompts = torch.stack([self.captions.sentences(before), self.captions.sentences(after)], 1)
        seam = torch.where(seam > 0, seam, size + 1)
        ends = torch.tensor([s.ends for s in stretches], device=device)
        return SequenceSample(prompts, tokens, lengths, skipped, seam, ends)

    def _actions(self, clip: int, rng: np.random.Generator) -> tuple[list[int], list[int]]:
        """Return the edges of a clip's actions, and a caption of each."""
        seams, length = self.seams[clip], int(self.lengths[clip])
        if not seams:
            return [0, length], [self._caption(clip, rng)]
        own = int(self.captions.first[clip] + self.captions.authors[clip].sum())
        return [0, *seams, length], [own + action for action in range(len(seams) + 1)]

    def _caption(self, clip: int, rng: np.random.Generator) -> int:
        authors = self.captions.authors[clip]
        author = rng.integers(np.count_nonzero(authors))
        return int(self.captions.first[clip] + authors[:author].sum() + rng.integers(authors[author]))

    def _cut(self, whole: TokenSpan, rng: np.random.Generator) -> TokenSpan:
        """Crop some spans, and cut all to the longest length."""
        if rng.random() < self.crops:
            last = whole.seam - BEFORE_SEAM if whole.seam else whole.frames - MIN_FRAMES
            if last > 0:
                whole = whole.cropped(int(rng.integers(1, last + 1)))
        return whole.shortened(self.most)
