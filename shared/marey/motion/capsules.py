"""Capsules of the body of HumanML3D, by which arms are measured and kept out of trunk, head and legs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from marey.motion.rotations import Array
from marey.motion.skeleton import HUMANML3D

SIDES = ("L_", "R_")
CAPSULES: Mapping[str, tuple[str, str, float]] = {
    "trunk": ("pelvis", "spine3", 0.10),
    "head": ("head", "head", 0.08),
    **{f"{s}forearm": (f"{s}elbow", f"{s}wrist", 0.035) for s in SIDES},
    **{f"{s}thigh": (f"{s}hip", f"{s}knee", 0.06) for s in SIDES},
    **{f"{s}shin": (f"{s}knee", f"{s}ankle", 0.045) for s in SIDES},
}
"""Two joints and a radius in metres, by name."""


def ends_of(capsule: str) -> tuple[int, int]:
    """Return the indices of a capsule's two joints."""
    first, last, _ = CAPSULES[capsule]
    return HUMANML3D.index(first), HUMANML3D.index(last)


def depth(joints: Array, one: str, other: str) -> Array:
    """Return how deep (...,) one capsule is inside another, metres, negative where they are apart.

    Args:
        joints: (..., 22, 3) metres.
        one, other: names of capsules.
    """
    gap = segment_distance(*(joints[..., joint, :] for joint in (*ends_of(one), *ends_of(other))))
    return CAPSULES[one][2] + CAPSULES[other][2] - gap


def segment_distance(p1: Array, q1: Array, p2: Array, q2: Array) -> Array:
    """Return the distances between segments p1-q1 and p2-q2, each (..., 3)."""
    s, t = nearest_on_segments(p1, q1, p2, q2)
    return np.linalg.norm(p1 - p2 + (q1 - p1) * s[..., None] - (q2 - p2) * t[..., None], axis=-1)


def nearest_on_segments(p1: Array, q1: Array, p2: Array, q2: Array) -> tuple[Array, Array]:
    """Return how far along segments p1-q1 and p2-q2, each (..., 3), their nearest points are, 0 to 1; closed form
    (Ericson, Real-Time Collision Detection, 5.1.9)."""
    d1, d2, r = q1 - p1, q2 - p2, p1 - p2
    a, e, f = ((x * y).sum(axis=-1) for x, y in ((d1, d1), (d2, d2), (d2, r)))
    b, c = ((x * y).sum(axis=-1) for x, y in ((d1, d2), (d1, r)))
    a, e = np.maximum(a, 1e-12), np.maximum(e, 1e-12)
    denominator = a * e - b * b
    s = np.where(denominator > 1e-12, np.clip((b * f - c * e) / np.maximum(denominator, 1e-12), 0, 1), 0.0)
    t = (b * s + f) / e
    s = np.where(t < 0, np.clip(-c / a, 0, 1), np.where(t > 1, np.clip((b - c) / a, 0, 1), s))
    return s, np.clip(t, 0, 1)
