"""Options of an export: root, rest pose, place and body. Standard library only: the small client imports it."""

from __future__ import annotations

import re
from dataclasses import dataclass, fields
from typing import Any, Literal

from marey.core.errors import InvalidInput

BvhRoot = Literal["zero", "offset"]
InPlace = Literal["travel", "heading"]
Placement = Literal["origin", "keep"]
RestPose = Literal["t", "a"]
Names = Literal["mixamo", "ue5", "humanik", "smplx", "vrm"]
REFERENCE_RIGS = ("mixamo", "ue4", "humanik")
"""Names of the reference skeletons that `rig` may name; their tables need numpy (`marey.motion.retarget.reference`)."""
STANDARD = "standard"
"""The body that motions are generated on (`marey.motion.body`)."""
OWN_BODIES = (STANDARD, *REFERENCE_RIGS)
"""Names that `body` may give without a file."""
RIG_NAME = r"[A-Za-z0-9][A-Za-z0-9_-]{0,62}"
"""Pattern of the names of rigs on a server: without a dot, so that none looks like a file."""
RIG_NAME_WORDS = "letters from A to Z, digits, _ and -, at most 63, of which the first is a letter or digit"


@dataclass(frozen=True, kw_only=True)
class ExportOptions:
    """Root, rest pose, place and body of the motion in a file.

    Attributes:
        bvh_root: OFFSET of the root of a BVH file: `zero` is right for programs that add position channels to it
            (three.js) and for those that replace it (Blender); `offset` writes the height of the pelvis in the T-pose,
            for programs that replace it.
        root_bone: add a joint `root` above the pelvis, which stands on the floor and has X, Z and the heading of the
            motion.
        in_place: remove the travel (X and Z), or travel and heading.
        tpose_frame: put the T-pose before the motion, which then begins in frame 1.
        rest_pose: T-pose, or the A-pose of a rig whose A-pose is known.
        placement: put the motion where its manifest says it was taken from (`keep`), or leave it at the origin.
        mesh: add a neutral body of round limbs, which moves with the skeleton.
        rig: put the motion on a rig: a reference skeleton (`mixamo`, `ue4`, `humanik`) or a file with a skeleton.
        rig_map: JSON file that says which joint of the rig is which part of the body, where the joints are not found;
            of the rig of `rig` or of `body`.
        names: names of the joints, without a change of anything else.
        body: put the motion on a body of other proportions: `standard`, those of a rig as in `rig`, or of an npz of
            Marey. It acts on every format.

    Raises:
        InvalidInput: two options contradict each other.
    """

    bvh_root: BvhRoot = "zero"
    root_bone: bool = False
    in_place: InPlace | None = None
    tpose_frame: bool = False
    rest_pose: RestPose = "t"
    placement: Placement = "origin"
    mesh: bool = False
    rig: str | None = None
    rig_map: str | None = None
    names: Names | None = None
    body: str | None = None

    def __post_init__(self) -> None:
        if self.root_bone and self.bvh_root == "offset":
            raise _contradiction(
                "bvh_root",
                "with a root bone, root and pelvis have position channels and OFFSET 0: neither has the height",
                hint="Leave out bvh_root, or the root bone.",
            )
        if self.tpose_frame and self.rest_pose == "a":
            raise _contradiction(
                "tpose_frame",
                "frame 0 cannot be a T-pose in a file whose rest pose is an A-pose",
                hint="Leave out tpose_frame, or rest_pose.",
            )
        if self.in_place and self.placement == "keep":
            raise _contradiction(
                "placement",
                "a motion in place stays at the origin, so it cannot keep its placement",
                hint="Leave out placement, or in-place.",
            )
        if self.rig:
            self._check_rig()
        elif self.rig_map and not self.body:
            raise _contradiction("rig_map", "a map of joints belongs to a rig", hint="Name the rig too.")

    def _check_rig(self) -> None:
        """Refuse options that the rig decides."""
        for name in ("mesh", "names", "rest_pose"):
            if name in self.chosen:
                raise _contradiction(
                    name,
                    "a motion on a rig has the joints and the rest pose of the rig",
                    hint=f"Leave out {name}, or the rig.",
                )
        if self.body:
            raise _contradiction(
                "body", "a motion on a rig has the proportions of the rig", hint="Leave out body, or the rig."
            )

    @property
    def server_rig(self) -> str | None:
        """Name of a rig of a server that `rig` or `body` names, None if they name none.

        It is a word without a dot or a slash, which files have, and not one of Marey's own: `standard` and the
        reference rigs.
        """
        named = self.rig or self.body
        if named is None or named in OWN_BODIES or not re.fullmatch(RIG_NAME, named):
            return None
        return named

    @property
    def chosen(self) -> tuple[str, ...]:
        """Names of the options that differ from the defaults."""
        known = fields(ExportOptions)
        return tuple(each.name for each in known if getattr(self, each.name) != each.default)

    @property
    def values(self) -> dict[str, Any]:
        """Values of the options that differ from the defaults, as keyword arguments."""
        return {name: getattr(self, name) for name in self.chosen}


def _contradiction(option: str, message: str, *, hint: str) -> InvalidInput:
    return InvalidInput(message, where=option, hint=hint, argument=option)


PLAIN = ExportOptions()
"""The options of stored files."""
