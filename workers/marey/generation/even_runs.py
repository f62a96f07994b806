"""Runs whose strides are all alike.

In some runs a network loses the beat: for half a second both feet hang in the air, or both legs stand still while the
body glides on, and it begins its strides anew. Such a run is kept where it runs evenly, and goes on with strides of its
own.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from marey.generation.onward import gone_on_with_strides
from marey.motion.courses import gradient
from marey.motion.features import FeatureLayout
from marey.motion.feet import runs
from marey.vocabulary.courses import RUNS

Float32 = NDArray[np.float32]

EVEN = RUNS
"""Actions whose strides are alike."""
HIGH, LONGEST_S = 0.08, 0.28
"""Metres over its resting height from which a foot is in the air, and seconds of the longest flight of a run."""
SLOW, GOES, SLOWEST_S = 0.5, 0.5, 0.2
"""Share of their median speed beside the pelvis under which feet stand still, that of a body which goes on meanwhile,
and seconds for which they do in a run at most."""
LEAST_S = 1.3
"""Seconds of the part of a run that is kept at least."""


def even_run(features: Float32, layout: FeatureLayout) -> Float32 | None:
    """Return features (T, D) of a run without moments in which it loses its beat; None if it has none, or hardly runs
    evenly anywhere.

    Args:
        features: (T, D), in the layout's own units.
        layout: of the features.
    """
    lost = lost_beats(features, layout)
    if not lost:
        return None
    bounds = [0, *(edge for moment in lost for edge in moment), len(features)]
    begin, end = max(list(pairwise(bounds))[::2], key=lambda part: part[1] - part[0])
    if end - begin < LEAST_S * layout.fps:
        return None
    even = gone_on_with_strides(features[begin:end], layout, len(features))
    return even if even is not None and not lost_beats(even, layout) else None


def lost_beats(features: Float32, layout: FeatureLayout) -> list[tuple[int, int]]:
    """Return the first frame, and the one after the last, of each flight that is too long for a run, and of each time
    in which the legs stand still."""
    joints, fps = layout.decode(features).astype(np.float64), layout.fps
    feet = joints[:, list(layout.skeleton.feet)]
    heights = feet[..., 1]
    flies = np.all(heights - np.quantile(heights, 0.1, axis=0) > HIGH, axis=1)
    steps = np.linalg.norm(gradient(feet - joints[:, :1]), axis=-1).mean(axis=1)
    ways = np.linalg.norm(gradient(joints[:, 0, [0, 2]]), axis=-1)
    still = (steps < SLOW * np.median(steps)) & (ways > GOES * np.median(ways))
    lost = np.zeros(len(joints), bool)
    for mask, longest in ((flies, LONGEST_S), (still, SLOWEST_S)):
        for begin, end in runs(mask):
            lost[begin:end] |= end - begin > longest * fps
    return runs(lost)
