"""`/v1/motions/{motion}/edits` and `…/revert`."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Mapping
from typing import Annotated
from uuid import UUID

from anyio import from_thread
from fastapi import APIRouter, Query, Response
from fastapi.responses import JSONResponse

from marey import db, jobs, takes
from marey.api.audit import note
from marey.api.auth import Submitter
from marey.api.context import Connection, Context, Shared, deadline
from marey.api.edits.schemas import CheckedEditView, NewEditBody
from marey.api.jobs.estimates import check_capacity
from marey.api.jobs.schemas import SubmittedView, report_fields
from marey.api.takes.schemas import MotionView
from marey.bundles import named_by
from marey.bundles.scope import examine_prompts
from marey.core import tracing
from marey.core.errors import InvalidInput, NotFound
from marey.http.json_bodies import UniqueKeysRoute
from marey.http.problems import RESPONSES
from marey.http.schemas import IdempotencyKey
from marey.motion.edits.steps import prompts_of_steps, read_steps
from marey.runtime.logs import logger
from marey.vocabulary.report import ScopeReport
from marey.vocabulary.scope import Scope

log = logger(__name__)

router = APIRouter(prefix="/v1/motions", tags=["motions"], responses=RESPONSES, route_class=UniqueKeysRoute)


@router.post(
    "/{motion}/edits",
    status_code=202,
    response_model=SubmittedView,
    responses={200: {"model": CheckedEditView, "description": "`validate_only`: nothing was written"}},
)
@deadline(db.BULK)
def edit_motion(
    motion: UUID,
    body: NewEditBody,
    conn: Connection,
    response: Response,
    key: Submitter,
    shared: Shared,
    validate_only: Annotated[bool, Query(description="Check everything, write nothing.")] = False,
    idempotency_key: IdempotencyKey = None,
) -> SubmittedView | Response:
    """Edit a motion: cut, join, loop, mirror, retime or smooth it, or let a model generate frames of it. The motion
    itself does not change.

    The job has an item for each resulting motion, with the name, the tags and the seed of the edited one.
    """
    new = takes.NewEdit(
        motion,
        body.ops,
        generator=_generator(body, shared),
        tenant=key.tenant,
        idempotency_key=idempotency_key,
        body_sha256=_sha256(motion, body) if idempotency_key else None,
        traceparent=tracing.current(),
        **body.model_dump(exclude={"ops", "model", "settings"}),
    )
    report = _examine(body, new)
    if validate_only:
        if report is not None and report.left and (decided := from_thread.run(shared.texts.scopes, report.left)):
            report = _examine(body, new, decided)
        return JSONResponse(_check(conn, new, report).model_dump(mode="json"))
    submitted = takes.submit_edit(conn, new)
    row = jobs.get_job(conn, key.tenant, submitted.id)
    response.headers["Location"] = f"/v1/jobs/{submitted.id}"
    if submitted.replayed:
        response.headers["Idempotency-Replayed"] = "true"
    else:
        note(conn, key, "motion.edit", motion, job=str(row.id), items=row.total)
    log.info("submitted", job=str(row.id), tenant=key.tenant, items=row.total, replayed=submitted.replayed)
    return SubmittedView.with_report(row, report)


@router.post("/{motion}/revert")
def revert_motion(motion: UUID, conn: Connection, key: Submitter) -> MotionView:
    """Go back from an edit to the motion that it was made from, and return that one; idempotent. Nothing is deleted.

    The edit becomes rejected. Its source becomes kept if the edit was, and is no longer rejected.
    """
    source = takes.revert(conn, key.tenant, motion, by=key.name)
    note(conn, key, "motion.revert", motion, source=str(source.id))
    return MotionView.of(source)


def _examine(
    body: NewEditBody, new: takes.NewEdit, decided: Mapping[tuple[str, str], Scope] | None = None
) -> ScopeReport | None:
    """Return the report on the scopes of the prompts that the model reads; None if there are none to examine.

    Args:
        decided: the encoder's verdicts, by bundle and prompt; None = judged by words alone.

    Raises:
        OutOfScope: scope `refuse`, and prompts name actions that the model does not know.
    """
    prompts = prompts_of_steps(read_steps(body.ops))
    if new.generator is None or not prompts:
        return None
    return examine_prompts(prompts, new.generator.capabilities.bundle, body.scope, decided=decided)


def _check(conn: Connection, new: takes.NewEdit, report: ScopeReport | None) -> CheckedEditView:
    items = takes.check_edit(conn, new)
    by_bundle = Counter((item.model, item.bundle) for item in items)
    return CheckedEditView(
        valid=True,
        items=len(items),
        bundles=sorted({item.bundle for item in items}),
        prompts=[item.prompt for item in items],
        **check_capacity(conn, new.tenant, by_bundle, parsed=new.generator is not None),
        **report_fields(report),
    )


def _generator(body: NewEditBody, shared: Context) -> takes.EditGenerator | None:
    """Return the bundle that generates frames; None if no operation needs one and none is named."""
    if body.model is None and not takes.needs_model(read_steps(body.ops)):
        if body.settings:
            raise InvalidInput("no operation generates frames, so no settings are used", where="settings")
        return None
    try:
        with named_by("model"):
            return takes.EditGenerator(shared.catalogue.capabilities(body.model), body.settings)
    except NotFound as error:
        raise InvalidInput(error.message, where="model", hint=error.hint) from error


def _sha256(motion: UUID, body: NewEditBody) -> str:
    """Return the digest that identifies equal edits; the values of operations are not checked yet."""
    given = json.dumps(body.model_dump(), ensure_ascii=False, separators=(",", ":"))
    return hashlib.sha256(f"edits {motion}\n{given}".encode(errors="surrogatepass")).hexdigest()
