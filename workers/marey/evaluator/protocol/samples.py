"""Pairs of caption and motion of one repeat, drawn as the public loader draws them.

From `Text2MotionDatasetEval` of momask-codes (data/t2m_dataset.py): one caption of each clip; a length that is a
multiple of four frames, in a third of the draws four frames less; a place at random. The loader shuffles, and drops
what does not fill its last batch of 32.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.data.manifest import Clip
from marey.data.prepared import PreparedData

UNIT = 4
"""Frames of a step of the T2M evaluator."""
LONGEST = 196
SHORTER = 1 / 3
"""Share of the draws that are one unit shorter."""


@dataclass(frozen=True, eq=False)
class Sample:
    """A caption and the motion that it is of."""

    caption: str
    motion: NDArray[np.float32]  # (T, D), not normalized; T a multiple of `UNIT`


def draw_samples(data: PreparedData, split: str, pool: int, rng: np.random.Generator) -> list[Sample]:
    """Draw the pairs of a repeat, in random order, a multiple of `pool`.

    Raises:
        InvalidInput: the split has fewer clips than a pool.
        NotFound: there is no such split.
    """
    clips = [clip for clip in data.split(split) if clip.captions and clip.length >= 2 * UNIT]
    if len(clips) < pool:
        raise InvalidInput(
            f"the split {split} has {len(clips)} clips with captions; a pool has {pool}", where=str(data.path)
        )
    order = rng.permutation(len(clips))[: len(clips) // pool * pool]
    return [_draw(data, clips[int(at)], rng) for at in order]


def _draw(data: PreparedData, clip: Clip, rng: np.random.Generator) -> Sample:
    caption = clip.captions[int(rng.integers(len(clip.captions)))]
    units = clip.length // UNIT - int(rng.random() < SHORTER)
    frames = min(UNIT * units, LONGEST)
    start = int(rng.integers(clip.length - frames + 1))
    return Sample(caption, np.array(data.features(clip)[start : start + frames], np.float32))
