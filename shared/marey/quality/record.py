"""Schema of the quality record: one for the API, the files of a motion, reports and pages."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from marey.motion.clip import QUALITY
from marey.quality.constraints import ConstraintError
from marey.vocabulary.entries import Support

VERSION = 1
SHOWN = 0.5
"""Value of a match from which on a motion shows the actions of its prompt."""


class Flag(StrEnum):
    """A fault of a motion; see the measure of each in `MotionQuality`."""

    FLOATING = "floating"
    SKATING = "skating"
    UNDER_FLOOR = "under-floor"
    POPPING = "popping"
    JOINT_RANGE = "joint-range"
    SELF_CONTACT = "self-contact"
    OFF_PROMPT = "off-prompt"
    CONSTRAINT_MISSED = "constraint-missed"
    POSTURE_JUMP = "posture-jump"
    PART_LEFT_OUT = "part-left-out"


OF_PROMPT = frozenset({Flag.OFF_PROMPT, Flag.PART_LEFT_OUT})
"""Flags that tell what of a prompt is not shown, and no fault of the movement."""


class PromptMatch(BaseModel):
    """How well a motion shows the actions of its prompt."""

    model_config = ConfigDict(frozen=True)

    value: float | None = Field(
        default=None,
        description="0 to 1; from 0.5 on it shows them in their order. Null where the prompt names no action, and "
        "where a part of it is left out that no rule judges and the others are shown.",
    )
    by: Literal["check"] = Field(default="check", description="`check`: by rules on the joints.")
    percentile: int | None = Field(
        default=None, description="Percent of real clips of the action with no larger value. Null without enough clips."
    )


class MotionQuality(BaseModel):
    """Physical quality of a motion. Measures are those of the whole clip, on the floor y = 0."""

    model_config = ConfigDict(frozen=True)

    version: Literal[1] = Field(default=VERSION, description="Version of the measures and of their limits.")
    support: list[Support] = Field(
        description="Parts of the body that the actions of the prompt rest on; they choose the limits."
    )
    float_s: float = Field(description="Longest time with every joint over 8 cm above its resting height, seconds.")
    skate: float = Field(
        description="Share of frames in which feet touch the floor and none of their joints is slower than 0.5 m/s."
    )
    penetration_mm: float = Field(description="Depth of the deepest joint under the floor, millimetres.")
    pops: int = Field(description="Number of jumps of a joint within a twentieth of a second.")
    range_deg: float = Field(description="Farthest that a joint bends beyond the human range, degrees.")
    self_contact: float = Field(description="Deepest that limbs, trunk and head pass into each other, millimetres.")
    flags: list[Flag] = Field(
        description="Measures beyond their limits; `off-prompt`: a match under 0.5; `constraint-missed`: a constraint "
        "beyond its bar; `posture-jump`: a row of a timeline begins in a posture that the row before does not end in; "
        "`part-left-out`: a part of the prompt asks for a movement that was not read."
    )
    ok: bool = Field(description="True without flags.")
    match: PromptMatch | None = Field(default=None, description="Null for motions of earlier releases.")
    constraints: list[ConstraintError] | None = Field(
        default=None, description="Errors of the constraints that the motion was generated with, in their order."
    )

    def with_match(self, match: PromptMatch) -> MotionQuality:
        """Return the record with the match, and the flag of one that is too low."""
        flags = [flag for flag in self.flags if flag is not Flag.OFF_PROMPT]
        if match.value is not None and match.value < SHOWN:
            flags.append(Flag.OFF_PROMPT)
        return self.model_copy(update={"match": match, "flags": flags, "ok": not flags})

    def with_part_left_out(self) -> MotionQuality:
        """Return the record of a motion that leaves out a part of its prompt: that it shows all of it cannot be said,
        only that it does not."""
        match = self.match if self.match is None or (self.match.value or 0.0) < SHOWN else PromptMatch()
        flags = [*(flag for flag in self.flags if flag is not Flag.PART_LEFT_OUT), Flag.PART_LEFT_OUT]
        return self.model_copy(update={"match": match, "flags": flags, "ok": False})

    def with_posture_jump(self) -> MotionQuality:
        """Return the record with the flag of a timeline whose rows do not fit together."""
        flags = [*(flag for flag in self.flags if flag is not Flag.POSTURE_JUMP), Flag.POSTURE_JUMP]
        return self.model_copy(update={"flags": flags, "ok": False})

    def with_constraints(self, errors: Sequence[ConstraintError]) -> MotionQuality:
        """Return the record with the errors of constraints, and the flag of one that is missed."""
        flags = [flag for flag in self.flags if flag is not Flag.CONSTRAINT_MISSED]
        if any(error.missed for error in errors):
            flags.append(Flag.CONSTRAINT_MISSED)
        return self.model_copy(update={"constraints": list(errors), "flags": flags, "ok": not flags})


def read_quality(manifest: Mapping[str, Any]) -> MotionQuality | None:
    """Return the record of a motion's manifest; None if it has none, or one of another version."""
    try:
        return MotionQuality.model_validate(manifest.get(QUALITY))
    except ValidationError:
        return None
