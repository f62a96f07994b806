"""Cut positions of captured clips: outside the core of the action, where a seam costs least."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading, lean, trunk_up
from marey.data.describe import CYCLIC
from marey.data.part import FPS, Part
from marey.data.splice import seam_costs, seam_features
from marey.motion.filters import smooth_seconds

Array = NDArray[np.floating]
WORST_SEAM = 0.6
"""Largest cost of a seam, see `seam_costs`; a bow into a run has 0.4 and looks good."""
_ARMS = {"left": (0,), "right": (1,), "both": (0, 1)}


def core(part: Part) -> tuple[int, int]:
    """First and last frame of the action itself; a clip may be cut before and after, not between them.

    Travel has no core and may be cut anywhere: (0, 0).
    """
    joints = part.joints.astype(np.float64)
    last = len(joints) - 1
    action, side = part.facts.action, part.facts.side
    if action in CYCLIC:
        return 0, 0
    if action == "turn":
        angle = heading(joints, FPS)
        done = (angle - angle[0]) / (angle[-1] - angle[0])
        inside = np.flatnonzero((done > 0.06) & (done < 0.94))
        return (max(int(inside[0]) - 5, 0), min(int(inside[-1]) + 5, last)) if len(inside) else (0, last)
    if action in ("wave", "raise", "guide") and side in _ARMS:
        level = arm_level(joints, side)
        inside = np.flatnonzero(level > 0.12)
    elif action in ("bow", "call"):
        bend = lean(joints, FPS)
        bend = bend - np.percentile(bend, 10)
        inside = np.flatnonzero(bend > 0.15 * bend.max())
    else:
        return 0, last
    return (int(inside[0]), int(inside[-1])) if len(inside) else (0, last)


def arm_level(joints: Array, side: str) -> Array:
    """Relative height (T,) of the raised hand: 0 at its lowest in the clip, 1 at its highest."""
    wrists = [20 + k for k in _ARMS[side]]
    over = np.einsum("tki,ti->tk", joints[:, wrists] - joints[:, :1], trunk_up(joints)).mean(axis=1)
    over = smooth_seconds(over, 0.05, FPS)
    return (over - over.min()) / max(float(np.ptp(over)), 1e-6)


def hold(part: Part, a: int, b: int) -> tuple[int, int] | None:
    """First and last frame within the core that hold the pose or continue the wave; None if too few."""
    joints = part.joints.astype(np.float64)
    if part.facts.side in _ARMS:
        held = arm_level(joints, part.facts.side) > 0.7
    else:
        bend = lean(joints, FPS)
        held = bend - np.percentile(bend, 10) > 0.75 * (bend.max() - np.percentile(bend, 10))
    inside = np.flatnonzero(held[a : b + 1])
    if not len(inside) or inside[-1] - inside[0] < 12:
        return None
    return a + int(inside[0]), a + int(inside[-1])


@lru_cache(maxsize=4096)
def _seams(part: Part) -> NDArray[np.float32]:
    return seam_features(part.joints.astype(np.float64), FPS).astype(np.float32)


def best_cut(first: Part, leave: range, second: Part, enter: range) -> tuple[int, int, float]:
    """Find the best seam: last frame of one clip, first frame of the other, and the cost."""
    costs = seam_costs(
        _seams(first)[leave.start : leave.stop].astype(np.float64),
        _seams(second)[enter.start : enter.stop].astype(np.float64),
    )
    i, j = np.unravel_index(int(costs.argmin()), costs.shape)
    return leave.start + int(i), enter.start + int(j), float(costs[i, j])
