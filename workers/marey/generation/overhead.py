"""Work that is done overhead: "hammers a nail into a beam overhead", "drills above his head".

The hands go where they do otherwise, turned over: what is struck down before the body is struck up above it.
"""

from __future__ import annotations

from dataclasses import replace

from marey.vocabulary.bearings import ArmPose, Bearing, Vector

BEFORE = frozenset({"shoulder", "chest"})
"""Places that hands before the body are measured from."""
UP, TURNED, NEARER, LEAST_UP = 0.34, -0.5, 0.6, 0.28
"""Metres of a hand over the place that it is measured from if it is level with it otherwise, the share of its height
there, turned over, that of how far ahead it is, and metres over that place at least."""
LOOKS_UP, LEANS_BACK = -26.0, -5.0
"""Degrees of head and trunk."""
ELBOW: Vector = (0.9, -0.4, 0.4)
"""Where the elbow of a raised arm points."""


def overhead(bearing: Bearing) -> Bearing:
    """Return a bearing whose hands work over the head, which looks up there."""
    arms = {side: _raised(pose) for side, pose in bearing.arms.items()}
    keys = None if bearing.keys is None else replace(bearing.keys, trunk=(), head=(), sink=())
    return replace(bearing, arms=arms, keys=keys, trunk=LEANS_BACK, head=LOOKS_UP, sink=0.0, back=0.0)


def _raised(pose: ArmPose) -> ArmPose:
    if pose.at not in BEFORE:
        return pose
    hand = None if pose.hand is None else _up(pose.hand)
    return replace(pose, hand=hand, path=tuple(map(_up, pose.path)), elbow=ELBOW)


def _up(place: Vector) -> Vector:
    out, up, ahead = place
    return out, max(UP + TURNED * up, LEAST_UP), NEARER * ahead
