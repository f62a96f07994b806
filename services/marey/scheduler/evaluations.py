"""Progress of evaluations, and their start by schedules. Every step is a transaction of its own under the lock of one
row, which another scheduler skips: several schedulers are harmless, and a killed one leaves no partial step."""

from __future__ import annotations

from collections.abc import Callable
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import MareyError, QuotaUsedUp, Unreachable
from marey.core.settings import Settings
from marey.db import BULK, transaction
from marey.evaluations import (
    MAX_MISSING,
    EvaluationJob,
    EvaluationRow,
    EvaluationState,
    check_baseline,
    due_schedules,
    fire_schedule,
    load_prompts,
    lock_evaluation,
    move_evaluation,
    open_evaluations,
    store_prompts,
)
from marey.evaluations.requests import plan_evaluation, scoring_job
from marey.items.problems import InvalidItems
from marey.jobs import ItemState, JobState, list_items, submit
from marey.jobs.states import ENDED
from marey.runtime.logs import logger

log = logger(__name__)

FAILED = (ItemState.FAILED, ItemState.DEAD)


class EvaluationScheduler:
    """The scheduler's work on evaluations, once per round."""

    def __init__(self, engine: sa.Engine, config: Settings) -> None:
        self._engine = engine
        self._config = config

    def round(self) -> None:
        """Start due evaluations, and advance every open one as far as possible.

        Raises:
            Unreachable: the database does not answer.
        """
        with transaction(self._engine) as conn:
            due = due_schedules(conn)
        for schedule in due:
            self._alone(self._fire, schedule)
        with transaction(self._engine) as conn:
            waiting = open_evaluations(conn)
        for evaluation in waiting:
            self._alone(self._step, evaluation)

    def _alone(self, act: Callable[[UUID], None], identifier: UUID) -> None:
        """Run an action for one evaluation; its errors do not block the others."""
        try:
            act(identifier)
        except Unreachable:
            raise
        except Exception:
            log.exception("evaluation_step_failed", id=str(identifier))

    def _fire(self, schedule: UUID) -> None:
        with transaction(self._engine) as conn:
            made = fire_schedule(conn, schedule)
        if made is not None:
            log.info("schedule_fired", schedule=str(schedule), evaluation=str(made))

    def _step(self, evaluation: UUID) -> None:
        with transaction(self._engine, BULK) as conn:
            row = lock_evaluation(conn, evaluation, skip_locked=True)
            if row is None:
                return
            if row.state is EvaluationState.PLANNED:
                self._begin(conn, row)
            elif row.state is EvaluationState.GENERATING:
                _after_generation(conn, row)
            elif row.state is EvaluationState.SCORING:
                _after_scoring(conn, row)

    def _begin(self, conn: sa.Connection, row: EvaluationRow) -> None:
        """planned → generating; or failed, when its inputs no longer exist, or exceed the tenant's quota for good.
        Waits for free quota."""
        try:
            with conn.begin_nested():  # a refused submit must leave nothing
                prompts = None if row.prompts is None else load_prompts(conn, row.tenant, row.prompts)
                plan = plan_evaluation(row.request, prompts, self._config)
                sha256 = row.prompts or store_prompts(conn, row.tenant, plan.prompts)
                check_baseline(conn, row.tenant, plan.request, sha256)
                job = submit(conn, plan.generation(row))
        except MareyError as error:
            if isinstance(error, Unreachable):
                raise
            if isinstance(error, QuotaUsedUp) and error.asked <= error.limit:
                return  # it fits once other jobs of the tenant are done
            _end(conn, row, EvaluationState.FAILED, f"it cannot start: {_as_line(error)}")
            return
        move_evaluation(
            conn,
            row,
            EvaluationState.GENERATING,
            f"{job.items} motions of {plan.request.bundle} requested",
            request=plan.request.as_json(),
            prompts_sha256=sha256,
            generate_job_id=job.id,
        )


def _after_generation(conn: sa.Connection, row: EvaluationRow) -> None:
    """generating → scoring, once its job has ended with enough motions."""
    job = row.generation
    if job is None:
        _end(conn, row, EvaluationState.FAILED, "the job that made its motions was deleted")
    elif job.state is JobState.CANCELLED:
        _end(conn, row, EvaluationState.CANCELLED, f"the job that made its motions was cancelled (job {job.id})")
    elif job.state in ENDED:
        missing = job.total - job.succeeded
        if missing > MAX_MISSING * job.total:
            _end(conn, row, EvaluationState.FAILED, _too_few(conn, row, job, missing))
            return
        scoring = submit(conn, scoring_job(row))
        reason = f"{job.succeeded} of {job.total} motions made; {row.request.evaluator} measures them"
        move_evaluation(conn, row, EvaluationState.SCORING, reason, score_job_id=scoring.id)


def _after_scoring(conn: sa.Connection, row: EvaluationRow) -> None:
    """scoring → failed, when its job ended without a score; a job with a score moves the evaluation to `done`
    itself."""
    job = row.scoring
    if job is None:
        _end(conn, row, EvaluationState.FAILED, "the job that measured it was deleted")
    elif job.state is JobState.CANCELLED:
        _end(conn, row, EvaluationState.CANCELLED, f"the job that measured it was cancelled (job {job.id})")
    elif job.state in ENDED:
        why = _first_problem(conn, row.tenant, job.id) or "it left no score"
        _end(conn, row, EvaluationState.FAILED, f"it could not be measured: {why} (job {job.id})")


def _end(conn: sa.Connection, row: EvaluationRow, state: EvaluationState, reason: str) -> None:
    move_evaluation(conn, row, state, reason)
    log.warning("evaluation_ended", evaluation=str(row.id), state=state, reason=reason)


def _too_few(conn: sa.Connection, row: EvaluationRow, job: EvaluationJob, missing: int) -> str:
    share = f"{missing} of {job.total} motions are missing, {missing / job.total:.1%}; the limit is {MAX_MISSING:.0%}"
    why = _first_problem(conn, row.tenant, job.id)
    return f"{share} (job {job.id})" + (f"; the first: {why}" if why else "")


def _as_line(error: MareyError) -> str:
    """Return an error as one line."""
    if isinstance(error, InvalidItems):
        return f"{error.total} prompts cannot be made; the first: {error.problems[0]}"
    return error.on_a_line


def _first_problem(conn: sa.Connection, tenant: str, job: UUID) -> str | None:
    """Return the reason of the first failed item."""
    failed = list_items(conn, tenant, job, states=FAILED, limit=1).rows
    if not failed:
        return None
    problem = failed[0].problem
    return problem.message if problem is not None else failed[0].reason
