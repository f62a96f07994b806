"""Reviews of motions: keep, reject, re-roll. Reviewer, time and comment are stored with the motion."""

from __future__ import annotations

import itertools
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput
from marey.db.sql import CLOCK, among, check_text
from marey.evaluations.repository import refuse_needed
from marey.jobs import tables as job_tables
from marey.jobs.journal import LaneChange, LockedJob, NewEvent, change_lanes, lock_job_of, record
from marey.jobs.listings import items_of
from marey.jobs.motions import motions_of
from marey.jobs.operate import refuse_erased
from marey.jobs.states import ENDED, ItemState, JobControl, Review
from marey.jobs.submit import write_items
from marey.jobs.types import SEED_LIMIT, ItemRow, MotionRow, NewItem
from marey.streams import tables as stream_tables
from marey.takes.types import Reroll
from marey.tenants.quotas import reserve_quotas

MAX_REVIEWED = 1000
"""Motions per call."""


def review(
    conn: sa.Connection,
    tenant: str,
    motions: Sequence[UUID],
    verdict: Review | None,
    *,
    by: str,
    comment: str | None = None,
) -> list[MotionRow]:
    """Set the verdict on motions; None removes it. An equal verdict changes nothing.

    Args:
        by: name of the reviewer.
        comment: reason; None keeps the stored one if the verdict is unchanged.

    Returns:
        The motions, in the order given.

    Raises:
        NotFound: the tenant lacks one of them; nothing is written.
        InvalidInput: none, too many, or an invalid verdict (see `reroll`).
    """
    if verdict is Review.REROLLED:
        raise InvalidInput("a motion is re-rolled by `reroll`", where="verdict")
    _check(motions, comment)
    rows = motions_of(conn, tenant, motions)
    locked = [lock_job_of(conn, tenant, job) for job in sorted({row.job for row in rows})]
    changed = _write_verdict(conn, [row.id for row in rows], verdict, by, comment)
    verb = "taken back" if verdict is None else str(verdict)
    for job in locked:
        if changed[job.id]:
            message = f"{changed[job.id]} motions {verb} by {by}" + (f": {comment}" if comment else "")
            record(conn, job, [NewEvent("reviewed", message, data={"verdict": verdict, "motions": changed[job.id]})])
    return motions_of(conn, tenant, motions)


def reroll(
    conn: sa.Connection,
    tenant: str,
    motions: Sequence[UUID],
    make: Callable[[ItemRow], NewItem],
    *,
    by: str,
    comment: str | None = None,
) -> list[Reroll]:
    """Request another take of motions: each a new item of the same job, with the next seed of its prompt.

    A motion has at most one re-roll: a repeated request returns the same item. To continue, re-roll that take.

    Args:
        make: returns the item to repeat, as a row of a job; number, seed and variant are filled in here.
        by, comment: as in `review`; the motions are marked re-rolled.

    Returns:
        One take per motion, in the order given.

    Raises:
        NotFound: the tenant lacks one of them; nothing is written.
        InvalidInput: none, too many, or an error of `make`.
        Conflict: prompts were erased, an open evaluation counts the job's items, or a motion is the clip of a live
            stream or an edit.
        QuotaUsedUp: the tenant's quotas do not allow them.
    """
    _check(motions, comment)
    rows = motions_of(conn, tenant, motions)
    jobs = sorted({row.job for row in rows})
    for job in jobs:
        refuse_needed(conn, tenant, job)
    locked = [lock_job_of(conn, tenant, job) for job in jobs]
    made: set[UUID] = set()
    for job in locked:
        made |= _roll_again(conn, job, [row for row in rows if row.job == job.id], make, by, comment)
    item = job_tables.item.c
    columns = (item.id, item.job_id, item.seed, item.state, item.replaces)
    found = conn.execute(sa.select(*columns).where(among(item.replaces, [row.id for row in rows])))
    takes = {row.replaces: row for row in found}
    return [
        Reroll(row.id, take.id, take.job_id, take.seed, ItemState(take.state), made=row.id in made)
        for row in rows
        for take in (takes[row.id],)
    ]


