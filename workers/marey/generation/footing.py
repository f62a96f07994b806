"""Runs that go as far as their feet carry them.

The runs that a network learned from travel faster than their legs: the foot that is on the floor slides ahead at half a
metre a second. The body is held back by the speed of that foot, in the way of `courses`: over the floor, all joints
alike.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import TOES
from marey.motion.courses import gradient
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.feet import runs
from marey.motion.filters import smooth

Float32 = NDArray[np.float32]

RUN_SPEEDS: Mapping[str, float] = {"run": 2.1, "sprint": 4.2}
"""Actions whose feet are looked at, and metres a second that the body keeps: slower, it would not run."""
WAY_S = 0.5
"""Standard deviation of the filter that leaves the way of the body, seconds."""
LOW_M = 0.05
"""Metres over the floor up to which a toe carries the body."""
PASSES_S = 0.15
"""Standard deviation of the filter in which the correction of a step passes into that of the next, seconds."""
STANDS = 0.3
"""Quantile of the slides of a step that is that of the standing foot: it rolls off at its end."""
LEAST, MOST = 0.1, 0.4
"""Metres a second of the slide that is corrected, and share of the body's speed that it is held back by at most."""


def footed(features: Float32, layout: FeatureLayout, slowest: float) -> Float32 | None:
    """Return features (T, D) of a run that is held back by the slide of its feet; None if they hardly slide.

    Args:
        features: (T, D), in the layout's own units, on the skeleton of HumanML3D.
        layout: of the features.
        slowest: metres a second that the body keeps.
    """
    joints, fps = layout.decode(features).astype(np.float64), layout.fps
    frames = len(joints)
    toes = joints[:, list(TOES)]
    lowest = toes[..., 1].argmin(axis=1)
    foot = gradient(toes[..., [0, 2]])[np.arange(frames), lowest] * fps
    body = smooth(gradient(joints[:, 0, [0, 2]]), WAY_S * fps) * fps
    speed = np.linalg.norm(body, axis=1)
    ahead = body / np.maximum(speed, 1e-6)[:, None]
    slides = (foot * ahead).sum(axis=1)
    stands = runs(toes[..., 1].min(axis=1) < LOW_M)
    if not stands:
        return None
    middles = [(begin + end - 1) / 2 for begin, end in stands]
    slide = np.interp(
        np.arange(frames), middles, [float(np.quantile(slides[begin:end], STANDS)) for begin, end in stands]
    )
    back = np.clip(smooth(slide[:, None], PASSES_S * fps)[:, 0], 0.0, MOST * speed)
    back *= np.clip((np.median(speed) - slowest) / max(float(back.mean()), 1e-6), 0.0, 1.0)
    if back.mean() < LEAST:
        return None
    joints[..., [0, 2]] -= np.cumsum(ahead * back[:, None] / fps, axis=0)[:, None]
    return encode_all(layout, joints)
