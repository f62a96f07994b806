"""Rigs as data: everything that retargeting needs about a rig, from a `[[rig]]` table of `dataset.toml`."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator

Vector = tuple[float, float, float]


class Point(BaseModel):
    """A point of the rig: a joint, its End Site (`Foot_L:end`), or a point fixed in the joint's frame.

    Attributes:
        joint: name of the joint.
        end: use its End Site.
        offset: from the joint, in the joint's frame and in the file's unit.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    joint: str
    end: bool = False
    offset: Vector = (0.0, 0.0, 0.0)


def _point(value: object) -> object:
    if isinstance(value, str):
        joint, _, end = value.partition(":")
        return {"joint": value} if end != "end" else {"joint": joint, "end": True}
    return value


RigPoint = Annotated[Point, BeforeValidator(_point)]
Four = tuple[RigPoint, RigPoint, RigPoint, RigPoint]


class CapturedRig(BaseModel):
    """A rig that can be retargeted to the 22 joints of HumanML3D.

    Attributes:
        name: short name.
        pelvis, spine: the joint that carries the hips, and the first spine joint above it.
        middle: the spine joint below the chest; repeat `spine` or `chest` if there is none between them.
        chest, neck, head: the joint that carries the arms, and those above it.
        left_leg, right_leg: hip, knee, ankle, toe.
        left_arm, right_arm: clavicle, shoulder, elbow, wrist; repeat the chest if there is no clavicle.
        trunk: `rotations`: trunk orientations come from joint rotations relative to the rest pose, in which the body
            stands upright; `positions`: they come from joint positions, for a rig with another rest pose.
        rest_left, rest_up: axes of the rest pose (all rotations zero) that point to the body's left and up.
        left_foot, right_foot: direction in the ankle's frame that points to the body's left while the foot is flat.
        sole_pitch: degrees by which the line from ankle to toe points down while the sole is flat on the floor. Without
            these three, feet are flat in the rest pose.
        toe_height: height of the toe joint above the floor while it stands, in the file's unit.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str
    pelvis: RigPoint
    spine: RigPoint
    middle: RigPoint
    chest: RigPoint
    neck: RigPoint
    head: RigPoint
    left_leg: Four
    right_leg: Four
    left_arm: Four
    right_arm: Four
    trunk: Literal["rotations", "positions"] = "rotations"
    rest_left: Vector = (1.0, 0.0, 0.0)
    rest_up: Vector = (0.0, 1.0, 0.0)
    left_foot: Vector | None = None
    right_foot: Vector | None = None
    sole_pitch: float | None = None
    toe_height: float = 0.0

    @model_validator(mode="after")
    def _square(self) -> Self:
        if abs(sum(a * b for a, b in zip(self.rest_left, self.rest_up, strict=True))) > 1e-3:
            raise ValueError("rest_left and rest_up are not perpendicular")
        return self

    @cached_property
    def points(self) -> tuple[Point, ...]:
        """All points to read: trunk, then left leg, right leg, left arm, right arm."""
        trunk = (self.pelvis, self.spine, self.middle, self.chest, self.neck, self.head)
        return (*trunk, *self.left_leg, *self.right_leg, *self.left_arm, *self.right_arm)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """The joints of `points`."""
        return tuple(point.joint for point in self.points)

    @property
    def turning(self) -> tuple[str, ...]:
        """Joints whose rotations orient the trunk: pelvis, three spine joints, neck, clavicles."""
        clavicles = (self.left_arm[0], self.right_arm[0])
        return tuple(p.joint for p in (self.pelvis, self.spine, self.middle, self.chest, self.neck, *clavicles))

    def fits(self, names: frozenset[str]) -> bool:
        """Return True if a skeleton with these joint names has this rig."""
        return names.issuperset(self.joint_names)