def _roll_again(
    conn: sa.Connection,
    job: LockedJob,
    motions: Sequence[MotionRow],
    make: Callable[[ItemRow], NewItem],
    by: str,
    comment: str | None,
) -> set[UUID]:
    """Create new takes of motions of one locked job; motions that have one are skipped."""
    refuse_erased(job, "re-rolled")
    table = job_tables.item.c
    wanted = {row.item: row for row in motions}
    rolled = set(
        conn.execute(sa.select(table.replaces).where(among(table.replaces, [m.id for m in motions]))).scalars()
    )
    sources = [item for item in items_of(conn, list(wanted)) if wanted[item.id].id not in rolled]
    if not sources:
        return set()
    _refuse_edits(sources)
    _refuse_streams(conn, [item.id for item in sources])
    reserve_quotas(conn, job.tenant, len(sources))
    numbers = _Numbers(conn, job.id, {item.index for item in sources})
    takes = [
        replace(
            make(item),
            index=item.index,
            variant=numbers.variant(item.index),
            seed=numbers.seed(item.index),
            replaces=wanted[item.id].id,
        )
        for item in sources
    ]
    lanes = write_items(conn, job.id, takes, first=numbers.position)
    message = f"{len(takes)} motions re-rolled by {by}" + (f": {comment}" if comment else "")
    # Ended jobs continue; the pause of a job with open items stays.
    control = JobControl.RUN if job.state in ENDED else None
    record(conn, job, [NewEvent("rerolled", message, data={"items": len(takes)})], added=len(takes), control=control)
    change_lanes(conn, job.id, {lane: LaneChange(ready=count) for lane, count in lanes.items()})
    _write_verdict(conn, [wanted[item.id].id for item in sources], Review.REROLLED, by, comment)
    return {wanted[item.id].id for item in sources}


class _Numbers:
    """Next position of a locked job, and next seeds and variants of its prompts."""

    def __init__(self, conn: sa.Connection, job: UUID, prompts: set[int]) -> None:
        table = job_tables.item.c
        of_job = table.job_id == job
        self.position = conn.execute(sa.select(sa.func.max(table.position)).where(of_job)).scalar_one() + 1
        rows = conn.execute(
            sa.select(table.index, table.seed, table.variant).where(of_job, among(table.index, prompts))
        )
        self._seeds: defaultdict[int, list[int]] = defaultdict(list)
        self._variants: Counter[int] = Counter()
        for index, seed, variant in rows:
            self._seeds[index].append(seed)
            self._variants[index] = max(self._variants[index], variant)

    def seed(self, index: int) -> int:
        """Return the seed after the prompt's last one; after the maximum, the first that is free."""
        used = self._seeds[index]
        following = max(used) + 1
        if following == SEED_LIMIT:
            following = next(seed for seed in itertools.count() if seed not in used)
        used.append(following)
        return following

    def variant(self, index: int) -> int:
        """Return the next variant of the prompt."""
        self._variants[index] += 1
        return self._variants[index]


def _refuse_edits(items: Sequence[ItemRow]) -> None:
    edit = next((item for item in items if item.edits is not None), None)
    if edit is not None:
        raise Conflict(
            "it is an edit, which depends on no seed",
            where=f"item {edit.id}",
            hint="Re-roll the motion that it was made from, and edit that take.",
        )


def _refuse_streams(conn: sa.Connection, items: Sequence[UUID]) -> None:
    table = job_tables.item.c
    motion = job_tables.motion.c
    streamed = sa.exists().where(stream_tables.stream.c.job_id == table.job_id) | motion.metadata.has_key("stream")
    query = (
        sa.select(table.id).join(job_tables.motion, motion.item_id == table.id).where(among(table.id, items), streamed)
    )
    clip = conn.execute(query.limit(1)).scalar_one_or_none()
    if clip is not None:
        raise Conflict(
            "it is the clip of a live stream, which cannot be generated again",
            where=f"item {clip}",
            hint="Start a stream with another seed.",
        )


def _write_verdict(
    conn: sa.Connection, motions: Sequence[UUID], verdict: Review | None, by: str, comment: str | None
) -> Counter[UUID]:
    """Write a verdict where another one is set; return the number of changed motions by job."""
    table = job_tables.motion
    new: sa.ColumnElement[bool] = table.c.review.is_distinct_from(verdict)
    if comment is not None and verdict is not None:
        new |= table.c.review_comment.is_distinct_from(comment)
    rows = conn.execute(
        sa.update(table)
        .where(among(table.c.id, motions), new)
        .values(
            review=verdict,
            reviewed_at=None if verdict is None else CLOCK,
            reviewed_by=None if verdict is None else by,
            review_comment=None if verdict is None else comment,
        )
        .returning(table.c.job_id)
    )
    return Counter(rows.scalars())


def _check(motions: Sequence[UUID], comment: str | None) -> None:
    if not 1 <= len(motions) <= MAX_REVIEWED:
        raise InvalidInput(f"{len(motions)} motions; one call takes 1 to {MAX_REVIEWED}", where="motions")
    check_text(comment, "comment")
