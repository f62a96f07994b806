"""`/v1/resolve`."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Literal
from uuid import UUID

from fastapi import APIRouter, Query
from pydantic import Field

from marey import takes
from marey.api.auth import Reader
from marey.api.context import Connection
from marey.http.problems import RESPONSES
from marey.http.schemas import View
from marey.takes.references import MAX_REFERENCE, ReferenceKind, ReferenceMatch

router = APIRouter(prefix="/v1/resolve", tags=["references"], responses=RESPONSES)


AskedKind = Literal["job", "motion", "stream", "evaluation", "schedule", "webhook", "delivery"]


class MatchView(View):
    """A candidate of a reference."""

    kind: ReferenceKind
    id: UUID
    name: str | None = Field(description="Of a delivery, its kind.")
    state: str | None = Field(description="Of a motion, its review.")
    created: datetime
    items: int | None = Field(description="Of a job, how many.")
    job: UUID | None = Field(description="Of a motion.")
    index: int | None = Field(description="Of a motion, its prompt's in the job, from 0.")
    variant: int | None = Field(description="Of a motion, among those of its prompt, from 0.")

    @classmethod
    def of(cls, match: ReferenceMatch) -> MatchView:
        """Convert a match."""
        return cls(**vars(match))


class ResolutionView(View):
    """The match of a reference."""

    matches: list[MatchView] = Field(description="Newest first. None: not found; several: ambiguous. At most 10.")


@router.get("")
def resolve(
    conn: Connection,
    key: Reader,
    kind: Annotated[AskedKind, Query(description="Kind of the object. A delivery needs `webhook`.")],
    reference: Annotated[
        str,
        Query(
            min_length=1,
            max_length=MAX_REFERENCE,
            description="An id; its last 8 or more digits; a name; `last`, the newest; of a motion also `JOB:INDEX` or "
            "`JOB:INDEX.VARIANT`, both from 0, where JOB is any of these.",
            examples=["1a2b3c4d", "day 1", "last", "last:0.1"],
        ),
    ],
    webhook: Annotated[UUID | None, Query(description="Whose delivery.")] = None,
) -> ResolutionView:
    """Resolve a short reference within the key's tenant."""
    found = takes.resolve_reference(conn, key.tenant, ReferenceKind(kind), reference, webhook=webhook)
    return ResolutionView(matches=[MatchView.of(match) for match in found])
