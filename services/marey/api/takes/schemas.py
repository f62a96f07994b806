"""Bodies and answers of the motion routes."""

from __future__ import annotations

from datetime import datetime
from enum import StrEnum
from typing import Annotated, Any
from uuid import UUID

from pydantic import BaseModel, ConfigDict, Field

from marey.api.files import FileView
from marey.http.schemas import Comment, View
from marey.jobs import ItemState, MotionRow, Review
from marey.quality.record import MotionQuality, read_quality
from marey.quality.selection import Selection, read_selection
from marey.takes import MAX_REVIEWED, Reroll


class ReviewFilter(StrEnum):
    """Review state of a motion; `new` = not reviewed."""

    NEW = "new"
    KEPT = "kept"
    REJECTED = "rejected"
    REROLLED = "rerolled"


class Verdict(StrEnum):
    """Possible verdicts on a motion."""

    KEPT = "kept"
    REJECTED = "rejected"


Motions = Annotated[list[UUID], Field(min_length=1, max_length=MAX_REVIEWED)]


class NewReviewBody(BaseModel):
    """A verdict on motions."""

    model_config = ConfigDict(extra="forbid")

    motions: Motions
    verdict: Verdict | None = Field(description="Null removes the verdict.")
    comment: Comment | None = None


class NewRerollBody(BaseModel):
    """Motions to make again, with the next seeds."""

    model_config = ConfigDict(extra="forbid")

    motions: Motions
    comment: Comment | None = None


class RerollView(View):
    """Another take of a motion: an item of the same job."""

    motion: UUID
    item: UUID
    job: UUID
    seed: int
    state: ItemState
    made: bool = Field(description="False if it existed before.")

    @classmethod
    def of(cls, row: Reroll) -> RerollView:
        """Convert a row."""
        return cls(**vars(row))


class RerollsView(View):
    """Takes, in the order of the motions that they replace."""

    items: list[RerollView]


class ReviewView(View):
    """Review of a motion."""

    verdict: Review
    at: datetime
    by: str = Field(description="Name of an API key.")
    comment: str | None


class MotionView(View):
    """A motion."""

    id: UUID
    job: UUID
    item: UUID
    index: int = Field(description="Place of its prompt in the job, from 0.")
    name: str | None
    tags: list[str]
    prompt: str
    model: str
    bundle: str = Field(description="Exact bundle that generated it, as `hgm3-open@4b73363936fc`.")
    licence: str = Field(description="Terms of the motion: those of the bundle's weights, as an SPDX identifier.")
    seed: int
    variant: int = Field(description="Number among the motions of its prompt, from 0.")
    frames: int = Field(description="Number of poses.")
    fps: float = Field(description="Frames a second.")
    elapsed: float = Field(description="Seconds of computation.")
    files: list[FileView] = Field(description="Stored files; others are made on request.")
    created: datetime
    review: ReviewView | None
    replaces: UUID | None = Field(description="Replaced motion of a re-roll.")
    replaced_by: UUID | None = Field(description="Item of its re-roll.")
    edited_from: list[UUID] = Field(
        description="Sources of an edit: the edited motion, then the others; empty if the motion was generated."
    )
    quality: MotionQuality | None = Field(
        description="Physical quality; null for motions of earlier releases and of skeletons other than that of 22 "
        "joints."
    )
    selection: Selection | None = Field(description="Null if the motion was not chosen among candidates.")

    @classmethod
    def of(cls, row: MotionRow) -> MotionView:
        """Convert a row."""
        files = [FileView(format=f.format, sha256=f.sha256, size=f.size, media_type=f.media_type) for f in row.files]
        apart = {"files", "tags", "review", "quality", "selection", "edited_from"}
        own = {name: getattr(row, name) for name in cls.model_fields if name not in apart}
        records = {"quality": read_quality(row.metadata), "selection": read_selection(row.metadata)}
        lists = {"files": files, "tags": list(row.tags), "edited_from": list(row.edited_from)}
        return cls(review=_review(row), **lists, **records, **own)


def _review(row: MotionRow) -> ReviewView | None:
    if row.review is None or row.reviewed is None or row.reviewed_by is None:
        return None
    return ReviewView(verdict=row.review, at=row.reviewed, by=row.reviewed_by, comment=row.review_comment)


class MotionDetailView(MotionView):
    """A motion with the metadata of its npz: rewritten prompt, graph, settings, software."""

    metadata: dict[str, Any]

    @classmethod
    def of(cls, row: MotionRow) -> MotionDetailView:
        """Convert a row."""
        return cls(metadata=dict(row.metadata), **MotionView.of(row).model_dump())
