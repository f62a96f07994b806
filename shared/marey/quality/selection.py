"""Record of a motion that was chosen among candidates (best of N)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from marey.motion.clip import SELECTION
from marey.quality.record import Flag


class Candidate(BaseModel):
    """One motion that was drawn for an item."""

    model_config = ConfigDict(frozen=True)

    index: int = Field(description="From 0, in the order in which they were drawn; redraws follow.")
    seed: int = Field(description="Candidate 0 has the item's seed.")
    flags: list[Flag] = Field(description="Those of its quality record.")
    ok: bool = Field(description="True without flags.")
    match: float | None = Field(description="Value of its match; null where the prompt names no action.")


class Selection(BaseModel):
    """Choice of a motion among candidates: one that shows the prompt first, then one without other flags, then by
    match, then the earlier one."""

    model_config = ConfigDict(frozen=True)

    version: Literal[1] = 1
    best_of: int = Field(description="Candidates of a round.")
    redraws: int = Field(description="Further rounds that were drawn because no candidate was good.")
    chosen: int = Field(description="Index of the candidate that is this motion.")
    candidates: list[Candidate]


def read_selection(manifest: Mapping[str, Any]) -> Selection | None:
    """Return the record of a motion's manifest; None if it was not chosen among several, or of another version."""
    try:
        return Selection.model_validate(manifest.get(SELECTION))
    except ValidationError:
        return None
