"""Validation of schedule requests. Bundles are resolved to check that it can run; the schedule keeps the names."""

from __future__ import annotations

from typing import BinaryIO
from uuid import UUID

from marey import db, evaluations, tenants
from marey.api.audit import note
from marey.api.context import Context
from marey.api.evaluations.schemas import AskedFields
from marey.api.evaluations.service import parse_evaluation, prompts_document, stored
from marey.api.jobs.service import read_fields
from marey.api.schedules.schemas import NewScheduleBody, ScheduleFields, SchedulePatch, ScheduleView
from marey.core.errors import InvalidInput

HINT = 'Write {"cron": "0 3 * * 1", "bundle": "hgm3", "split": "test"}.'


def create(shared: Context, key: tenants.ApiKey, body: BinaryIO) -> ScheduleView:
    """Create a schedule.

    Raises:
        InvalidItems, InvalidInput, InvalidBundle, Refused: invalid times, or an evaluation that cannot run.
    """
    document = prompts_document(body, hint=HINT)
    fields, asked = parse_evaluation(NewScheduleBody, document.fields(), document)
    plan = asked.planned(shared.config)
    with db.transaction(shared.engine) as conn:
        sha256 = stored(conn, key.tenant, plan)
        new = evaluations.NewSchedule(
            tenant=key.tenant,
            cron=fields.cron,
            time_zone=fields.time_zone,
            request=asked.request,
            prompts=None if asked.prompts is None else sha256,
            name=fields.name,
        )
        made = evaluations.create_schedule(conn, new)
        note(conn, key, "schedule.create", made, bundle=asked.request.bundle)
        return ScheduleView.of(evaluations.get_schedule(conn, key.tenant, made))


def change(shared: Context, key: tenants.ApiKey, schedule: UUID, body: BinaryIO) -> ScheduleView:
    """Change a schedule.

    Raises:
        NotFound: there is no such schedule.
        InvalidItems, InvalidInput, InvalidBundle, Refused: as `create`.
    """
    document = prompts_document(body, at=("request", "prompts"), hint='Write {"paused": true}.')
    values = document.fields()
    request = values.pop("request", None)
    if request is not None and not isinstance(request, dict):
        raise InvalidInput("is not an object", where="request", hint=HINT)
    fields = read_fields(ScheduleFields, values, SchedulePatch)
    asked = None if request is None else parse_evaluation(AskedFields, request, document)[1]
    plan = None if asked is None else asked.planned(shared.config)
    with db.transaction(shared.engine) as conn:
        changed = None
        if asked is not None and plan is not None:
            sha256 = stored(conn, key.tenant, plan)
            changed = (asked.request, None if asked.prompts is None else sha256)
        change = evaluations.ScheduleChange(**fields.model_dump(), request=changed)
        note(conn, key, "schedule.change", schedule, fields=sorted(fields.model_fields_set))
        return ScheduleView.of(evaluations.change_schedule(conn, key.tenant, schedule, change))
