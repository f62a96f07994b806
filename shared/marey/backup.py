"""Conversion of ended jobs to records of a backup, and back. The caller chooses where the records are kept."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Literal, TypeVar
from uuid import UUID, uuid4

import sqlalchemy as sa
from pydantic import AfterValidator, AwareDatetime, BaseModel, ConfigDict, Field, model_validator
from sqlalchemy import exc
from sqlalchemy.dialects.postgresql import insert

from marey.core.errors import Conflict, InvalidFile, InvalidInput
from marey.core.validation import worded
from marey.db.ids import new_id
from marey.db.sql import CLOCK, among
from marey.items.constraints import named_motions, read_constraints
from marey.items.timeline import read_timeline
from marey.jobs import tables
from marey.jobs.lease_types import AssetDigest
from marey.jobs.states import ENDED, ItemStage, JobControl, JobKind, Review
from marey.jobs.types import EVALUATOR_QUEUE, NO_TEXT, PRIORITY_LIMIT, SEED_LIMIT, TEXT_QUEUE, Edits
from marey.motion.provenance import check_manifest
from marey.vocabulary.scope import ScopePolicy, Verdict

CHUNK = 1000  # rows per statement
Row = TypeVar("Row")
Sha256 = Annotated[str, Field(pattern=worded(r"^[0-9a-f]{64}$", "64 digits of hexadecimal numbers"))]


class _Record(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class _Reason(_Record):
    """The reason why an item failed, as `FailureReason`."""

    type: str
    message: str
    where: str | None = None
    hint: str | None = None


class _NamedAction(_Record):
    text: str
    verdict: Verdict
    action: str | None = None
    read_as: str | None = None


class _Scope(_Record):
    """The scope of a prompt, as `Scope.as_json` writes it; flags may be those of another release."""

    version: int
    by: Literal["words", "encoder"]
    verdict: Verdict
    actions: list[_NamedAction]
    flags: list[str]
    rows: list[_Scope] = Field(default_factory=list["_Scope"])


def _of_form(record: type[_Record]) -> AfterValidator:
    """Return a check that an object has the form of a record; it stays as it was written."""

    def check(value: dict[str, Any]) -> dict[str, Any]:
        record.model_validate(value)
        return value

    return AfterValidator(check)


def _as_manifest(value: dict[str, Any]) -> dict[str, Any]:
    try:
        return check_manifest(value, "metadata")
    except InvalidFile as error:
        raise ValueError(error.message) from None


class FileRecord(_Record):
    """A file of a motion."""

    format: str = Field(pattern=r"^[a-z0-9]{1,16}$")
    sha256: Sha256
    size: int = Field(ge=0)
    media_type: str = Field(max_length=200)


class MotionRecord(_Record):
    """A motion with its files and review."""

    id: UUID
    licence: str
    frames: int = Field(ge=0)
    fps: float = Field(gt=0)
    elapsed: float = Field(ge=0)
    metadata: Annotated[dict[str, Any], AfterValidator(_as_manifest)]
    created_at: AwareDatetime
    review: Review | None
    reviewed_at: AwareDatetime | None
    reviewed_by: str | None
    review_comment: str | None
    files: list[FileRecord]


class ItemRecord(_Record):
    """An item that has ended."""

    id: UUID
    position: int = Field(ge=0)
    index: int = Field(ge=0)
    variant: int = Field(ge=0)
    name: str | None
    prompt: str
    model: str
    bundle: str
    seed: int = Field(ge=0, lt=SEED_LIMIT)
    seconds: float | None
    settings: dict[str, Any]
    tags: list[str]
    generate_batch_key: str
    stage: ItemStage
    state: Literal["succeeded", "failed", "dead", "cancelled"]
    reason: str | None
    attempts: int = Field(ge=0)
    problem: Annotated[dict[str, Any], _of_form(_Reason)] | None
    created_at: AwareDatetime
    finished_at: AwareDatetime
    replaces: UUID | None
    scope: Annotated[dict[str, Any], _of_form(_Scope)] | None = None
    edits: dict[str, Any] | None = None
    timeline: list[dict[str, Any]] | None = None
    constraints: list[dict[str, Any]] | None = None
    edited_from: list[UUID] = Field(default_factory=list[UUID])
    motion: MotionRecord | None

    @model_validator(mode="after")
    def _fits_its_request(self) -> ItemRecord:
        try:
            if self.timeline is not None:
                read_timeline(self.timeline)
            named = [] if self.constraints is None else [*named_motions(read_constraints(self.constraints))]
        except InvalidInput as error:
            raise ValueError(f"item {self.id}: {error}") from None
        if named:  # a server puts their poses in their place before it stores them
            raise ValueError(f"item {self.id} names a motion in {named[0][0]}, not a pose")
        try:
            edits = Edits.of(self.edits)
        except (KeyError, TypeError, ValueError, AttributeError):
            raise ValueError(f"item {self.id} has edits that cannot be read") from None
        if (not edits.sources or set(edits.sources) - {*self.edited_from}) if edits else self.edited_from:
            raise ValueError(f"item {self.id} was edited from other motions than its edits name")
        return self


class EventRecord(_Record):
    """A line of the job's log."""

    seq: int = Field(ge=1)
    kind: str
    item_id: UUID | None
    reason: str
    data: dict[str, Any]
    at: AwareDatetime


