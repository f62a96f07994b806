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
        id: id of the captured clip, with `M` before it if mirrored, and `@k` after it for a window of a long clip.
        source: the captured clip.
        content: its label, with sides exchanged if mirrored.
        joints: (T, 22, 3) float32 metres at 20 fps.
        facts: labels and measurements.
        speed: speed relative to the capture.
        made: True if its action was made of a captured clip of another; see `marey.data.gestures`.
    """

    id: str
    source: PackClip
    content: str
    mirrored: bool
    joints: NDArray[np.float32]
    facts: Facts
    speed: float = 1.0
    made: bool = False
