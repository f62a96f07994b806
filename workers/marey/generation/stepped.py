"""Ways of as many steps as their prompt asks for.

A network walks as far as its length has room for. The steps that are asked for are cut out between two moments at which
both feet are on the floor.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from marey.motion.features import FeatureLayout
from marey.selector.repetitions import Repetition

Float32 = NDArray[np.float32]

STEP_S = 0.65
"""Seconds of a step, at most."""
SETTLES_S = 0.1
"""Seconds that are kept after the last foot is down, and at most before the first one is."""


def frames_of_steps(count: int, fps: float) -> int:
    """Return the frames in which a network makes as many steps, and one at each end that is left out."""
    return round((count + 2) * STEP_S * fps)


def stepped(
    features: Float32, layout: FeatureLayout, find: Callable[[NDArray[np.floating]], Sequence[Repetition]], count: int
) -> Float32 | None:
    """Return features (T', D) of `count` steps; `features` itself if it has as many, None if it has fewer.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
        find: returns the steps in joints (T, J, 3), by the frame at which the foot is down.
        count: at least 1.
    """
    steps = find(layout.decode(features))
    if len(steps) == count:
        return features
    settles = round(SETTLES_S * layout.fps)
    for first, before in product(range(len(steps) - count), range(settles + 1)):
        cut = features[max(steps[first].end - before, 0) : steps[first + count].end + settles + 1]
        if len(find(layout.decode(cut))) == count:
            return cut
    return None
