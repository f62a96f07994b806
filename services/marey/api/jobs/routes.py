"""`/v1/jobs`."""

from __future__ import annotations

from typing import Annotated, Any, BinaryIO
from uuid import UUID

from fastapi import APIRouter, Header, Query, Request, Response
from fastapi.responses import JSONResponse

from marey import db, jobs, takes, tenants
from marey.api.audit import note
from marey.api.auth import Operator, Reader, Submitter
from marey.api.context import Connection, Context, Shared, deadline
from marey.api.jobs import service
from marey.api.jobs.estimates import QueueView, check_capacity
from marey.api.jobs.events import MAX_SEQ, EventStream, last_event_id, stream_events
from marey.api.jobs.poses import read_poses
from marey.api.jobs.schemas import (
    SCOPE,
    CheckedView,
    ErasureView,
    EventsView,
    EventView,
    ItemView,
    JobPatch,
    JobView,
    NewItemBody,
    NewJobBody,
    QualityCountsView,
    SubmittedView,
    report_fields,
)
from marey.api.takes.routes import Found
from marey.api.takes.schemas import MotionView
from marey.core import metrics, tracing
from marey.core.errors import InvalidInput
from marey.http import schemas
from marey.http.bodies import kept_body
from marey.http.json_bodies import UniqueKeysRoute
from marey.http.problems import RESPONSES
from marey.http.schemas import Cursor, IdempotencyKey, Limit, PageView
from marey.jobs.quality_counts import count_quality
from marey.jobs.states import ENDED
from marey.runtime.logs import logger
from marey.vocabulary.report import ScopeReport
from marey.vocabulary.scope import ScopePolicy

log = logger(__name__)

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], responses=RESPONSES, route_class=UniqueKeysRoute)

NDJSON = "application/x-ndjson"
JSON = "application/json"
SSE = "text/event-stream"


Reason = Annotated[schemas.Reason | None, Query(description="Reason, recorded in the job's events.")]


@router.post(
    "",
    status_code=202,
    response_model=SubmittedView,
    responses={200: {"model": CheckedView, "description": "`validate_only`: nothing was written"}},
    openapi_extra={
        "requestBody": {
            "required": True,
            "content": {
                JSON: {"schema": {"$ref": "#/components/schemas/NewJobBody"}},
                NDJSON: {"schema": {"$ref": "#/components/schemas/NewItemBody"}},
            },
        }
    },
)
async def submit_job(
    request: Request,
    shared: Shared,
    key: Submitter,
    name: Annotated[schemas.Name | None, Query()] = None,
    comment: Annotated[schemas.Comment | None, Query()] = None,
    priority: Annotated[int, Query(ge=-jobs.PRIORITY_LIMIT, le=jobs.PRIORITY_LIMIT)] = 0,
    fail_early: Annotated[float | None, Query(ge=0, le=1)] = None,
    keep_days: Annotated[int | None, Query(ge=1, le=jobs.MAX_KEEP_DAYS)] = None,
    scope: Annotated[ScopePolicy, Query(description=SCOPE)] = "warn",
    validate_only: Annotated[bool, Query(description="Check everything, write nothing.")] = False,
    idempotency_key: IdempotencyKey = None,
) -> Response:
    """Submit prompts: a JSON object with `items`, or NDJSON with one item a line (at most 100,000, 64 MiB).

    For NDJSON, fields of the job as a whole are in the query. All problems of all lines are reported at once, and
    then nothing is written.
    """
    kind = request.headers.get("content-type", JSON).partition(";")[0].strip().lower()
    fields = {
        "name": name,
        "comment": comment,
        "priority": priority,
        "fail_early": fail_early,
        "keep_days": keep_days,
        "scope": scope,
    }
    async with kept_body(request, shared, key.tenant) as body:
        submission = await body.run(_read, kind, body.file, fields, shared)
        sha256 = None
        if idempotency_key and not validate_only:
            sha256 = await body.run(service.request_sha256, str(request.url.query), body.file)
        if not submission.named.frames or not await body.run(_is_there, shared, key, idempotency_key, sha256):
            submission = await body.run(submission.with_poses, await read_poses(shared, key, submission.named))
        if validate_only:
            report = await body.run(submission.examine)
            if report is not None and report.left and (decided := await shared.texts.scopes(report.left)):
                report = await body.run(submission.examine, decided)
            return await body.run(_check, shared, key, submission, report)
        return await body.run(_write, shared, key, submission, idempotency_key, sha256)


def _is_there(shared: Context, key: tenants.ApiKey, idempotency_key: str | None, sha256: str | None) -> bool:
    """Return True if this submit made a job before; the motions that its poses were of may be gone."""
    if sha256 is None:
        return False
    with db.transaction(shared.engine, db.SEARCH) as conn:
        return jobs.find_submitted(conn, key.tenant, idempotency_key, sha256) is not None


