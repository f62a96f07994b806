"""Results of `client.schedules`."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime

from marey.client.results import Result
from marey.client.types.evaluations import EvaluationRequest


@dataclass(frozen=True, kw_only=True)
class Schedule(Result):
    """An evaluation that is run again and again, at the times of a cron expression."""

    id: str
    name: str | None = None
    cron: str = ""
    """Minute, hour, day of the month, month, day of the week."""
    time_zone: str = ""
    """A name of the tz database, such as `Europe/Berlin`."""
    paused: bool = False
    """Runs missed while it is paused are skipped."""
    next: datetime | None = None
    """The next due time; None while it is paused."""
    request: EvaluationRequest = field(default_factory=EvaluationRequest)
    prompts: int | None = None
    """The number of its prompts; None = those of the evaluator's bundle at the time of each run."""
    prompts_sha256: str | None = None
    last: str | None = None
    """The id of its newest evaluation."""
    last_state: str | None = None
    last_regressed: bool | None = None
    """True if its newest evaluation is worse than its baseline; None = not compared."""
    created: datetime | None = None
