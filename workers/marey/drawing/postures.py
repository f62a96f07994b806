"""Postures of a body: where its hips are, how the trunk leans, and where hands and feet are put.

The points of a posture are in the frame of the floor: left (of the body; outward for a hand or a foot), up and forward
of the point between the ankles of an idle, metres. What a posture does not set stays as in the idle.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from marey.posing.standing import OTHER_SIDE

Point = tuple[float, float, float]

_ELBOW: Point = (0.6, -0.8, -0.5)


@dataclass(frozen=True)
class HandPlace:
    """Where a wrist is put.

    Attributes:
        at: the point, outward, up and forward of its anchor.
        anchor: floor, shoulder or knee (with the axes of the floor), or trunk: the middle of the shoulders, with the
            axes of the trunk.
        elbow: where the elbow points, in the same axes.
    """

    at: Point
    anchor: str = "shoulder"
    elbow: Point = _ELBOW


@dataclass(frozen=True)
class FootPlace:
    """Where an ankle is put and where its toes point: outward, up and forward, over the floor. Without a direction the
    foot is flat, as that of the idle, and at 0.07 m it stands. One that drags slides over the floor instead of making
    a step there."""

    at: Point
    toes: Point | None = None
    drags: bool = False


@dataclass(frozen=True)
class Posture:
    """A posture to pass through.

    Attributes:
        pelvis: its place, or None for that of the idle.
        tilt: degrees of the pelvis: forward, to the right, and turned to the left.
        spine: likewise of the spine, in addition.
        neck: likewise of the neck.
        hang: 1: arms that are not put anywhere hang straight down; 0: they move with the trunk.
        hands, feet: by side; one that is left out stays as in the idle.
        knees: by side, where the knee points; by default where the foot does.
        over: a foot, left or right, over which `pelvis` counts left and forward; otherwise over the point between them.
    """

    pelvis: Point | None = None
    tilt: Point = (0.0, 0.0, 0.0)
    spine: Point = (0.0, 0.0, 0.0)
    neck: Point = (0.0, 0.0, 0.0)
    hang: float = 0.0
    hands: dict[str, HandPlace] = field(default_factory=dict)
    feet: dict[str, FootPlace] = field(default_factory=dict)
    knees: dict[str, Point] = field(default_factory=dict)
    over: str = ""


STAND = Posture()

ELBOW_OUT: Point = (1.0, -0.4, -0.2)
ELBOW_DOWN: Point = (0.5, -1.0, -0.2)
ELBOW_BACK: Point = (0.6, -0.3, -0.9)
"""Where elbows point in throws, strokes and loads."""
LOWERED = HandPlace((0.1, -0.44, 0.12), "shoulder", ELBOW_BACK)
TUCKED = HandPlace((0.02, -0.3, 0.2), "shoulder", ELBOW_BACK)
"""A hand that hangs, and one that is held before the belly, of who strikes or throws with the other."""


def mirrored(posture: Posture) -> Posture:
    """Exchange left and right."""
    turned = {
        name: (angles[0], -angles[1], -angles[2])
        for name, angles in (("tilt", posture.tilt), ("spine", posture.spine), ("neck", posture.neck))
    }
    pelvis = posture.pelvis and (-posture.pelvis[0], *posture.pelvis[1:])
    other_foot = OTHER_SIDE.get(posture.over, "")
    sided = {
        name: {OTHER_SIDE[side]: put for side, put in getattr(posture, name).items()}
        for name in ("hands", "feet", "knees")
    }
    return replace(posture, pelvis=pelvis, over=other_foot, **turned, **sided)
