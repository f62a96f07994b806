"""Parameters and answers of the rig routes."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Self

from fastapi import Path, Query
from pydantic import Field

from marey.core.validation import worded
from marey.http.schemas import FreeText, View
from marey.motion.export_options import RIG_NAME, RIG_NAME_WORDS
from marey.takes import RigRow

NAME = worded(f"^{RIG_NAME}$", RIG_NAME_WORDS)
MAX_MAP = 8192
"""Characters of a map; all parts of the body with long names of joints take half of it."""

RigPath = Annotated[str, Path(pattern=NAME, description="Name of a rig.")]
RigName = Annotated[
    str, Query(pattern=NAME, description="Letters, digits, `_` and `-`; not `standard`, nor that of a reference rig.")
]
RigFormat = Annotated[
    str,
    Query(
        pattern=worded(r"^[a-z0-9]{1,8}$", "endings of file names, as glb, fbx, bvh or vrm"),
        description="Ending of the file's name: `glb`, `fbx`, `bvh`, `vrm`, …",
    ),
]
RigMap = Annotated[
    Annotated[str, Field(min_length=1, max_length=MAX_MAP), FreeText(lines=True)] | None,
    Query(description='Joints of parts that are not found, as JSON: `{"left_hand": "Hand_L"}`; null = no such part.'),
]


class RigView(View):
    """A rig."""

    name: str
    version: int = Field(description="Counts the changes of its file and map, from 1.")
    format: str
    sha256: str = Field(description="Of the file.")
    size: int = Field(description="Bytes of the file.")
    map: dict[str, str | None] | None = Field(description="Joints that its owner named; null = none.")
    added_by: str = Field(description="Name of the key that added this version.")
    created: datetime
    updated: datetime = Field(description="Time of this version.")

    @classmethod
    def of(cls, row: RigRow) -> Self:
        """Convert a row."""
        return cls(**{name: getattr(row, name) for name in cls.model_fields})


class RigDetailView(RigView):
    """A rig, and what is found in it."""

    report: dict[str, Any] = Field(description="Family, pose, unit, notes, and the joint of each part of the body.")