def _read(kind: str, body: BinaryIO, fields: dict[str, Any], shared: Context) -> service.Submission:
    if kind == NDJSON:
        return service.read_ndjson(body, service.job_fields(fields), shared.catalogue)
    if kind == JSON:
        return service.read_document(body, shared.catalogue)
    raise InvalidInput(
        f"{kind[:60]!r} is not a supported media type", where="Content-Type", hint=f"{JSON} or {NDJSON}."
    )


def _check(
    shared: Context, key: tenants.ApiKey, submission: service.Submission, report: ScopeReport | None
) -> JSONResponse:
    with db.transaction(shared.engine, db.SEARCH) as conn:
        capacity = check_capacity(conn, key.tenant, submission.by_bundle)
    checked = CheckedView(
        valid=True,
        items=submission.count,
        bundles=submission.bundles,
        **capacity,
        scope=submission.fields.scope,
        **report_fields(report),
    )
    return JSONResponse(checked.model_dump(mode="json"))


def _write(
    shared: Context,
    key: tenants.ApiKey,
    submission: service.Submission,
    idempotency_key: str | None,
    sha256: str | None,
) -> JSONResponse:
    report = submission.new_report()
    new = jobs.NewJob(
        items=submission.new_items(report),
        tenant=key.tenant,
        count=submission.count,
        traceparent=tracing.current(),
        idempotency_key=idempotency_key,
        body_sha256=sha256,
        **submission.fields.model_dump(),
    )
    with tracing.span("submit", tenant=key.tenant) as span, db.transaction(shared.engine, db.BULK) as conn:
        submitted = jobs.submit(conn, new)
        row = jobs.get_job(conn, key.tenant, submitted.id)
        if not submitted.replayed:
            note(conn, key, "job.submit", row.id, items=row.total, priority=row.priority)
        span.set(job=str(submitted.id), items=submitted.items, replayed=submitted.replayed)
    log.info("submitted", job=str(submitted.id), tenant=key.tenant, items=submitted.items, replayed=submitted.replayed)
    headers = {"Location": f"/v1/jobs/{submitted.id}"}
    if submitted.replayed:
        headers["Idempotency-Replayed"] = "true"
        report = submission.examine()
    return JSONResponse(SubmittedView.with_report(row, report).model_dump(mode="json"), 202, headers=headers)


@router.get("")
@deadline(db.SEARCH)
def list_jobs(
    conn: Connection,
    key: Reader,
    state: Annotated[list[jobs.JobState] | None, Query()] = None,
    cursor: Cursor = None,
    limit: Limit = 50,
) -> PageView[JobView]:
    """List jobs, newest first."""
    page = jobs.list_jobs(conn, key.tenant, states=state or (), cursor=cursor, limit=limit)
    return PageView[JobView].of(page, JobView.of)


@router.get("/{job}")
def get_job(job: UUID, conn: Connection, key: Reader) -> JobView:
    """Get one job."""
    return JobView.of(jobs.get_job(conn, key.tenant, job))


@router.get("/{job}/queue")
@deadline(db.SEARCH)
def get_place(job: UUID, conn: Connection, key: Reader) -> QueueView:
    """Get the queue position of the job's items, and when it may be done: from measurements here, or no number."""
    return QueueView.of(jobs.place_of(conn, key.tenant, job))


@router.get("/{job}/quality")
@deadline(db.SEARCH)
def get_quality(job: UUID, conn: Connection, key: Reader) -> QualityCountsView:
    """Count the job's motions by their quality: how many have a flag, and which."""
    jobs.get_job(conn, key.tenant, job)
    return QualityCountsView.of(count_quality(conn, job))


@router.patch("/{job}")
@deadline(db.BULK)
def patch_job(job: UUID, patch: JobPatch, conn: Connection, key: Operator, reason: Reason = None) -> JobView:
    """Change the priority, the comment or the failure ratio that ends the job early.

    If more than that share has failed already, open items are cancelled at once.
    """
    row = jobs.get_job(conn, key.tenant, job)
    why = reason or f"set by {key.name}"
    if patch.priority is not None:
        row = jobs.set_priority(conn, key.tenant, job, patch.priority, why)
    if "fail_early" in patch.model_fields_set:
        row = jobs.set_fail_early(conn, key.tenant, job, patch.fail_early, why)
    if "comment" in patch.model_fields_set:
        row = jobs.set_comment(conn, key.tenant, job, patch.comment)
    if patch.model_fields_set:
        fields = sorted(patch.model_fields_set)
        note(conn, key, "job.change", job, fields=fields, priority=patch.priority, reason=reason)
    return JobView.of(row)


@router.delete("/{job}", status_code=204, response_class=Response)
@deadline(db.BULK)
def delete_job(job: UUID, conn: Connection, key: Operator) -> None:
    """Delete a job that has ended, with its motions."""
    takes.delete(conn, key.tenant, job)
    note(conn, key, "job.delete", job)


@router.post("/{job}/pause")
@deadline(db.BULK)
def pause_job(job: UUID, conn: Connection, key: Operator, reason: Reason = None) -> JobView:
    """Stop starting items of a job; items in progress are finished."""
    note(conn, key, "job.pause", job, reason=reason)
    return JobView.of(jobs.pause(conn, key.tenant, job, reason or f"paused by {key.name}"))


