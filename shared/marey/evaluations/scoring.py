"""Scoring of an evaluation: the input of its score item, and the transaction that ends it."""

from __future__ import annotations

import math
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import Conflict, NotFound
from marey.evaluations import tables
from marey.evaluations.repository import get_evaluation, load_prompts, lock_evaluation, move_evaluation
from marey.evaluations.states import EvaluationState
from marey.evaluations.types import (
    REPORT_FORMATS,
    EarlierRun,
    EvaluationRequest,
    EvaluationRow,
    MadeItem,
    NewScore,
    ScoreRows,
)
from marey.items.evaluation_prompts import EvaluationPrompt
from marey.jobs import tables as job_tables
from marey.jobs.journal import NewEvent, record
from marey.jobs.lease_rows import LeasedItems, document, drop_empty_lease, end_items, lock_lease
from marey.jobs.lease_types import AssetDigest, Committed
from marey.jobs.results import store_assets
from marey.jobs.states import Cause, ItemState
from marey.jobs.types import FailureReason

OWN = ("index", "variant", "prompt", "seconds", "seed", "frames", "fps", "elapsed", "licence")
HISTORY = 20
"""Number of runs in a report's trend."""

EVALUATION_OF_LEASE = sa.text("""
    SELECT evaluation.id FROM evaluation JOIN lease ON lease.job_id = evaluation.score_job_id
    WHERE lease.token = :token
""")


def load_score(conn: sa.Connection, job: UUID) -> ScoreRows:
    """Return the input of a job's score item.

    Raises:
        NotFound: no evaluation is scored by this job, or its data was deleted.
        Conflict: the evaluation has ended, or still needs motions.
    """
    table = tables.evaluation.c
    row = conn.execute(sa.select(table.tenant_id, table.id).where(table.score_job_id == job)).one_or_none()
    if row is None:
        raise NotFound("this job scores no evaluation", where=f"job {job}")
    evaluation = get_evaluation(conn, row.tenant_id, row.id)
    _refuse_over(evaluation)
    if evaluation.generation is None or evaluation.prompts is None:
        raise NotFound("the motions of this evaluation were deleted", where=f"evaluation {evaluation.id}")
    return ScoreRows(
        evaluation=evaluation,
        items=_made_items(conn, evaluation, evaluation.generation.id, evaluation.prompts),
        history=_history(conn, evaluation),
        baseline=_baseline(conn, evaluation),
    )


def commit_score(conn: sa.Connection, lease_token: UUID, score: NewScore) -> Committed:
    """End a score item and its evaluation: reports, summary, states, counters and events in this transaction.

    The files must be in the asset store and have been announced by `begin_assets`. If the evaluation had already
    ended, the item fails and nothing else is written.

    Raises:
        ValueError: an unknown report format, or a measure that is not a number.
    """
    _check(score)
    found = conn.execute(EVALUATION_OF_LEASE, {"token": lease_token}).scalar_one_or_none()
    evaluation = None if found is None else lock_evaluation(conn, found)  # before the job's lock: see `schema`
    leased = lock_lease(conn, lease_token, [score.item])
    if leased is None or score.item not in leased.items:
        return Committed((), (score.item,))
    if evaluation is None or evaluation.state is not EvaluationState.SCORING:
        _refuse(conn, leased, score.item)
    else:
        _write(conn, leased, evaluation, score)
    drop_empty_lease(conn, lease_token)
    return leased.committed([score.item])


def _check(score: NewScore) -> None:
    foreign = [name for name in score.files if name not in REPORT_FORMATS]
    if foreign or not score.files:
        raise ValueError(f"a report has some of the formats {REPORT_FORMATS}, not {foreign or 'none'}")
    wrong = [name for name, value in score.summary.items() if value is not None and not math.isfinite(value)]
    if wrong:
        raise ValueError(f"not finite, and no measure: {', '.join(wrong)}")


def _refuse(conn: sa.Connection, leased: LeasedItems, item: UUID) -> None:
    problem = document(FailureReason("conflict", "the evaluation had ended before this item was scored"))
    end_items(conn, [item], ItemState.FAILED, Cause.ERROR, problem=problem)
    event = NewEvent("item_failed", str(problem["message"]), item, {"problem": problem})
    record(conn, leased.job, [event], moved={(ItemState.LEASED, ItemState.FAILED): 1})


