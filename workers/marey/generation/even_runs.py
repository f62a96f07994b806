"""Runs whose strides are all alike.

In some runs a network loses the beat: for half a second both feet hang in the air, and it begins its strides anew. Such
a run is kept where it runs evenly, and goes on with strides of its own.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from marey.generation.onward import gone_on_with_strides
from marey.motion.features import FeatureLayout
from marey.motion.feet import runs

Float32 = NDArray[np.float32]

EVEN = frozenset({"run", "sprint"})
"""Actions whose strides are alike."""
HIGH, LONGEST_S = 0.08, 0.28
"""Metres over its resting height from which a foot is in the air, and seconds of the longest flight of a run."""
LEAST_S = 1.3
"""Seconds of the part of a run that is kept at least."""


def even_run(features: Float32, layout: FeatureLayout) -> Float32 | None:
    """Return features (T, D) of a run without flights in which it loses its beat; None if it has none, or hardly runs
    evenly anywhere.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
    """
    lost = long_flights(features, layout)
    if not lost:
        return None
    bounds = [0, *(edge for flight in lost for edge in flight), len(features)]
    begin, end = max(list(pairwise(bounds))[::2], key=lambda part: part[1] - part[0])
    if end - begin < LEAST_S * layout.fps:
        return None
    even = gone_on_with_strides(features[begin:end], layout, len(features))
    return even if even is not None and not long_flights(even, layout) else None


def long_flights(features: Float32, layout: FeatureLayout) -> list[tuple[int, int]]:
    """Return the first frame of each flight that is too long for a run, and the one after its last."""
    heights = layout.decode(features)[:, list(layout.skeleton.feet), 1]
    flies = np.all(heights - np.quantile(heights, 0.1, axis=0) > HIGH, axis=1)
    return [(begin, end) for begin, end in runs(flies) if end - begin > LONGEST_S * layout.fps]
