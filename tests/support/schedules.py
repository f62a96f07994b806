"""Schedules for tests, and time that passes for them."""

from __future__ import annotations

from datetime import datetime, timedelta
from uuid import UUID
from zoneinfo import ZoneInfo

import sqlalchemy as sa

from marey.db import transaction
from marey.evaluations import (
    EvaluationRequest,
    EvaluationRow,
    NewSchedule,
    ScheduleChange,
    ScheduleRow,
    cancel_evaluation,
    change_schedule,
    create_schedule,
    get_schedule,
    list_evaluations,
    store_prompts,
    tables,
)
from marey.evaluations.cron import next_time
from marey.tenants import DEFAULT_TENANT
from tests.support.evaluations import GENERATOR, PROMPTS

BERLIN = "Europe/Berlin"
CRON = "0 3 * * *"


def new_schedule(
    engine: sa.Engine,
    cron: str | None = None,
    zone: str = BERLIN,
    *,
    bundle: str = GENERATOR,
    own_prompts: bool = True,
) -> UUID:
    """A schedule; by default once a day, six hours before now: no test lasts until it is due."""
    if cron is None:
        cron = f"0 {(database_now(engine).astimezone(ZoneInfo(zone)).hour - 6) % 24} * * *"
    request = EvaluationRequest(bundle, source="mine" if own_prompts else "test")
    with transaction(engine) as conn:
        prompts = store_prompts(conn, DEFAULT_TENANT, PROMPTS) if own_prompts else None
        return create_schedule(conn, NewSchedule(DEFAULT_TENANT, cron, zone, request, prompts, "nightly"))


def schedule_row(engine: sa.Engine, schedule: UUID) -> ScheduleRow:
    """The schedule as it stands."""
    with transaction(engine) as conn:
        return get_schedule(conn, DEFAULT_TENANT, schedule)


def runs(engine: sa.Engine, schedule: UUID) -> list[EvaluationRow]:
    """Its evaluations, the oldest first."""
    with transaction(engine) as conn:
        return list(reversed(list_evaluations(conn, DEFAULT_TENANT, schedule=schedule).rows))


def time_passes(engine: sa.Engine, schedule: UUID, *, missed: int = 0) -> datetime:
    """As if the schedule were due now, for its last time before now, or for one so many times earlier; that time."""
    row, now = schedule_row(engine, schedule), database_now(engine)
    times = [next_time(row.cron, row.time_zone, now - timedelta(days=missed + 3))]
    while times[-1] <= now:
        times.append(next_time(row.cron, row.time_zone, times[-1]))
    due = times[-2 - missed]
    with transaction(engine) as conn:
        table = tables.schedule
        conn.execute(sa.update(table).where(table.c.id == schedule).values(next_at=due))
    return due


def database_now(engine: sa.Engine) -> datetime:
    """Now, as the database says."""
    with transaction(engine) as conn:
        return conn.execute(sa.text("SELECT clock_timestamp()")).scalar_one()


def end(engine: sa.Engine, evaluation: UUID) -> None:
    """Cancel an evaluation."""
    with transaction(engine) as conn:
        cancel_evaluation(conn, DEFAULT_TENANT, evaluation)


def change(engine: sa.Engine, schedule: UUID, **changes: object) -> ScheduleRow:
    """Change a schedule."""
    with transaction(engine) as conn:
        return change_schedule(conn, DEFAULT_TENANT, schedule, ScheduleChange(**changes))  # pyright: ignore[reportArgumentType]
