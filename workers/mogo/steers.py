"""Motion whose prompt changes at any moment, for training (ours): a captured clip is left wherever it is, and another
one is entered at its beginning, with an inertialized transition (`workers.training.data.splice`).

Splices of the prepared folder leave an act when it is done, as sequences do. Who steers does not wait for that.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from shared.errors import InvalidInput
from shared.motion.features import HeadingLayout
from workers.mogo.config import MOGOConfig
from workers.mogo.tokenizer import Tokenizer
from workers.training.data.prepared import PreparedData
from workers.training.data.splice import join_clips, seam_costs, seam_features
from workers.training.motions import MotionData, fingerprint, made_once

FILE = "steers.safetensors"
LEAST_LEFT, MOST_LEFT, LEAST_ENTERED = 8, 110, 12
"""Frames of the clip that is left, and of the one that is entered."""
WORST_SEAM = 1.0
"""Squared metres (`seam_costs`): nobody's limbs fly through the room in half a second."""
TRIES = 20
BATCH = 64


@dataclass(frozen=True)
class Steers:
    """S steered motions, their tokens end to end."""

    tokens: Tensor  # (N, V) int64
    starts: Tensor  # (S,) first token of each
    lengths: Tensor  # (S,) frames
    seams: Tensor  # (S,) frames of the clip that is left
    left: Tensor  # (S,) that clip
    entered: Tensor  # (S,) the other
    ends: Tensor  # (S,) bool: the other is there to its end


def load_steers(
    run: Path,
    config: MOGOConfig,
    tokenizer: Tokenizer,
    data: MotionData,
    clips: Sequence[int],
    weights: Sequence[float],
) -> Steers:
    """The steered motions of a run: made once for a tokenizer, its data and these clips, then read from the folder.

    Args:
        run: the run folder.
        config: says how many, and how long at most.
        tokenizer: in evaluation mode.
        data: what the clips are of.
        clips: (C,) those that may be joined: single acts.
        weights: (C,) how often each is drawn.
    """
    key = f"{data.sha256}:{fingerprint(tokenizer)}:{config.steers}:{config.max_frames}"
    chosen, often = np.asarray(clips), np.asarray(weights)
    values = made_once(
        run / FILE, key, data.features.device, lambda: vars(_make(config, tokenizer, data, chosen, often))
    )  # fmt: skip
    return Steers(**{**values, "ends": values["ends"].bool()})


@torch.no_grad()
def _make(
    config: MOGOConfig, tokenizer: Tokenizer, data: MotionData, clips: NDArray[np.int64], weights: NDArray[np.float64]
) -> Steers:
    made = list(_joined(data.prepared, config, clips, weights))
    device = data.features.device
    tokens: list[Tensor] = []
    for at in range(0, len(made), BATCH):
        features = [torch.from_numpy(features) for features, *_ in made[at : at + BATCH]]
        counts = torch.tensor([len(each) for each in features], device=device)
        padded = torch.nn.utils.rnn.pad_sequence(features, batch_first=True).to(device)
        codes = tokenizer.encode(padded, counts)
        tokens += [codes[row, :count] for row, count in enumerate(counts.tolist())]
    lengths = torch.tensor([len(each) for each in tokens], device=device)
    rest = torch.tensor([[seam, left, entered, ends] for _, seam, left, entered, ends in made], device=device)
    seams, left, entered, ends = rest.unbind(1)
    return Steers(torch.cat(tokens), lengths.cumsum(0) - lengths, lengths, seams, left, entered, ends.bool())


def _joined(
    prepared: PreparedData, config: MOGOConfig, clips: NDArray[np.int64], weights: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.float32], int, int, int, bool]]:
    """Features, seam, clip left, clip entered, and whether that one is whole; `config.steers` of them."""
    rng = np.random.default_rng(0)
    layout = prepared.layout
    if not isinstance(layout, HeadingLayout):
        raise InvalidInput(f"motions of layout {layout.name!r} cannot be joined", where="layout")
    for _ in range(config.steers):
        for _ in range(TRIES):
            left, entered = (int(c) for c in rng.choice(clips, 2, p=weights / weights.sum()))
            first, second = (prepared.joints(prepared.clips[c]).astype(np.float64) for c in (left, entered))
            most = min(len(first), MOST_LEFT, config.max_frames - LEAST_ENTERED)
            first = first[: int(rng.integers(LEAST_LEFT, most + 1))]
            costs = seam_costs(seam_features(first[-3:], config.fps)[-1:], seam_features(second[:3], config.fps)[:1])
            if float(costs[0, 0]) > WORST_SEAM:
                continue
            room = config.max_frames + 2 - len(first)  # poses: one more than frames, one is shared
            joints = join_clips(first, second[:room], config.fps)
            features = layout.encode(layout.canonicalize(joints)).astype(np.float32)
            yield features, len(first), left, entered, len(second) <= room
            break
