"""Bodies and answers of the schedule routes."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated
from uuid import UUID

from pydantic import BaseModel, ConfigDict, Field

from marey.api.evaluations.schemas import AskedFields, RequestView
from marey.evaluations import EvaluationState, ScheduleRow
from marey.http.schemas import FreeText, Name, View

CRON = "Minute, hour, day of the month, month, day of the week: `0 3 * * 1` is every Monday at 03:00."
ZONE = "Of the tz database, such as `Europe/Berlin`."
CronLine = Annotated[str, Field(min_length=1, max_length=200), FreeText()]
Zone = Annotated[str, Field(min_length=1, max_length=100), FreeText()]


class NewScheduleBody(AskedFields):
    """A schedule as JSON: the evaluation, and its times."""

    name: Name | None = None
    cron: CronLine = Field(description=CRON)
    time_zone: Zone = Field("UTC", description=ZONE)


class ScheduleFields(BaseModel):
    """Changes to the times of a schedule; omitted fields stay as they are."""

    model_config = ConfigDict(extra="forbid")

    name: Name | None = None
    cron: CronLine | None = Field(None, description=CRON)
    time_zone: Zone | None = Field(None, description=ZONE)
    paused: bool | None = Field(None, description="Runs missed while it is paused are skipped.")


class SchedulePatch(ScheduleFields):
    """Changes to a schedule; omitted fields stay as they are."""

    request: AskedFields | None = Field(None, description="The complete evaluation request.")


class ScheduleView(View):
    """A schedule."""

    id: UUID
    name: str | None
    cron: str
    time_zone: str
    paused: bool
    next: datetime | None = Field(description="Next due time; null while paused.")
    request: RequestView
    prompts: int | None = Field(description="Number of prompts; null = those of the evaluator's bundle at that time.")
    prompts_sha256: str | None
    last: UUID | None = Field(description="Its newest evaluation.")
    last_state: EvaluationState | None
    last_regressed: bool | None
    created: datetime

    @classmethod
    def of(cls, row: ScheduleRow) -> ScheduleView:
        """Convert a row."""
        apart = {"request", "prompts", "prompts_sha256"}
        own = {name: getattr(row, name) for name in cls.model_fields if name not in apart}
        return cls(request=RequestView.of(row.request), prompts=row.prompt_count, prompts_sha256=row.prompts, **own)
