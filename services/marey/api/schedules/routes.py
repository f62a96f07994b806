"""`/v1/schedules`."""

from __future__ import annotations

from uuid import UUID

from fastapi import APIRouter, Request, Response

from marey import evaluations
from marey.api.audit import note
from marey.api.auth import Operator, Reader, Submitter
from marey.api.context import Connection, Shared
from marey.api.evaluations.routes import body_of
from marey.api.evaluations.schemas import EvaluationDetailView, EvaluationView
from marey.api.evaluations.service import detail
from marey.api.schedules import service
from marey.api.schedules.schemas import NewScheduleBody, SchedulePatch, ScheduleView
from marey.http.bodies import kept_body
from marey.http.problems import RESPONSES
from marey.http.schemas import Cursor, Limit, PageView

router = APIRouter(prefix="/v1/schedules", tags=["schedules"], responses=RESPONSES)


@router.post("", status_code=201, openapi_extra=body_of("NewScheduleBody"))
async def create_schedule(request: Request, response: Response, shared: Shared, key: Submitter) -> ScheduleView:
    """Create a schedule of recurring evaluations. Each run resolves the bundle names given here, exact or not."""
    async with kept_body(request, shared, key.tenant) as body:
        view = await body.run(service.create, shared, key, body.file)
    response.headers["Location"] = f"/v1/schedules/{view.id}"
    return view


@router.get("")
def list_schedules(conn: Connection, key: Reader, cursor: Cursor = None, limit: Limit = 50) -> PageView[ScheduleView]:
    """List schedules, newest first."""
    page = evaluations.list_schedules(conn, key.tenant, cursor=cursor, limit=limit)
    return PageView[ScheduleView].of(page, ScheduleView.of)


@router.get("/{schedule}")
def get_schedule(schedule: UUID, conn: Connection, key: Reader) -> ScheduleView:
    """Get one schedule."""
    return ScheduleView.of(evaluations.get_schedule(conn, key.tenant, schedule))


@router.patch("/{schedule}", openapi_extra=body_of("SchedulePatch"))
async def change_schedule(schedule: UUID, request: Request, shared: Shared, key: Operator) -> ScheduleView:
    """Change the given fields. After a pause, and with new times, it is next due at its next time from now."""
    async with kept_body(request, shared, key.tenant) as body:
        return await body.run(service.change, shared, key, schedule, body.file)


@router.delete("/{schedule}", status_code=204)
def delete_schedule(schedule: UUID, conn: Connection, key: Operator) -> None:
    """Delete a schedule. Its evaluations stay, and running ones continue."""
    evaluations.delete_schedule(conn, key.tenant, schedule)
    note(conn, key, "schedule.delete", schedule)


@router.post("/{schedule}/run", status_code=202)
def run_schedule(schedule: UUID, response: Response, conn: Connection, key: Submitter) -> EvaluationDetailView:
    """Plan an evaluation now, outside the schedule's times; also while it is paused."""
    made = evaluations.run_schedule(conn, key.tenant, schedule)
    note(conn, key, "schedule.run", schedule, evaluation=str(made))
    response.headers["Location"] = f"/v1/evaluations/{made}"
    return detail(conn, evaluations.get_evaluation(conn, key.tenant, made))


@router.get("/{schedule}/evaluations")
def list_runs(
    schedule: UUID, conn: Connection, key: Reader, cursor: Cursor = None, limit: Limit = 50
) -> PageView[EvaluationView]:
    """List the evaluations of a schedule, newest first."""
    evaluations.get_schedule(conn, key.tenant, schedule)
    page = evaluations.list_evaluations(conn, key.tenant, schedule=schedule, cursor=cursor, limit=limit)
    return PageView[EvaluationView].of(page, EvaluationView.of)


SCHEMAS = (NewScheduleBody, SchedulePatch)
"""Bodies that routes parse themselves, for the OpenAPI document."""
