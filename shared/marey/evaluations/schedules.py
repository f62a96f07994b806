"""Schedules of recurring evaluations. Times are those of the database."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import InvalidInput, NotFound
from marey.db.ids import new_id
from marey.db.pages import PAGE, Order, Page
from marey.db.sql import CLOCK, check_text, need_row
from marey.evaluations import tables
from marey.evaluations.cron import check_cron, check_zone, last_time, next_time
from marey.evaluations.repository import create_evaluation, lock_evaluation, move_evaluation
from marey.evaluations.states import EvaluationState
from marey.evaluations.types import EvaluationRequest, NewEvaluation, NewSchedule, ScheduleChange, ScheduleRow
from marey.tenants import tables as tenant_tables


def create_schedule(conn: sa.Connection, new: NewSchedule) -> UUID:
    """Create a schedule, first due at its next time from now.

    Raises:
        InvalidInput: an invalid cron line, time zone or name.
    """
    check_text(new.name, "name")
    cron, zone = check_cron(new.cron), check_zone(new.time_zone)
    identifier = new_id()
    conn.execute(
        sa.insert(tables.schedule).values(
            id=identifier,
            tenant_id=new.tenant,
            name=new.name,
            cron=cron,
            time_zone=zone,
            request=new.request.as_json(),
            prompts_sha256=new.prompts,
            next_at=next_time(cron, zone, _now(conn)),
        )
    )
    return identifier


def get_schedule(conn: sa.Connection, tenant: str, schedule: UUID) -> ScheduleRow:
    """Return one schedule.

    Raises:
        NotFound: the tenant has no such schedule.
    """
    table = tables.schedule.c
    query = _schedules().where(table.tenant_id == tenant, table.id == schedule)
    hint = "`marey eval schedule list` shows yours."
    return _row(need_row(conn, query, NotFound("there is no such schedule", where=f"schedule {schedule}", hint=hint)))


def list_schedules(
    conn: sa.Connection, tenant: str, *, cursor: str | None = None, limit: int = PAGE
) -> Page[ScheduleRow]:
    """Return schedules, newest first."""
    table = tables.schedule.c
    ours = table.tenant_id == tenant
    query, order = _schedules().where(ours), Order(table.created_at, table.id)
    return order.page(conn, query, ours, cursor, limit, _row)


def change_schedule(conn: sa.Connection, tenant: str, schedule: UUID, change: ScheduleChange) -> ScheduleRow:
    """Change a schedule. After a pause, or with new times, it is next due at its next time from now; missed times are
    skipped.

    Raises:
        NotFound: the tenant has no such schedule.
        InvalidInput: an invalid cron line, time zone or name.
    """
    check_text(change.name, "name")
    row = _locked(conn, tenant, schedule)
    times = (change.cron or row.cron, change.time_zone or row.time_zone)
    paused = row.paused if change.paused is None else change.paused
    values: dict[str, Any] = {"paused": paused}
    if change.name is not None:
        values["name"] = change.name
    if times != (row.cron, row.time_zone) or (row.paused and not paused):
        cron, zone = check_cron(times[0]), check_zone(times[1])
        values |= {"cron": cron, "time_zone": zone, "next_at": next_time(cron, zone, _now(conn))}
    if change.request is not None:
        request, prompts = change.request
        values |= {"request": request.as_json(), "prompts_sha256": prompts}
    conn.execute(sa.update(tables.schedule).where(tables.schedule.c.id == schedule).values(values))
    return get_schedule(conn, tenant, schedule)


def delete_schedule(conn: sa.Connection, tenant: str, schedule: UUID) -> None:
    """Delete a schedule. Its evaluations stay, and running ones continue.

    Raises:
        NotFound: the tenant has no such schedule.
    """
    _locked(conn, tenant, schedule)
    conn.execute(sa.delete(tables.schedule).where(tables.schedule.c.id == schedule))


def run_schedule(conn: sa.Connection, tenant: str, schedule: UUID) -> UUID:
    """Plan an evaluation of a schedule now, beside its times; also of one that is paused.

    Raises:
        NotFound: the tenant has no such schedule.
    """
    _locked(conn, tenant, schedule)  # wait for a concurrent change: its request and prompts belong together
    row = get_schedule(conn, tenant, schedule)
    made = create_evaluation(conn, _evaluation(row, None, "requested outside the times of its schedule"))
    assert made is not None  # only one with a due time can exist already
    return made


# --- the scheduler's functions ---


def due_schedules(conn: sa.Connection) -> list[UUID]:
    """Return due schedules, the most overdue first."""
    table = tables.schedule.c
    return list(conn.execute(sa.select(table.id).where(_is_due()).order_by(table.next_at, table.id)).scalars())


def fire_schedule(conn: sa.Connection, schedule: UUID) -> UUID | None:
    """Plan the due evaluation of a schedule; None if it is not due, or another process has it.

    After an outage the newest of the missed times stands for all of them. A schedule whose cron line or time zone is
    no longer valid is paused, and its evaluation fails with the reason.
    """
    table = tables.schedule
    lock = sa.select(table.c.next_at).where(table.c.id == schedule, _is_due())
    lock = lock.with_for_update(key_share=True, skip_locked=True, of=table)
    since: datetime | None = conn.execute(lock).scalar_one_or_none()
    if since is None:
        return None
    row = _row(conn.execute(_schedules().where(table.c.id == schedule)).mappings().one())
    now = _now(conn)
    change = sa.update(table).where(table.c.id == schedule)
    try:
        zone = check_zone(row.time_zone)
        due = last_time(row.cron, zone, now, since)
        conn.execute(change.values(next_at=next_time(row.cron, zone, now)))
    except InvalidInput as error:
        conn.execute(change.values(paused=True))
        return _give_up(conn, row, since, f"its schedule cannot go on, and is paused: {error.message}")
    reason = f"due at {due:%Y-%m-%d %H:%M} UTC"
    if due > since:
        reason += f"; makes up for what was missed since {since:%Y-%m-%d %H:%M}"
    return create_evaluation(conn, _evaluation(row, due, reason))


# --- helpers ---


def _give_up(conn: sa.Connection, row: ScheduleRow, due: datetime, reason: str) -> UUID | None:
    """Write a failed evaluation, visible in the schedule's history."""
    made = create_evaluation(conn, _evaluation(row, due, "due"))
    planned = None if made is None else lock_evaluation(conn, made)
    if planned is not None:
        move_evaluation(conn, planned, EvaluationState.FAILED, reason)
    return made


