"""`/v1/evaluations`."""

from __future__ import annotations

from typing import Annotated, Any, Literal
from uuid import UUID

from fastapi import APIRouter, Query, Request, Response

from marey import db, evaluations
from marey.api.audit import note
from marey.api.auth import Operator, Reader, Submitter
from marey.api.context import Connection, Shared, deadline
from marey.api.evaluations import service
from marey.api.evaluations.comparison import ComparisonView, compare_runs
from marey.api.evaluations.schemas import EvaluationDetailView, EvaluationView, NewEvaluationBody
from marey.api.files import FILE_RESPONSES, FileRequest, file_response
from marey.core.disposition import download_name
from marey.core.errors import NotFound
from marey.http.bodies import kept_body
from marey.http.problems import RESPONSES
from marey.http.schemas import Cursor, IdempotencyKey, Limit, PageView

router = APIRouter(prefix="/v1/evaluations", tags=["evaluations"], responses=RESPONSES)


def body_of(name: str) -> dict[str, Any]:
    """Return the OpenAPI schema of a body that the route parses itself."""
    schema = {"$ref": f"#/components/schemas/{name}"}
    return {"requestBody": {"required": True, "content": {"application/json": {"schema": schema}}}}


@router.post("", status_code=202, openapi_extra=body_of("NewEvaluationBody"))
async def begin_evaluation(
    request: Request,
    response: Response,
    shared: Shared,
    key: Submitter,
    idempotency_key: IdempotencyKey = None,
) -> EvaluationDetailView:
    """Plan an evaluation: its motions are made in the background, then measured. All invalid prompts are reported at
    once."""
    async with kept_body(request, shared, key.tenant) as body:
        view, replayed = await body.run(service.create, shared, key, body.file, idempotency_key)
    response.headers["Location"] = f"/v1/evaluations/{view.id}"
    if replayed:
        response.headers["Idempotency-Replayed"] = "true"
    return view


@router.get("")
@deadline(db.SEARCH)
def list_evaluations(
    conn: Connection,
    key: Reader,
    state: Annotated[list[evaluations.EvaluationState] | None, Query(description="Only those in these states.")] = None,
    cursor: Cursor = None,
    limit: Limit = 50,
) -> PageView[EvaluationView]:
    """List evaluations, newest first."""
    page = evaluations.list_evaluations(conn, key.tenant, states=state or (), cursor=cursor, limit=limit)
    return PageView[EvaluationView].of(page, EvaluationView.of)


@router.get("/{evaluation}")
def get_evaluation(evaluation: UUID, conn: Connection, key: Reader) -> EvaluationDetailView:
    """Get one evaluation, with its history."""
    return service.detail(conn, evaluations.get_evaluation(conn, key.tenant, evaluation))


@router.delete("/{evaluation}", status_code=202)
@deadline(db.BULK)
def cancel_evaluation(evaluation: UUID, conn: Connection, key: Operator) -> EvaluationDetailView:
    """Cancel an evaluation and its running job. One that has ended stays as it is."""
    note(conn, key, "evaluation.cancel", evaluation)
    return service.detail(conn, evaluations.cancel_evaluation(conn, key.tenant, evaluation))


@router.head("/{evaluation}/report/{format}", include_in_schema=False)
@router.get("/{evaluation}/report/{format}", response_class=Response, responses=FILE_RESPONSES)
def get_report(
    evaluation: UUID,
    format: Literal["html", "json", "md"],
    shared: Shared,
    conn: Connection,
    key: Reader,
    part: FileRequest,
) -> Response:
    """Get the report of an evaluation that is done; its ETag is its SHA-256."""
    row = evaluations.get_evaluation(conn, key.tenant, evaluation)
    file = next((f for f in EvaluationView.of(row).reports if f.format == format), None)
    if file is None:
        message = f"there is no such report: the evaluation is {row.state}"
        raise NotFound(message, where=str(evaluation), hint=row.reason)
    name = download_name(f"{row.name or 'evaluation'}_{row.id}", file.format)
    return file_response(shared, key.tenant, name, file, part)


@router.get("/{evaluation}/comparison")
def get_comparison(
    evaluation: UUID,
    before: Annotated[UUID, Query(description="The earlier run, of the same prompts and the same exact evaluator.")],
    shared: Shared,
    key: Reader,
) -> ComparisonView:
    """Compare another evaluation with this one, motion by motion, by paired bootstrap."""
    return compare_runs(shared, key.tenant, before, evaluation)


SCHEMAS = (NewEvaluationBody,)
"""Bodies that routes parse themselves, for the OpenAPI document."""
