"""What the routes of motions give."""

from __future__ import annotations

from datetime import datetime
from typing import Any
from uuid import UUID

from services.api.files import FileView
from services.api.schemas import View
from shared.jobs import MotionRow


class MotionView(View):
    """A motion."""

    id: UUID
    job: UUID
    item: UUID
    name: str | None
    prompt: str
    model: str
    bundle: str
    licence: str
    seed: int
    variant: int
    frames: int
    fps: float
    elapsed: float
    files: list[FileView]
    created: datetime

    @classmethod
    def of(cls, row: MotionRow) -> MotionView:
        """From a row."""
        files = [FileView(format=f.format, sha256=f.sha256, size=f.size, media_type=f.media_type) for f in row.files]
        return cls(files=files, **{n: getattr(row, n) for n in cls.model_fields if n != "files"})


class MotionDetailView(MotionView):
    """A motion with what its npz says of it: rewritten prompt, graph, settings, software."""

    metadata: dict[str, Any]

    @classmethod
    def of(cls, row: MotionRow) -> MotionDetailView:
        """From a row."""
        return cls(metadata=dict(row.metadata), **MotionView.of(row).model_dump())