class JobRecord(_Record):
    """A job that has ended."""

    id: UUID
    name: str | None
    comment: str | None
    priority: int = Field(ge=-PRIORITY_LIMIT, le=PRIORITY_LIMIT)
    control: JobControl
    fail_early: float | None = Field(ge=0, le=1)
    created_at: AwareDatetime
    started_at: AwareDatetime | None
    finished_at: AwareDatetime
    erased_at: AwareDatetime | None
    scope: ScopePolicy = "ignore"
    kind: JobKind = JobKind.GENERATE


class JobBackup(_Record):
    """A job with all its data except the content of files."""

    job: JobRecord
    items: list[ItemRecord]
    events: list[EventRecord]

    @model_validator(mode="after")
    def _fits_together(self) -> JobBackup:
        motions = {item.motion.id for item in self.items if item.motion}
        for item in self.items:
            made = item.state == "succeeded" and item.model != EVALUATOR_QUEUE
            if made != (item.motion is not None):
                raise ValueError(f"item {item.id} is {item.state} and has {'a' if item.motion else 'no'} motion")
            if item.replaces is not None and item.replaces not in motions:
                raise ValueError(f"item {item.id} replaces an unknown motion")
        for what, count in (
            ("id", len({i.id for i in self.items})),
            ("position", len({i.position for i in self.items})),
        ):
            if count != len(self.items):
                raise ValueError(f"two items have the same {what}")
        if not self.items or [event.seq for event in self.events] != list(range(1, len(self.events) + 1)):
            raise ValueError("it has no items, or its events have gaps")
        return self

    def assets(self) -> dict[str, AssetDigest]:
        """Digests of the files' content."""
        files = (file for item in self.items if item.motion for file in item.motion.files)
        return {file.sha256: AssetDigest(file.sha256, file.size, file.media_type) for file in files}


def ended_jobs(conn: sa.Connection, tenant: str) -> tuple[list[UUID], int]:
    """Return the jobs of a tenant that can be backed up, oldest first, and the number of open ones."""
    table = tables.job.c
    rows = conn.execute(
        sa.select(table.id, table.state).where(table.tenant_id == tenant).order_by(table.created_at, table.id)
    ).all()
    ended = [row.id for row in rows if row.state in ENDED]
    return ended, len(rows) - len(ended)


def back_up(conn: sa.Connection, tenant: str, job: UUID) -> JobBackup:
    """Return a job that has ended; a consistent snapshot if the transaction is repeatable read.

    Raises:
        Conflict: it continued meanwhile, was deleted, or its files are being rewritten.
    """
    found = _rows(conn, tables.job, JobRecord, tables.job.c.id == job, tables.job.c.tenant_id == tenant)
    if not found or found[0]["finished_at"] is None:
        raise Conflict("the job has continued or was deleted", where=f"job {job}", hint="Back it up later.")
    if conn.execute(_erasing(job)).scalar_one():
        raise Conflict("its files are being rewritten without prompts", where=f"job {job}", hint="Wait a minute.")
    file, asset, motion = tables.motion_file.c, tables.asset.c, tables.motion.c
    files: dict[UUID, list[dict[str, Any]]] = {}
    query = (
        sa.select(file.motion_id, file.format, asset.sha256, asset.size, asset.media_type)
        .join(tables.asset, asset.id == file.asset_id)
        .join(tables.motion, motion.id == file.motion_id)
        .where(motion.job_id == job)
        .order_by(file.motion_id, file.format)
    )
    for row in conn.execute(query).mappings():
        files.setdefault(row["motion_id"], []).append({k: v for k, v in row.items() if k != "motion_id"})
    motions = {
        row["item_id"]: {k: v for k, v in row.items() if k != "item_id"} | {"files": files.get(row["id"], [])}
        for row in _rows(conn, tables.motion, MotionRecord, motion.job_id == job, more=["item_id"])
    }
    sources = _sources_of(conn, job)
    items = [
        {**row, "motion": motions.get(row["id"]), "edited_from": sources[row["id"]]}
        for row in _rows(conn, tables.item, ItemRecord, tables.item.c.job_id == job, order="position")
    ]
    events = _rows(conn, tables.job_event, EventRecord, tables.job_event.c.job_id == job, order="seq")
    return JobBackup.model_validate({"job": found[0], "items": items, "events": events})


