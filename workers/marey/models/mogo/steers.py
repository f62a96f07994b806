"""Training motions whose prompt changes at any moment (ours): a captured clip, or the model's own motion
(`marey.models.mogo.rollouts`), is cut at any frame and continued by the beginning of another clip, with an
inertialized transition (`marey.data.splice`).

Splices of the prepared folder change actions at their end, as sequences do. A user who steers does not wait for that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from marey.core.errors import InvalidInput
from marey.data.prepared import PreparedData
from marey.data.splice import join_clips, seam_costs, seam_features
from marey.models.mogo.config import MOGOConfig
from marey.models.mogo.rollouts import Rollouts
from marey.models.mogo.tokenizer import Tokenizer
from marey.motion.features import HeadingLayout
from marey.training.motions import MotionData, fingerprint, made_once

FILE = "steers.safetensors"
LEAST_LEFT, MOST_LEFT, LEAST_ENTERED = 8, 110, 12
"""Frames of the clip before the cut, and of the clip after it."""
WORST_SEAM = 1.0
"""Squared metres (`seam_costs`): largest cost of a cut; limbs cannot move further in half a second."""
TRIES = 20
BATCH = 64


@dataclass(frozen=True)
class Steers:
    """S steered motions; their tokens are concatenated."""

    tokens: Tensor  # (N, V) int64
    starts: Tensor  # (S,) first token of each
    lengths: Tensor  # (S,) frames
    seams: Tensor  # (S,) frames of the clip before the cut
    left: Tensor  # (S,) that clip
    entered: Tensor  # (S,) the clip after it
    ends: Tensor  # (S,) bool: the second clip is complete


@dataclass(frozen=True)
class _Left:
    """A motion up to the cut."""

    clip: int
    joints: NDArray[np.float64]  # (n, J, 3)
    tokens: Tensor | None = None  # (n, V) of the model's own motion; captured ones are encoded with their continuation


@dataclass(frozen=True)
class _Joined:
    """A motion with its continuation after the cut."""

    features: NDArray[np.float32]
    left: _Left
    entered: int
    ends: bool

    def tokens(self, encoded: Tensor) -> Tensor:
        """Return the tokens of the whole motion as encoded, but the model's own tokens as drawn."""
        drawn = self.left.tokens
        return encoded if drawn is None else torch.cat([drawn, encoded[len(drawn) :]])


def load_steers(
    run: Path,
    config: MOGOConfig,
    tokenizer: Tokenizer,
    data: MotionData,
    clips: Sequence[int],
    weights: Sequence[float],
    rollouts: Rollouts | None = None,
) -> Steers:
    """Return the steered motions of a run: made once per tokenizer, data and clips, then read from the folder.

    Args:
        run: the run folder.
        config: their number and greatest length.
        tokenizer: in evaluation mode.
        data: the data of the clips.
        clips: (C,) clips that may be joined: single actions.
        weights: (C,) how often each is drawn.
        rollouts: source of `config.rollouts` further motions that start from the model's own; None = all start from
            captured motion.
    """
    drawn = "" if rollouts is None else f":{config.rollouts}:{rollouts.fingerprint}"
    key = f"{data.prepared.sha256}:{fingerprint(tokenizer)}:{config.steers}:{config.max_frames}{drawn}"
    made = _Making(config, data.prepared, np.asarray(clips), np.asarray(weights))
    values = made_once(
        run / FILE, key, data.features.device, lambda: vars(_encoded(tokenizer, data, list(made.joined(rollouts))))
    )  # fmt: skip
    return Steers(**{**values, "ends": values["ends"].bool()})


@torch.no_grad()
def _encoded(tokenizer: Tokenizer, data: MotionData, made: Sequence[_Joined]) -> Steers:
    device = data.features.device
    tokens: list[Tensor] = []
    for at in range(0, len(made), BATCH):
        some = made[at : at + BATCH]
        counts = torch.tensor([len(each.features) for each in some], device=device)
        features = [torch.from_numpy(each.features) for each in some]
        codes = tokenizer.encode(torch.nn.utils.rnn.pad_sequence(features, batch_first=True).to(device), counts)
        tokens += [
            each.tokens(codes[row, :count]) for row, (each, count) in enumerate(zip(some, counts.tolist(), strict=True))
        ]
    lengths = torch.tensor([len(each) for each in tokens], device=device)
    rest = [[len(each.left.joints), each.left.clip, each.entered, each.ends] for each in made]
    seams, left, entered, ends = torch.tensor(rest, device=device).unbind(1)
    return Steers(torch.cat(tokens), lengths.cumsum(0) - lengths, lengths, seams, left, entered, ends.bool())


class _Making:
    """Sampler of motions to cut and clips to continue with, which joins them."""

    def __init__(
        self, config: MOGOConfig, prepared: PreparedData, clips: NDArray[np.int64], weights: NDArray[np.float64]
    ) -> None:
        layout = prepared.layout
        if not isinstance(layout, HeadingLayout):
            raise InvalidInput(f"layout {layout.name!r} does not support joining motions", where="layout")
        self._config, self._prepared, self._layout = config, prepared, layout
        self._clips, self._shares = clips, weights / weights.sum()
        self._rng = np.random.default_rng(0)

    def joined(self, rollouts: Rollouts | None) -> Iterator[_Joined]:
        """Yield every cut motion with its continuation; motions that no clip continues are left out."""
        yield from filter(None, map(self._enter, self._captured()))
        if rollouts is not None:
            yield from filter(None, map(self._enter, self._drawn(rollouts)))

    def _captured(self) -> Iterator[_Left]:
        for clip in self._draw(self._config.steers):
            joints = self._joints(clip)
            most = min(len(joints), MOST_LEFT, self._config.max_frames - LEAST_ENTERED)
            yield _Left(clip, joints[: int(self._rng.integers(LEAST_LEFT, most + 1))])

    def _drawn(self, rollouts: Rollouts) -> Iterator[_Left]:
        for made in rollouts.draw(self._draw(self._config.rollouts), self._config.max_frames - LEAST_ENTERED):
            yield _Left(made.clip, self._layout.decode(made.features).astype(np.float64), made.tokens)

    def _enter(self, left: _Left) -> _Joined | None:
        fps, first = self._config.fps, left.joints
        for clip in self._draw(TRIES):
            second = self._joints(clip)
            costs = seam_costs(seam_features(first[-3:], fps)[-1:], seam_features(second[:3], fps)[:1])
            if clip == left.clip or float(costs[0, 0]) > WORST_SEAM:
                continue
            room = self._config.max_frames + 2 - len(first)  # poses: one more than frames, one is shared
            joints = join_clips(first, second[:room], fps)
            features = self._layout.encode(self._layout.canonicalize(joints)).astype(np.float32)
            return _Joined(features, left, clip, len(second) <= room)
        return None

    def _draw(self, count: int) -> list[int]:
        return self._rng.choice(self._clips, count, p=self._shares).tolist()

    def _joints(self, clip: int) -> NDArray[np.float64]:
        return self._prepared.joints(self._prepared.clips[clip]).astype(np.float64)
