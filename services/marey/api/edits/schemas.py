"""Bodies of the routes of edits."""

from __future__ import annotations

from typing import Any

from pydantic import Field

from marey.api.jobs.schemas import CommonJobFields
from marey.motion.edits.steps import MOST


class NewEditBody(CommonJobFields):
    """Operations on a motion, as a job."""

    ops: list[dict[str, Any]] = Field(
        min_length=1,
        max_length=MOST,
        description="Operations, applied in their order; `with` of `concat` is the id of another motion. Each `split` "
        "makes two motions of one.",
    )
