"""Edits of stored motions: jobs of the kind `edit`, and what was made from a motion."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput, NotFound, TooLarge
from marey.exporters.registry import CANONICAL
from marey.jobs import (
    EDIT_QUEUE,
    NO_TEXT,
    Edits,
    JobKind,
    MotionRow,
    NewItem,
    NewJob,
    Review,
    SubmittedJob,
    find_submitted,
    submit,
    tables,
)
from marey.jobs.motions import get_motion
from marey.motion.edits.licences import strictest
from marey.motion.edits.operation import MOST_FRAMES
from marey.motion.edits.prompts import prompt_of
from marey.motion.edits.steps import Step, pieces_of, read_steps
from marey.motion.edits.timeline_rows import prompt_after_cuts
from marey.takes.model_edits import EditGenerator, check_generator, with_prompts
from marey.takes.reviews import review
from marey.tenants import DEFAULT_TENANT
from marey.vocabulary.scope import ScopePolicy

MOST_CHARACTERS = 20_000
"""Characters of the prompt of joined motions."""
REVERTED = "reverted to its source"
"""Comment on the review of an edit."""
KINEMATIC: Mapping[str, Any] = {
    "model": EDIT_QUEUE,
    "bundle": EDIT_QUEUE,
    "batch_key": hashlib.sha256(EDIT_QUEUE.encode()).hexdigest(),
    "text_key": NO_TEXT,
    "text_batch_key": NO_TEXT,
}
"""Fields of an item whose operations need no model."""

HOLD_JOBS = sa.text("""
    SELECT job.id FROM job JOIN motion ON motion.job_id = job.id
    WHERE motion.id = ANY(:motions) AND motion.tenant_id = :tenant
    ORDER BY job.id FOR SHARE OF job
""")

# With the sources of sources: they stay known when a motion between is deleted.
LINK = sa.text("""
    WITH direct AS (
        SELECT item.id, source::uuid AS source
        FROM item, jsonb_array_elements_text(item.edits -> 'sources') AS source WHERE item.job_id = :job
    )
    INSERT INTO edited_from (item_id, source_id)
    SELECT id, source FROM direct
    UNION
    SELECT direct.id, earlier.source_id FROM direct
    JOIN motion ON motion.id = direct.source JOIN edited_from AS earlier ON earlier.item_id = motion.item_id
