"""Evaluations: rows with state and reason. Their work is done by ordinary jobs.

Every change of state happens under the lock of the evaluation's row, which precedes the locks of its jobs, and
writes an event with its reason. `scoring.py` moves an evaluation to `done`.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert

from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.db.pages import PAGE, Order, Page, cut_page, mark_of, page_limit
from marey.db.sql import CLOCK, check_text
from marey.evaluations import tables
from marey.evaluations.states import EVALUATION_TRANSITIONS, OPEN_EVALUATIONS, EvaluationState
from marey.evaluations.types import (
    EvaluationEvent,
    EvaluationJob,
    EvaluationRequest,
    EvaluationRow,
    NewEvaluation,
    ReportFile,
)
from marey.items.evaluation_prompts import EvaluationPrompt, prompts_of, prompts_sha256
from marey.jobs import tables as job_tables
from marey.jobs.files import files_of
from marey.jobs.idempotency import take_key
from marey.jobs.operate import cancel
from marey.jobs.states import ENDED, JobState
from marey.jobs.workers import live_workers
from marey.webhooks.outbox import enqueue_event
from marey.webhooks.types import EventKind


def store_prompts(conn: sa.Connection, tenant: str, prompts: Sequence[EvaluationPrompt]) -> str:
    """Store prompts once, however often they are used; return their digest."""
    sha256 = prompts_sha256(prompts)
    rows = [prompt.as_json() for prompt in prompts]
    new = insert(tables.prompt_set).values(tenant_id=tenant, sha256=sha256, count=len(rows), prompts=rows)
    # The update changes nothing, but locks the row until the referring row is committed: see `remove_unused_prompts`.
    key = ["tenant_id", "sha256"]
    conn.execute(new.on_conflict_do_update(index_elements=key, set_={"count": new.excluded.count}))
    return sha256


def remove_unused_prompts(conn: sa.Connection) -> int:
    """Remove prompt sets without a schedule or evaluation; return their number."""
    table, schedule, evaluation = tables.prompt_set, tables.schedule.c, tables.evaluation.c
    unused = ~(
        sa.exists().where(schedule.tenant_id == table.c.tenant_id, schedule.prompts_sha256 == table.c.sha256)
        | sa.exists().where(evaluation.tenant_id == table.c.tenant_id, evaluation.prompts_sha256 == table.c.sha256)
    )
    # Locked first, checked again afterwards: no transaction can start to refer to a locked row, and the second
    # statement sees earlier references.
    lock = sa.select(table.c.tenant_id, table.c.sha256).where(unused).with_for_update(skip_locked=True, of=table)
    found = [tuple(row) for row in conn.execute(lock)]
    if not found:
        return 0
    ours = sa.tuple_(table.c.tenant_id, table.c.sha256).in_(found)
    return conn.execute(sa.delete(table).where(ours, unused)).rowcount


def load_prompts(conn: sa.Connection, tenant: str, sha256: str) -> tuple[EvaluationPrompt, ...]:
    """Return the prompts of a digest.

    Raises:
        NotFound: the tenant has none of that digest.
    """
    table = tables.prompt_set.c
    query = sa.select(table.prompts).where(table.tenant_id == tenant, table.sha256 == sha256)
    rows = conn.execute(query).scalar_one_or_none()
    if rows is None:
        raise NotFound("there are no such prompts", where=f"prompts {sha256[:12]}")
    return prompts_of(rows)


def create_evaluation(conn: sa.Connection, new: NewEvaluation) -> UUID | None:
    """Plan an evaluation; None if its schedule has one for that time already. With an idempotency key that was used for
    the same request within 24 hours, return the id of the earlier evaluation.

    Raises:
        InvalidInput: text that the database cannot hold.
        IdempotencyMismatch: the key was used with another request.
    """
    check_text(new.name, "name")
    check_text(new.comment, "comment")
    earlier = take_key(conn, new.tenant, new.idempotency_key, new.body_sha256, "evaluation_id", new.id)
    if earlier is not None:
        return earlier
    row = insert(tables.evaluation).values(
        id=new.id,
        tenant_id=new.tenant,
        schedule_id=new.schedule,
        due_at=new.due,
        name=new.name,
        comment=new.comment,
        request=new.request.as_json(),
        prompts_sha256=new.prompts,
        reason=new.reason,
    )
    made = conn.execute(
        row.on_conflict_do_nothing(index_elements=["schedule_id", "due_at"]).returning(tables.evaluation.c.id)
    ).scalar_one_or_none()
    if made is not None:
        _note(conn, new.id, EvaluationState.PLANNED, new.reason)
    return made


def get_evaluation(conn: sa.Connection, tenant: str, evaluation: UUID) -> EvaluationRow:
    """Return one evaluation.

    Raises:
        NotFound: the tenant has no such evaluation.
    """
    table = tables.evaluation.c
    found = _read(conn, _evaluations().where(table.tenant_id == tenant, table.id == evaluation))
    if not found:
        raise _no_such_evaluation(evaluation)
    return found[0]


def list_evaluations(
    conn: sa.Connection,
    tenant: str,
    *,
    schedule: UUID | None = None,
    states: Collection[EvaluationState] = (),
    cursor: str | None = None,
    limit: int = PAGE,
) -> Page[EvaluationRow]:
    """Return evaluations, newest first, optionally of a schedule or in the given states."""
    table = tables.evaluation.c
    ours = table.tenant_id == tenant
    query, order = _evaluations().where(ours), Order(table.created_at, table.id)
    if schedule is not None:
        query = query.where(table.schedule_id == schedule)
    if states:
        query = query.where(table.state.in_([str(state) for state in states]))
    if cursor is not None:
        query = query.where(order.after(cursor, ours))
    rows = _read(conn, query.order_by(*order.by()).limit(page_limit(limit) + 1))
    return cut_page(rows, limit, lambda row: mark_of(row.created, row.id))


def evaluation_events(conn: sa.Connection, evaluation: UUID) -> list[EvaluationEvent]:
    """Return the changes of state of an evaluation, in order."""
    table = tables.evaluation_event.c
    query = sa.select(table.state, table.reason, table.at).where(table.evaluation_id == evaluation).order_by(table.at)
    return [EvaluationEvent(EvaluationState(state), reason, at) for state, reason, at in conn.execute(query)]


def check_baseline(conn: sa.Connection, tenant: str, request: EvaluationRequest, prompts: str) -> None:
    """Validate that the requested baseline, if any, is comparable: done, of the same prompts, measured by the same
    evaluator. Distances in the space of another evaluator are other numbers.

    Raises:
        InvalidInput: it is not comparable.
    """
    if request.baseline is None:
        return
    try:
        baseline = get_evaluation(conn, tenant, request.baseline)
    except NotFound as error:
        raise InvalidInput(error.message, where="baseline", hint=error.hint) from error
    check_comparable(baseline, prompts=prompts, evaluator=request.evaluator, where="baseline")


def check_comparable(run: EvaluationRow, *, prompts: str | None, evaluator: str | None, where: str) -> None:
    """Validate that a run is comparable, given the digest of the prompts and the exact evaluator: done, of the same
    prompts, measured by the same evaluator.

    Raises:
        InvalidInput: it is not comparable; `where` is the field that names the run.
    """
    other = None
    if run.state is not EvaluationState.DONE:
        other = f"is {run.state}, not done"
    elif run.prompts != prompts:
        other = f"was made with other prompts ({run.request.source})"
    elif run.request.evaluator != evaluator:
        other = f"was measured by {run.request.evaluator}, not by {evaluator}"
    if other is not None:
        raise InvalidInput(f"evaluation {run.id} {other}", where=where, hint="Choose another.")


def evaluation_waits_for(conn: sa.Connection, row: EvaluationRow) -> str | None:
    """Return the queue that an open evaluation waits for: it holds the evaluation's work and no live worker serves
    it."""
    job = row.scoring if row.state is EvaluationState.SCORING else row.generation
    if row.state not in OPEN_EVALUATIONS or job is None or job.state in ENDED:
        return None
    lane = job_tables.lane.c
    queues = conn.execute(
        sa.select(lane.queue).distinct().where(lane.job_id == job.id, lane.ready + lane.solo > 0)
    ).scalars()
    living = live_workers(conn)
    idle = sorted(queue for queue in queues if queue not in living)
    return f"a worker of the queue {' and '.join(idle)}: none is running" if idle else None


# --- changes of state ---


def open_evaluations(conn: sa.Connection) -> list[UUID]:
    """Return open evaluations, oldest first."""
    table = tables.evaluation.c
    return list(conn.execute(sa.select(table.id).where(table.finished_at.is_(None)).order_by(table.id)).scalars())


def lock_evaluation(conn: sa.Connection, evaluation: UUID, *, skip_locked: bool = False) -> EvaluationRow | None:
    """Lock an evaluation's row until the transaction ends; None if there is none (or, with `skip_locked`, it is
    locked)."""
    table = tables.evaluation.c
    lock = sa.select(table.id).where(table.id == evaluation)
    # NO KEY: reports and events that refer to the row may be inserted meanwhile.
    locked = conn.execute(lock.with_for_update(key_share=True, skip_locked=skip_locked)).one_or_none()
    return None if locked is None else _read(conn, _evaluations().where(table.id == evaluation))[0]


def move_evaluation(
    conn: sa.Connection, row: EvaluationRow, state: EvaluationState, reason: str, **values: object
) -> None:
    """Move a locked evaluation to another state.

    Raises:
        ValueError: the transition is not allowed.
    """
    if state not in EVALUATION_TRANSITIONS[row.state]:
        raise ValueError(f"an evaluation may not go from {row.state} to {state}")
    times: dict[str, object] = {}
    if state not in OPEN_EVALUATIONS:
        times["finished_at"] = CLOCK
    elif row.started is None:
        times["started_at"] = CLOCK
    table = tables.evaluation
    changed = {"state": state, "reason": reason, **times, **values}
    conn.execute(sa.update(table).where(table.c.id == row.id).values(changed))
    _note(conn, row.id, state, reason)
    if state not in OPEN_EVALUATIONS:
        regressed = values.get("regressed")
        has_regressed = None if regressed is None else bool(regressed)
        enqueue_evaluation_event(conn, row.tenant, row.id, state, schedule=row.schedule, regressed=has_regressed)


def cancel_evaluation(
    conn: sa.Connection, tenant: str, evaluation: UUID, reason: str = "cancelled by operator"
) -> EvaluationRow:
    """Cancel an evaluation and its running job; existing motions stay. Ended already: no change.

    Raises:
        NotFound: the tenant has no such evaluation.
    """
    row = lock_evaluation(conn, evaluation)
    if row is None or row.tenant != tenant:
        raise _no_such_evaluation(evaluation)
    if row.state in OPEN_EVALUATIONS:
        for job in (row.generation, row.scoring):
            if job is not None and job.state not in ENDED:
                cancel(conn, tenant, job.id, f"its evaluation was cancelled: {reason}")
        move_evaluation(conn, row, EvaluationState.CANCELLED, reason)
    return get_evaluation(conn, tenant, evaluation)


# --- helpers ---


def _no_such_evaluation(evaluation: UUID) -> NotFound:
    return NotFound(
        "there is no such evaluation", where=f"evaluation {evaluation}", hint="`marey eval list` shows yours."
    )


def _note(conn: sa.Connection, evaluation: UUID, state: EvaluationState, reason: str) -> None:
    event = {"evaluation_id": evaluation, "state": state, "reason": reason, "at": CLOCK}
    conn.execute(sa.insert(tables.evaluation_event).values(event))


def _evaluations() -> sa.Select[*tuple[Any, ...]]:
    c, prompts = tables.evaluation.c, tables.prompt_set.c
    jobs = {"generation": job_tables.job.alias("generation"), "scoring": job_tables.job.alias("scoring")}
    return (
        sa.select(
            *(c.id, c.tenant_id.label("tenant"), c.schedule_id.label("schedule"), c.due_at.label("due"), c.name),
            *(c.comment, c.request, c.prompts_sha256.label("prompts"), prompts.count.label("prompt_count")),
            *(c.state, c.reason, c.summary, c.regressed, c.created_at.label("created")),
            *(c.started_at.label("started"), c.finished_at.label("finished")),
            *(
                job.c[name].label(f"{what}_{name}")
                for what, job in jobs.items()
                for name in ("id", "state", "total", "succeeded", "ready", "leased", "started_at", "finished_at")
            ),
        )
        .outerjoin(tables.prompt_set, (prompts.tenant_id == c.tenant_id) & (prompts.sha256 == c.prompts_sha256))
        .outerjoin(jobs["generation"], jobs["generation"].c.id == c.generate_job_id)
        .outerjoin(jobs["scoring"], jobs["scoring"].c.id == c.score_job_id)
    )


def _read(conn: sa.Connection, query: sa.Select[Any]) -> list[EvaluationRow]:
    """Return evaluations with their reports, in two queries."""
    rows = conn.execute(query).mappings().all()
    reports = files_of(conn, tables.evaluation_report.c.evaluation_id, [row["id"] for row in rows], ReportFile)
    return [_row(row, tuple(reports[row["id"]])) for row in rows]


def _row(row: sa.RowMapping, reports: tuple[ReportFile, ...]) -> EvaluationRow:
    values: dict[str, Any] = {name: row[name] for name in EvaluationRow.__dataclass_fields__ if name in row}
    values.update(
        request=EvaluationRequest.of(row["request"]),
        state=EvaluationState(row["state"]),
        generation=_job(row, "generation"),
        scoring=_job(row, "scoring"),
        reports=reports,
    )
    return EvaluationRow(**values)


def _job(row: sa.RowMapping, what: str) -> EvaluationJob | None:
    if row[f"{what}_id"] is None:
        return None
    total = row[f"{what}_total"]
    return EvaluationJob(
        id=row[f"{what}_id"],
        state=JobState(row[f"{what}_state"]),
        total=total,
        succeeded=row[f"{what}_succeeded"],
        ended=total - row[f"{what}_ready"] - row[f"{what}_leased"],
        started=row[f"{what}_started_at"],
        finished=row[f"{what}_finished_at"],
    )


def enqueue_evaluation_event(
    conn: sa.Connection,
    tenant: str,
    evaluation: UUID,
    state: EvaluationState,
    *,
    schedule: UUID | None,
    regressed: bool | None,
) -> None:
    """Enqueue a webhook event for an evaluation that ended, and another one if it is worse than its baseline."""
    data = {"evaluation": evaluation, "state": state, "schedule": schedule, "regressed": regressed}
    enqueue_event(conn, tenant, EventKind.EVALUATION_ENDED, data)
    if regressed:
        enqueue_event(conn, tenant, EventKind.EVALUATION_REGRESSED, data)


def refuse_needed(conn: sa.Connection, tenant: str, job: UUID) -> None:
    """Validate that no open evaluation uses this job. The evaluation's row is locked, before the job's.

    Raises:
        Conflict: an open evaluation uses the job.
    """
    table = tables.evaluation.c
    ours = (table.tenant_id == tenant) & ((table.generate_job_id == job) | (table.score_job_id == job))
    rows = conn.execute(sa.select(table.id, table.finished_at).where(ours).order_by(table.id).with_for_update())
    needed = next((row.id for row in rows if row.finished_at is None), None)
    if needed is not None:
        raise Conflict(
            f"evaluation {needed} needs this job",
            where=f"job {job}",
            hint=f"Wait for it, or cancel it: `marey eval cancel {needed}`.",
        )