def announce(conn: sa.Connection, tenant: str, assets: Sequence[AssetDigest]) -> None:
    """Announce assets before their upload, in a transaction of its own."""
    rows = [
        {"id": new_id(), "tenant_id": tenant, "sha256": a.sha256, "size": a.size, "media_type": a.media_type}
        for a in sorted(assets, key=lambda each: each.sha256)
    ]
    for some in _chunks(rows):
        new = insert(tables.asset).values([{**row, "state": "writing", "announced_at": sa.func.now()} for row in some])
        conn.execute(new.on_conflict_do_update(index_elements=["tenant_id", "sha256"], set_={"announced_at": CLOCK}))


def restore(conn: sa.Connection, tenant: str, backup: JobBackup) -> bool:
    """Restore a job; return False if it exists already. Its files are in the store, and were announced.

    Items go through their states like any others, so the database refuses impossible histories. The retention period
    is dropped: it has mostly passed when a backup is needed.

    Raises:
        Conflict: another tenant has a job of this id, or the garbage collector took a file: announce and PUT again.
        InvalidFile: an item was edited from a motion of another tenant, or the database refuses it.
    """
    job = backup.job
    there = conn.execute(sa.select(tables.job.c.tenant_id).where(tables.job.c.id == job.id)).scalar_one_or_none()
    if there == tenant:
        return False
    if there is not None:
        raise Conflict("another tenant has this job", where=f"job {job.id}")
    _check_sources(conn, tenant, backup)
    try:
        _write_job(conn, tenant, backup)
    except (exc.DataError, exc.IntegrityError) as error:
        reason = (str(error.orig).splitlines() or ["?"])[0]
        raise InvalidFile(f"the database refuses it: {reason}", where=f"job {job.id}") from error
    return True


def _check_sources(conn: sa.Connection, tenant: str, backup: JobBackup) -> None:
    """Check that no item was edited from a motion of another tenant. Motions that are not there may be: they were
    deleted, or are restored later.

    Raises:
        InvalidFile: one was.
    """
    named = {source for item in backup.items for source in item.edited_from}
    table = tables.motion.c
    query = sa.select(table.id).where(among(table.id, sorted(named)), table.tenant_id != tenant).limit(1)
    foreign = conn.execute(query).scalar_one_or_none() if named else None
    if foreign is not None:
        raise InvalidFile(f"an edit is of motion {foreign}, which another tenant has", where=f"job {backup.job.id}")


def _write_job(conn: sa.Connection, tenant: str, backup: JobBackup) -> None:
    job = backup.job
    conn.execute(sa.insert(tables.job).values(tenant_id=tenant, **job.model_dump()))
    lease = uuid4()
    times = {"claimed_at": CLOCK, "progress_at": CLOCK, "expires_at": CLOCK + sa.func.make_interval(0, 0, 0, 1)}
    conn.execute(
        sa.insert(tables.lease).values(token=lease, job_id=job.id, queue="import", worker="import", solo=False, **times)
    )
    for some in _chunks(backup.items):
        conn.execute(sa.insert(tables.item), [_item_row(job.id, item) for item in some])
    _end_items(conn, backup, lease)
    _write_motions(conn, tenant, backup)
    linked = [{"item_id": item.id, "source_id": source} for item in backup.items for source in item.edited_from]
    for some in _chunks(linked):
        conn.execute(sa.insert(tables.edited_from), some)
    replaced = [{"b_id": item.id, "b_replaces": item.replaces} for item in backup.items if item.replaces]
    if replaced:
        table = tables.item
        statement = (
            sa.update(table).where(table.c.id == sa.bindparam("b_id")).values(replaces=sa.bindparam("b_replaces"))
        )
        conn.execute(statement, replaced)
    conn.execute(sa.delete(tables.lease).where(tables.lease.c.token == lease))
    for events in _chunks(backup.events):
        conn.execute(sa.insert(tables.job_event), [{"job_id": job.id, **event.model_dump()} for event in events])
    counts = Counter(item.state for item in backup.items)
    numbers = {"total": len(backup.items), **counts, "event_seq": len(backup.events)}
    conn.execute(sa.update(tables.job).where(tables.job.c.id == job.id).values(numbers))


