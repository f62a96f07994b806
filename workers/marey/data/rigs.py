"""Joint mappings of foreign rigs: all that retargeting needs to know about a rig, as data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Limb:
    """One leg or arm by joint names, from the trunk outwards: hip knee ankle toe, or clavicle shoulder elbow wrist."""

    joints: tuple[str, str, str, str]
    foot_lateral: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """For a leg: the direction in the ankle joint's frame that points to the body's left while the foot is flat."""


@dataclass(frozen=True)
class Rig:
    """A rig that can be retargeted to the 22 joints of HumanML3D.

    Attributes:
        name: short name.
        pelvis, spine: the joint that carries the hips, and the first spine joint over it.
        chest, neck, head: the joint that carries the clavicles, and those above it.
        middle: the spine joint under the chest; the bone from it to the chest is the target's second spine bone.
        legs, arms: left, right.
        sole_pitch: degrees by which the ankle-to-toe bone points down while the sole is flat on the floor.
    """

    name: str
    pelvis: str
    spine: str
    middle: str
    chest: str
    neck: str
    head: str
    legs: tuple[Limb, Limb]
    arms: tuple[Limb, Limb]
    sole_pitch: float

    @property
    def joint_names(self) -> tuple[str, ...]:
        """All joints that are read, trunk first, then left leg, right leg, left arm, right arm."""
        trunk = (self.pelvis, self.spine, self.middle, self.chest, self.neck, self.head)
        return trunk + tuple(name for limb in (*self.legs, *self.arms) for name in limb.joints)


def _bandai_limb(side: str, parts: str, lateral: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Limb:
    a, b, c, d = (f"{part}_{side}" for part in parts.split())
    return Limb((a, b, c, d), lateral)


def _iclone_limb(side: str, parts: str, lateral: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Limb:
    a, b, c, d = (f"CC_Base_{side}_{part}" for part in parts.split())
    return Limb((a, b, c, d), lateral)


# Axes and angles measured on standing frames of the archives (flat soles).
BANDAI_NAMCO = Rig(
    name="bandai-namco",
    pelvis="Hips",
    spine="Spine",
    middle="Spine",
    chest="Chest",
    neck="Neck",
    head="Head",
    legs=(
        _bandai_limb("L", "UpperLeg LowerLeg Foot Toes", (0.0, 1.0, 0.0)),
        _bandai_limb("R", "UpperLeg LowerLeg Foot Toes", (0.0, 1.0, 0.0)),
    ),
    arms=(
        _bandai_limb("L", "Shoulder UpperArm LowerArm Hand"),
        _bandai_limb("R", "Shoulder UpperArm LowerArm Hand"),
    ),
    sole_pitch=39.6,
)

ICLONE = Rig(
    name="iclone",
    pelvis="CC_Base_Pelvis",
    spine="CC_Base_Waist",
    middle="CC_Base_Spine01",
    chest="CC_Base_Spine02",
    neck="CC_Base_NeckTwist01",
    head="CC_Base_Head",
    legs=(
        _iclone_limb("L", "Thigh Calf Foot ToeBase", (-0.997, -0.016, 0.077)),
        _iclone_limb("R", "Thigh Calf Foot ToeBase", (-0.996, 0.012, -0.090)),
    ),
    arms=(
        _iclone_limb("L", "Clavicle Upperarm Forearm Hand"),
        _iclone_limb("R", "Clavicle Upperarm Forearm Hand"),
    ),
    sole_pitch=11.5,
)

RIGS: dict[str, Rig] = {rig.name: rig for rig in (BANDAI_NAMCO, ICLONE)}