""")


@dataclass(frozen=True)
class NewEdit:
    """An edit to submit.

    Attributes:
        motion: to edit.
        ops: operations as in JSON; `with` is the id of another motion.
        generator: generates frames, for operations that need a model.
        scope: treatment of its prompts with actions that the model does not know.
        name, comment, priority, keep_days, idempotency_key, body_sha256, traceparent: of the job; see `NewJob`.
    """

    motion: UUID
    ops: Sequence[Mapping[str, Any]]
    generator: EditGenerator | None = None
    scope: ScopePolicy = "ignore"
    tenant: str = DEFAULT_TENANT
    name: str | None = None
    comment: str | None = None
    priority: int = 0
    keep_days: int | None = None
    idempotency_key: str | None = None
    body_sha256: str | None = None
    traceparent: str | None = None


def submit_edit(conn: sa.Connection, edit: NewEdit) -> SubmittedJob:
    """Submit a job that edits a stored motion: one item, or two for each split.

    Raises:
        NotFound: the tenant lacks one of the motions.
        InvalidInput: an operation that is unknown or has another value, licences that exclude each other, or a model
            that is missing, not used, or cannot generate frames around others.
        TooLarge: too many pieces, frames or characters.
        Conflict: a motion has no npz: its prompt is being erased.
        QuotaUsedUp, IdempotencyMismatch: as `marey.jobs.submit`.
    """
    steps = _read_steps(edit.ops)
    earlier = find_submitted(conn, edit.tenant, edit.idempotency_key, edit.body_sha256)
    if earlier is not None:  # whose motions may be gone
        return earlier
    # An erasure of a source waits, and then finds the edit.
    conn.execute(HOLD_JOBS, {"motions": _sources(edit.motion, steps), "tenant": edit.tenant})
    items = _items(conn, edit, steps)
    submitted = submit(
        conn,
        NewJob(
            items=items,
            tenant=edit.tenant,
            name=edit.name,
            comment=edit.comment,
            priority=edit.priority,
            keep_days=edit.keep_days,
            count=len(items),
            idempotency_key=edit.idempotency_key,
            body_sha256=edit.body_sha256,
            traceparent=edit.traceparent,
            kind=JobKind.EDIT,
            scope="ignore" if edit.generator is None else edit.scope,
        ),
    )
    if not submitted.replayed:
        conn.execute(LINK, {"job": submitted.id})
    return submitted


def check_edit(conn: sa.Connection, edit: NewEdit) -> list[NewItem]:
    """Return the items that `submit_edit` would submit, and write nothing; raises as it, but for quotas."""
    return _items(conn, edit, _read_steps(edit.ops))


def _items(conn: sa.Connection, edit: NewEdit, steps: Sequence[Step]) -> list[NewItem]:
    """Check the steps of an edit and its motions, and return an item for each resulting motion."""
    check_generator(steps, edit.generator)
    others = {step.where: UUID(step.values["with"]) for step in steps if "with" in step.values}
    rows = {edit.motion: get_motion(conn, edit.tenant, edit.motion)}
    for where, motion in others.items():
        rows[motion] = _other(conn, edit.tenant, motion, f"{where}.with")
    _check_sources(rows[edit.motion], [rows[motion] for motion in (edit.motion, *others.values())], edit.generator)
    pieces = pieces_of(with_prompts(steps, rows[edit.motion]))
    return [_item(number, piece, rows, edit) for number, piece in enumerate(pieces)]


def edit_jobs_of(conn: sa.Connection, tenant: str, job: UUID) -> Sequence[UUID]:
    """Return the tenant's jobs of edits that were made from motions of a job, directly or through other edits; oldest
    first."""
    item, motion, made = tables.item.c, tables.motion.c, tables.edited_from
    query = (
        sa.select(item.job_id)
        .join(made, made.c.item_id == item.id)
        .join(tables.motion, motion.id == made.c.source_id)
        .join(tables.job, tables.job.c.id == item.job_id)
        .where(motion.job_id == job, tables.job.c.tenant_id == tenant)
        .distinct()
        .order_by(item.job_id)
    )
    return conn.execute(query).scalars().all()


def revert(conn: sa.Connection, tenant: str, motion: UUID, *, by: str) -> MotionRow:
    """Go back from an edit to the motion that it was made from; nothing is deleted.

    The edit becomes rejected. Its source becomes kept if the edit was, and is no longer rejected. A repeated call
    changes nothing.

    Args:
        by: name of the reviewer.

    Returns:
        The source.

    Raises:
        NotFound: the tenant has no such motion, or its source was deleted.
        Conflict: it is not an edit.
    """
    edit = get_motion(conn, tenant, motion)
    if not edit.edited_from:
        raise Conflict("the motion was not edited", where=f"motion {motion}", hint="Only an edit can be reverted.")
    source = _source(conn, tenant, edit)
    if edit.review is Review.KEPT:
        review(conn, tenant, [source.id], Review.KEPT, by=by)
    elif source.review is Review.REJECTED:
        review(conn, tenant, [source.id], None, by=by)
    if edit.review is not Review.REJECTED:
        review(conn, tenant, [edit.id], Review.REJECTED, by=by, comment=REVERTED)
    return get_motion(conn, tenant, source.id)


def _source(conn: sa.Connection, tenant: str, edit: MotionRow) -> MotionRow:
    try:
        return get_motion(conn, tenant, edit.edited_from[0])
    except NotFound:
        raise NotFound(
            "the motion that it was made from was deleted", where=f"motion {edit.edited_from[0]}", hint="Keep the edit."
        ) from None


def _read_steps(ops: Sequence[Mapping[str, Any]]) -> tuple[Step, ...]:
    """Check operations whose other motions are named by ids."""
    steps = read_steps(ops)
    for step in steps:
        if "with" in step.values:
            try:
                UUID(str(step.values["with"]))
            except ValueError:
                raise InvalidInput(
                    "is not the id of a motion",
                    where=f"{step.where}.with",
                    hint="`marey motions list --full-ids` shows them.",
                ) from None
    return steps


def _other(conn: sa.Connection, tenant: str, motion: UUID, where: str) -> MotionRow:
    try:
        return get_motion(conn, tenant, motion)
    except NotFound as error:
        raise NotFound(error.message, where=where, hint=error.hint) from None


def _check_sources(first: MotionRow, joined: Sequence[MotionRow], generator: EditGenerator | None) -> None:
    """Validate the motions of an edit, in the order of the operations, and the terms of all.

    Raises:
        Conflict, TooLarge, InvalidInput: as `submit_edit`.
    """
    for row in joined:
        if all(file.format != CANONICAL for file in row.files):
            raise Conflict(
                f"the motion has no {CANONICAL} to edit",
                where=f"motion {row.id}",
                hint="If its prompt is being erased, wait a moment.",
            )
    frames = sum(row.frames for row in joined)
    if frames > MOST_FRAMES:
        hint = "Trim the motions first."
        raise TooLarge(f"the motions have {frames} frames; the most is {MOST_FRAMES}", where="ops", hint=hint)
    terms = [] if generator is None else [generator.licence]
    strictest([*(row.licence for row in joined), *terms], where=f"licence of motion {first.id}")


def _item(number: int, steps: Sequence[Step], rows: Mapping[UUID, MotionRow], edit: NewEdit) -> NewItem:
    """Return the item of one resulting motion; it has the name, the tags and the seed of the edited one."""
    source = rows[edit.motion]
    prompt, rest = prompt_after_cuts(source.metadata, source.prompt, steps, source.frames, source.fps)
    prompt = prompt_of(prompt, rest, lambda step: rows[UUID(step.values["with"])].prompt)
    if len(prompt) > MOST_CHARACTERS:
        raise TooLarge(
            f"the prompts of the motions have {len(prompt)} characters together; the most is {MOST_CHARACTERS}",
            where="ops",
            hint="Join fewer motions.",
        )
    return NewItem(
        prompt=prompt,
        name=source.name,
        tags=source.tags,
        index=number,
        seed=source.seed,
        edits=_edits(edit.motion, steps),
        **(KINEMATIC if edit.generator is None else edit.generator.columns(steps, edit.scope)),
    )


def _edits(motion: UUID, steps: Sequence[Step]) -> Edits:
    asked = tuple(step.asked or step.operation.name for step in steps) if any(step.asked for step in steps) else ()
    return Edits(tuple(step.as_json() for step in steps), tuple(_sources(motion, steps)), asked)


def _sources(motion: UUID, steps: Iterable[Step]) -> list[UUID]:
    others = (UUID(step.values["with"]) for step in steps if "with" in step.values)
    return list(dict.fromkeys((motion, *others)))