def _item_row(job: UUID, item: ItemRecord) -> dict[str, object]:
    """Return an item in the state ready. A backup holds no text features, so the item names none."""
    left = {"motion", "state", "reason", "attempts", "problem", "finished_at", "replaces", "stage", "edited_from"}
    at_text = item.stage is ItemStage.TEXT
    return {
        **item.model_dump(exclude=left),
        "job_id": job,
        "text_key": NO_TEXT,
        "stage": str(item.stage),
        "queue": TEXT_QUEUE if at_text else item.model,
        "batch_key": "" if at_text else item.generate_batch_key,
    }


def _end_items(conn: sa.Connection, backup: JobBackup, lease: UUID) -> None:
    table = tables.item
    of_job = table.c.job_id == backup.job.id
    cancelled = [item.id for item in backup.items if item.state == "cancelled"]
    leased = {"state": "leased", "lease_token": lease}
    conn.execute(sa.update(table).where(of_job, ~among(table.c.id, cancelled)).values(leased))
    fields = ("state", "reason", "attempts", "problem", "finished_at")
    ended = sa.update(table).where(table.c.id == sa.bindparam("b_id"))
    ended = ended.values(lease_token=None, **{name: sa.bindparam(f"b_{name}") for name in fields})
    for some in _chunks(backup.items):
        conn.execute(ended, [{"b_id": item.id, **{f"b_{n}": getattr(item, n) for n in fields}} for item in some])


def _write_motions(conn: sa.Connection, tenant: str, backup: JobBackup) -> None:
    assets = backup.assets()
    table = tables.asset.c
    stored = conn.execute(
        sa.update(tables.asset)
        .where(table.tenant_id == tenant, among(table.sha256, list(assets)))
        .values(state="stored")
        .returning(table.sha256, table.id)
    ).all()
    ids = {row.sha256: row.id for row in stored}
    if missing := set(assets) - set(ids):
        raise Conflict(f"{len(missing)} files were collected as garbage meanwhile", where=f"job {backup.job.id}")
    made = [(item.id, item.motion) for item in backup.items if item.motion]
    for some in _chunks(made):
        own = [
            {"tenant_id": tenant, "job_id": backup.job.id, "item_id": item, **motion.model_dump(exclude={"files"})}
            for item, motion in some
        ]
        conn.execute(sa.insert(tables.motion), own)
        files = [
            {"motion_id": motion.id, "format": file.format, "asset_id": ids[file.sha256]}
            for _, motion in some
            for file in motion.files
        ]
        if files:
            conn.execute(sa.insert(tables.motion_file), files)


def _rows(
    conn: sa.Connection,
    table: sa.Table,
    record: type[_Record],
    *wanted: sa.ColumnElement[bool],
    order: str = "id",
    more: Sequence[str] = (),
) -> list[Mapping[str, Any]]:
    columns = [table.c[name] for name in (*record.model_fields, *more) if name in table.c]
    return [dict(row) for row in conn.execute(sa.select(*columns).where(*wanted).order_by(table.c[order])).mappings()]


def _sources_of(conn: sa.Connection, job: UUID) -> defaultdict[UUID, list[UUID]]:
    """Return the motions that each item of a job was made from."""
    made, item = tables.edited_from, tables.item.c
    found: defaultdict[UUID, list[UUID]] = defaultdict(list)
    query = sa.select(made.c.item_id, made.c.source_id).join(tables.item, item.id == made.c.item_id)
    for each, source in conn.execute(query.where(item.job_id == job).order_by(made.c.source_id)):
        found[each].append(source)
    return found


def _erasing(job: UUID) -> sa.Select[int]:
    file, motion = tables.motion_file.c, tables.motion.c
    query = sa.select(sa.func.count()).select_from(tables.motion_file).join(tables.motion, motion.id == file.motion_id)
    return query.where(motion.job_id == job, file.erasing)


def _chunks(rows: Sequence[Row]) -> Iterator[Sequence[Row]]:
    for first in range(0, len(rows), CHUNK):
        yield rows[first : first + CHUNK]