@router.post("/{job}/resume")
@deadline(db.BULK)
def resume_job(job: UUID, conn: Connection, key: Operator, reason: Reason = None) -> JobView:
    """Resume a paused job."""
    note(conn, key, "job.resume", job, reason=reason)
    return JobView.of(jobs.resume(conn, key.tenant, job, reason or f"resumed by {key.name}"))


@router.post("/{job}/cancel")
@deadline(db.BULK)
def cancel_job(job: UUID, conn: Connection, key: Operator, reason: Reason = None) -> JobView:
    """Cancel all open items of a job."""
    before = jobs.get_job(conn, key.tenant, job).cancelled
    note(conn, key, "job.cancel", job, reason=reason)
    row = jobs.cancel(conn, key.tenant, job, reason or f"cancelled by {key.name}")
    metrics.CANCELLED.inc(max(0, row.cancelled - before))
    return JobView.of(row)


@router.post("/{job}/retry")
@deadline(db.BULK)
def retry_job(
    job: UUID,
    conn: Connection,
    key: Operator,
    failed_only: Annotated[bool, Query(description="Leave cancelled items as they are.")] = False,
    reason: Reason = None,
) -> JobView:
    """Retry failed, dead and cancelled items."""
    note(conn, key, "job.retry", job, failed_only=failed_only, reason=reason)
    why = reason or f"retried by {key.name}"
    return JobView.of(jobs.retry(conn, key.tenant, job, failed_only=failed_only, reason=why))


@router.post("/{job}/erase")
@deadline(db.BULK)
def erase_job(job: UUID, conn: Connection, key: Operator) -> ErasureView:
    """Erase the prompts of a job that has ended, and of every edit of its motions; motions, names and tags stay.

    Prompts in the database are erased at once. Files that hold them are no longer served, and rewritten within
    minutes: `files_left` counts the remaining ones. This cannot be undone.
    """
    erased = takes.erase(conn, key.tenant, job, by=key.name)
    note(conn, key, "job.erase", job)
    return ErasureView(**vars(erased))


@router.get("/{job}/items")
@deadline(db.SEARCH)
def list_items(
    job: UUID,
    conn: Connection,
    key: Reader,
    state: Annotated[list[jobs.ItemState] | None, Query()] = None,
    review: Annotated[
        list[jobs.Review] | None, Query(description="Only items whose motion has one of these review states.")
    ] = None,
    cursor: Cursor = None,
    limit: Limit = 100,
) -> PageView[ItemView]:
    """List items with their motions, in input order, variants within prompt; re-rolls come last."""
    page = jobs.list_items(conn, key.tenant, job, states=state or (), reviews=review or (), cursor=cursor, limit=limit)
    return PageView[ItemView].of(page, ItemView.of)


@router.get("/{job}/motions")
@deadline(db.SEARCH)
def list_job_motions(
    job: UUID, conn: Connection, key: Reader, found: Found, cursor: Cursor = None, limit: Limit = 100
) -> PageView[MotionView]:
    """List motions of a job that match all filters, in creation order."""
    page = takes.list_motions(conn, key.tenant, job=job, found=found, cursor=cursor, limit=limit)
    return PageView[MotionView].of(page, MotionView.of)


@router.get(
    "/{job}/events",
    response_model=EventsView,
    responses={
        200: {"content": {SSE: {"schema": {"type": "string"}}}, "description": "Events, as a page or as a stream"},
        204: {"description": "The job has ended and every event was sent: do not reconnect"},
    },
)
def list_events(
    job: UUID,
    request: Request,
    shared: Shared,
    conn: Connection,
    key: Reader,
    after: Annotated[int, Query(ge=0, le=MAX_SEQ, description="Events with a greater `seq`.")] = 0,
    limit: Limit = 500,
    last: Annotated[str | None, Header(alias="Last-Event-ID", description="Overrides `after`; for streams.")] = None,
) -> Response:
    """List events after a `seq`: a page of JSON, or a stream where `Accept` asks for `text/event-stream`.

    A stream sends at most two progress messages a second. It ends with the job, or within seconds after the key
    becomes invalid; a new request then reports the reason.
    """
    row = jobs.get_job(conn, key.tenant, job)
    if SSE not in request.headers.get("accept", ""):
        events = jobs.events_after(conn, key.tenant, job, after, limit)
        following = events[-1].seq if len(events) == limit else None
        page = EventsView(items=[EventView.of(event) for event in events], next=following)
        return JSONResponse(page.model_dump(mode="json"))
    seq = last_event_id(last, after)
    if row.state in ENDED and seq >= row.event_seq:
        return Response(status_code=204)
    return EventStream(shared.event_streams, key, stream_events(shared.broadcaster, key, job, seq))


SCHEMAS = (NewJobBody, NewItemBody)
"""Bodies that routes parse themselves, for the OpenAPI document."""