def _is_due() -> sa.ColumnElement[bool]:
    """Return the condition of due schedules. A schedule waits while one of its evaluations runs, so that long runs do
    not pile up."""
    table, evaluation = tables.schedule.c, tables.evaluation.c
    runs = sa.exists().where(evaluation.schedule_id == table.id, evaluation.finished_at.is_(None))
    idle = sa.exists().where(
        tenant_tables.tenant.c.id == table.tenant_id, tenant_tables.tenant.c.suspended_at.is_not(None)
    )
    return ~table.paused & (table.next_at <= CLOCK) & ~runs & ~idle


def _evaluation(row: ScheduleRow, due: datetime | None, reason: str) -> NewEvaluation:
    return NewEvaluation(
        tenant=row.tenant,
        request=row.request,
        prompts=row.prompts,
        name=row.name,
        schedule=row.id,
        due=due,
        reason=reason,
    )


def _now(conn: sa.Connection) -> datetime:
    return conn.execute(sa.select(CLOCK)).scalar_one()


@dataclass(frozen=True)
class _Locked:
    cron: str
    time_zone: str
    paused: bool


def _locked(conn: sa.Connection, tenant: str, schedule: UUID) -> _Locked:
    table = tables.schedule.c
    query = sa.select(table.cron, table.time_zone, table.paused)
    row = conn.execute(query.where(table.tenant_id == tenant, table.id == schedule).with_for_update()).one_or_none()
    if row is None:
        get_schedule(conn, tenant, schedule)  # raises
    assert row is not None
    return _Locked(*row)


def _schedules() -> sa.Select[*tuple[Any, ...]]:
    c, prompts, evaluation = tables.schedule.c, tables.prompt_set.c, tables.evaluation.c
    last = (
        sa.select(evaluation.id, evaluation.state, evaluation.regressed)
        .where(evaluation.schedule_id == c.id)
        .order_by(evaluation.created_at.desc(), evaluation.id.desc())
        .limit(1)
        .lateral("last")
    )
    return (
        sa.select(
            *(c.id, c.tenant_id.label("tenant"), c.name, c.cron, c.time_zone, c.request, c.paused),
            *(c.prompts_sha256.label("prompts"), prompts.count.label("prompt_count")),
            sa.case((c.paused, None), else_=c.next_at).label("next"),
            *(last.c.id.label("last"), last.c.state.label("last_state"), last.c.regressed.label("last_regressed")),
            c.created_at.label("created"),
        )
        .outerjoin(tables.prompt_set, (prompts.tenant_id == c.tenant_id) & (prompts.sha256 == c.prompts_sha256))
        .outerjoin(last, sa.true())
    )


def _row(row: sa.RowMapping) -> ScheduleRow:
    values: dict[str, Any] = dict(row)
    values["request"] = EvaluationRequest.of(row["request"])
    values["last_state"] = None if row["last_state"] is None else EvaluationState(row["last_state"])
    return ScheduleRow(**values)