def _write(conn: sa.Connection, leased: LeasedItems, evaluation: EvaluationRow, score: NewScore) -> None:
    end_items(conn, [score.item], ItemState.SUCCEEDED, Cause.COMMITTED)
    event = NewEvent("progress", score.reason, data={"items": 1})
    record(conn, leased.job, [event], moved={(ItemState.LEASED, ItemState.SUCCEEDED): 1})
    digests = {file.sha256 for file in score.files.values()}
    assets = store_assets(conn, leased.job, digests)
    reports = [
        {"evaluation_id": evaluation.id, "format": name, "asset_id": assets[file.sha256]}
        for name, file in score.files.items()
    ]
    conn.execute(sa.insert(tables.evaluation_report), reports)
    done = {"summary": dict(score.summary), "regressed": score.regressed}
    move_evaluation(conn, evaluation, EvaluationState.DONE, score.reason, **done)


def _refuse_over(evaluation: EvaluationRow) -> None:
    if evaluation.state is not EvaluationState.SCORING:
        raise Conflict(f"it is {evaluation.state}, not scoring", where=f"evaluation {evaluation.id}")


def _made_items(conn: sa.Connection, evaluation: EvaluationRow, job: UUID, prompts: str) -> tuple[MadeItem, ...]:
    """Return the items of the generation with their npz, in one query."""
    asked = load_prompts(conn, evaluation.tenant, prompts)
    item, motion, file, asset = job_tables.item.c, job_tables.motion.c, job_tables.motion_file.c, job_tables.asset.c
    rows = conn.execute(
        sa.select(
            *(item.index, item.variant, item.prompt, item.seconds, item.seed, item.state, item.problem),
            *(motion.frames, motion.fps, motion.elapsed, motion.licence, asset.sha256, asset.size, asset.media_type),
        )
        .outerjoin(job_tables.motion, motion.item_id == item.id)
        .outerjoin(job_tables.motion_file, (file.motion_id == motion.id) & (file.format == "npz"))
        .outerjoin(job_tables.asset, asset.id == file.asset_id)
        .where(item.job_id == job)
        .order_by(item.position)
    )
    return tuple(_made_item(row, asked[int(row["index"])]) for row in rows.mappings())


def _made_item(row: sa.RowMapping, asked: EvaluationPrompt) -> MadeItem:
    own = {name: row[name] for name in OWN}
    return MadeItem(
        expected=asked.expected,
        constrained=asked.constraints is not None,
        state=ItemState(row["state"]),
        problem=None if row["problem"] is None else FailureReason(**row["problem"]),
        npz=None if row["sha256"] is None else AssetDigest(row["sha256"], row["size"], row["media_type"]),
        **own,
    )


def _history(conn: sa.Connection, evaluation: EvaluationRow) -> tuple[EarlierRun, ...]:
    """Return the last comparable runs, oldest first: of the same model and prompts, measured by the same evaluator."""
    table = tables.evaluation.c
    request = evaluation.request
    comparable = (
        (table.tenant_id == evaluation.tenant)
        & (table.prompts_sha256 == evaluation.prompts)
        & (table.state == EvaluationState.DONE)
        & (table.request["model"].astext == request.model)
        & (table.request["evaluator"].astext == request.evaluator)
    )
    return tuple(reversed(_earlier(conn, comparable, HISTORY)))


def _baseline(conn: sa.Connection, evaluation: EvaluationRow) -> EarlierRun | None:
    if evaluation.request.baseline is None:
        return None
    table = tables.evaluation.c
    ours = (table.tenant_id == evaluation.tenant) & (table.id == evaluation.request.baseline)
    return next(iter(_earlier(conn, ours, 1)), None)


def _earlier(conn: sa.Connection, wanted: sa.ColumnElement[bool], limit: int) -> list[EarlierRun]:
    """Return runs that are done, newest first."""
    table, report, asset = tables.evaluation.c, tables.evaluation_report.c, job_tables.asset.c
    query = (
        sa.select(
            *(table.id, table.name, table.request, table.summary, table.finished_at),
            *(asset.sha256, asset.size, asset.media_type),
        )
        .outerjoin(tables.evaluation_report, (report.evaluation_id == table.id) & (report.format == "json"))
        .outerjoin(job_tables.asset, asset.id == report.asset_id)
    )
    rows = conn.execute(query.where(wanted).order_by(table.finished_at.desc()).limit(limit))
    return [
        EarlierRun(
            *row[:2],
            EvaluationRequest.of(row.request),
            *row[3:5],
            report=None if row.sha256 is None else AssetDigest(*row[5:]),
        )
        for row in rows
    ]
