"""Record of how far a motion is from each of its constraints, and the bars beyond which one is missed."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

Kind = Literal["root_path", "pose_keyframe", "effector_target"]

PATH_MEAN_M, PATH_MAX_M, HEADING_DEG = 0.10, 0.25, 15.0
POSE_M = 0.05
EFFECTOR_M, EFFECTOR_DEG = 0.03, 15.0


class ConstraintError(BaseModel):
    """Distance of a motion from one of its constraints."""

    model_config = ConfigDict(frozen=True)

    index: int = Field(description="Index of the constraint in the item's `constraints`.")
    type: Kind = Field(description="Its type.")
    mean_m: float = Field(
        description="Mean distance in metres: of the root over the points of a path, of the joints of a pose, of the "
        "effector over its targets."
    )
    max_m: float = Field(description="Largest distance in metres.")
    mean_deg: float | None = Field(
        default=None, description="Mean error of headings or rotations that were asked for, degrees; else null."
    )
    missed: bool = Field(
        description="Beyond a bar. Path: 10 cm mean, 25 cm at most, heading 15 degrees. Pose: 5 cm a joint. Effector: "
        "3 cm, 15 degrees."
    )

    @classmethod
    def of(cls, index: int, kind: Kind, mean: float, largest: float, degrees: float | None) -> ConstraintError:
        """Judge measured errors, in metres and degrees."""
        if kind == "root_path":
            far = mean > PATH_MEAN_M or largest > PATH_MAX_M
        else:
            far = largest > (POSE_M if kind == "pose_keyframe" else EFFECTOR_M)
        turned = degrees is not None and degrees > (HEADING_DEG if kind == "root_path" else EFFECTOR_DEG)
        return cls(
            index=index,
            type=kind,
            mean_m=round(mean, 4),
            max_m=round(largest, 4),
            mean_deg=None if degrees is None else round(degrees, 2),
            missed=far or turned,
        )
