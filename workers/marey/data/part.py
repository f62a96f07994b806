"""A captured clip, or its mirror image, ready to be encoded or spliced."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.data.describe import Facts
from marey.data.pack import PackClip

FPS = 20.0
MAX_FRAMES = 196  # feature frames; HumanML3D's limit
MIN_FRAMES = 20


@dataclass(frozen=True, eq=False)
class Part:
    """A captured or mirrored clip of at most MAX_FRAMES + 1 poses.

    Attributes:
        id: `M` + id of the original for a mirrored one; `@k` for a window of a long one.
        source: the captured clip.
        content: its label, sides exchanged when mirrored.
        joints: (T, 22, 3) float32 metres at 20 fps.
        facts: what it shows.
        speed: how much faster it is than captured.
        made: whether its gesture was put onto a captured idle; see `marey.data.gestures`.
    """

    id: str
    source: PackClip
    content: str
    mirrored: bool
    joints: NDArray[np.float32]
    facts: Facts
    speed: float = 1.0
    made: bool = False
