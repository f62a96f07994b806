"""Retention and erasure: expired jobs, erased prompts, and their files."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol, cast
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import JSONB

from marey.core.errors import Conflict, InvalidFile, NotFound, Unreachable
from marey.db.database import EVENT_CHANNEL, transaction
from marey.db.deadlines import BULK, MAINTENANCE
from marey.db.sql import among, notify
from marey.evaluations import tables as evaluation_tables
from marey.evaluations.repository import refuse_needed
from marey.exporters import Coordinates, Exporter, exporter_of, exporters
from marey.jobs import tables as job_tables
from marey.jobs.files import asset_key
from marey.jobs.journal import LockedJob, NewEvent, lock_job_of, record
from marey.jobs.states import ENDED
from marey.jobs.submit import TEXTS_LOCK
from marey.jobs.types import NO_TEXT
from marey.motion.clip import QUALITY, SELECTION
from marey.motion.edits.editing import EDITED_FROM
from marey.takes.assets import keep_content, write_content
from marey.takes.edits import edit_jobs_of
from marey.takes.gc import ObjectStore, remove_unused_assets
from marey.takes.types import Erasure

DIGEST = re.compile(r"[0-9a-f]{64}")
WORDY = ("sha256", "prompt")
"""Keys of a record of an edit that hold words, or the digest of a file that held some."""
ROUND = 200
"""Jobs or files per round."""
KEPT = (
    *("model", "bundle", "weights_sha256", "random_weights", "licence", "seed", "settings", "software"),
    *("feet_cleaned", "stream", QUALITY, SELECTION),
    *("placement", "loop", "travel", "travel_per_second", EDITED_FROM),
)
"""Manifest keys other than the prompt that are kept. All others are removed: a new key is removed until it is listed
here."""

LATE = sa.text("""
    SELECT id, tenant_id FROM job
    WHERE keep_days IS NOT NULL AND finished_at + make_interval(days => keep_days) < clock_timestamp()
      AND (CAST(:job AS uuid) IS NULL OR id = :job)
    ORDER BY id LIMIT :limit
""")

FORGET = (
    """
    UPDATE item SET prompt = '', text_key = '', timeline = NULL, scope = NULL, reason = split_part(reason, ':', 1),
        problem = CASE WHEN problem IS NULL THEN NULL ELSE jsonb_build_object(
            'type', problem -> 'type', 'message', 'erased with the prompt', 'where', NULL, 'hint', NULL) END
    WHERE job_id = :job
    """,
    """
    UPDATE item SET edits = jsonb_set(edits, '{ops}', (
        SELECT jsonb_agg(op - 'prompt' ORDER BY number)
        FROM jsonb_array_elements(edits -> 'ops') WITH ORDINALITY AS each(op, number)))
    WHERE job_id = :job AND edits IS NOT NULL
    """,
    """
    UPDATE motion SET metadata = coalesce(
        (SELECT jsonb_object_agg(key, value) FROM jsonb_each(metadata) WHERE key = ANY(:kept)), '{}')
    WHERE job_id = :job
    """,
    """
    UPDATE job_event SET reason = 'erased with the prompt', data = data - 'problem'
    WHERE job_id = :job AND data ? 'problem'
    """,
    "UPDATE motion_file SET erasing = true FROM motion "
    "WHERE motion.id = motion_file.motion_id AND motion.job_id = :job AND motion_file.format <> ALL(:without_prompt)",
    "UPDATE stream_chunk SET prompts = '[]', reads = NULL FROM stream "
    "WHERE stream.id = stream_chunk.stream_id AND stream.job_id = :job",
    "UPDATE stream SET prompt = '' WHERE job_id = :job",
    "DELETE FROM idempotency WHERE job_id = :job",
    "UPDATE job SET erased_at = clock_timestamp() WHERE id = :job",
)
"""All columns of the database with words of a prompt, or a hash from which they could be guessed. Files made on request
go with the update of `motion_file`, by a trigger."""

EDITED = sa.text("""
    SELECT id, metadata -> :key AS record FROM motion WHERE job_id = :job AND metadata ? :key
""")

FORGET_TEXTS = sa.text("""
    DELETE FROM text_features
    WHERE key = ANY(:keys) AND NOT EXISTS (SELECT FROM item WHERE item.text_key = text_features.key)
""")

FORGET_SCOPES = sa.text("""
    DELETE FROM prompt_scope
    WHERE text_key = ANY(:keys) AND NOT EXISTS (SELECT FROM item WHERE item.text_key = prompt_scope.text_key)
""")


class FileStore(ObjectStore, Protocol):
    """Methods of an asset store that rewriting files needs (`marey.storage.AssetStore` fits)."""

    def get(self, key: str) -> bytes: ...
    def put(self, key: str, source: bytes) -> object: ...


def delete(conn: sa.Connection, tenant: str, job: UUID) -> None:
    """Delete a job that has ended, with its items, events and motions; its files are removed by the next garbage
    collection.

    Raises:
        NotFound: the tenant has no such job.
        Conflict: the job has open items, or works for an evaluation that is not over; cancel it first.
    """
    refuse_needed(conn, tenant, job)
    locked = lock_job_of(conn, tenant, job)
    if locked.state not in ENDED:
        raise Conflict(
            f"the job is {locked.state}", where=f"job {job}", hint=f"Cancel it first: `marey jobs cancel {job}`."
        )
    conn.execute(sa.delete(job_tables.job).where(job_tables.job.c.id == job))
    notify(conn, EVENT_CHANNEL, [str(job)])


def delete_expired(engine: sa.Engine, store: ObjectStore) -> int:
    """Delete jobs past their retention, with motions and files; return their number. Jobs of an open evaluation wait.

    Raises:
        Unreachable: the store or the database does not answer.
    """
    with transaction(engine, MAINTENANCE) as conn:
        late = conn.execute(LATE, {"job": None, "limit": ROUND}).all()
    deleted = 0
    for job, tenant in late:
        try:
            with transaction(engine, BULK) as conn:
                refuse_needed(conn, tenant, job)
                lock_job_of(conn, tenant, job)
                if conn.execute(LATE, {"job": job, "limit": 1}).one_or_none() is not None:  # still expired
                    delete(conn, tenant, job)
                    deleted += 1
        except (Conflict, NotFound):
            continue
    if deleted:
        remove_unused_assets(engine, store)
    return deleted


def erase(conn: sa.Connection, tenant: str, job: UUID, *, by: str) -> Erasure:
    """Erase the prompts of a job that has ended, and of every edit of its motions: prompts, rewrites, graphs and
    features, at once.

    Files that hold prompts, such as npz, are not served until `rewrite_files` has rewritten them; nor are files of a
    format whose exporter is not installed here.

    Names, tags, verdicts, motions and every other file stay. Erased already: no change.

    Raises:
        NotFound: the tenant has no such job.
        Conflict: it or an edit of its motions has open items, or an evaluation made it, whose prompts and report are
            stored separately.
    """
    _refuse_evaluations(conn, tenant, job)
    locked = [_lock_ended(conn, tenant, job), *_lock_edits(conn, tenant, job)]
    for each in locked:
        if not each.erased:
            _forget(conn, each, by)
    table = job_tables.job.c
    erased = conn.execute(sa.select(table.erased_at).where(table.id == job)).scalar_one()
    jobs = [each.id for each in locked]
    return Erasure(job, erased, _files_left(conn, jobs), tuple(jobs[1:]))


def rewrite_files(engine: sa.Engine, store: FileStore) -> int:
    """Rewrite the files of erased jobs through the exporters of their formats, and remove the old ones.

    A file that its exporter cannot read (`InvalidFile`) is removed. A format whose exporter is not installed, or fails
    otherwise, keeps its files from being served; the next call tries again. Other formats do not wait for it.

    Returns:
        Number of rewritten files.

    Raises:
        Unreachable: the store or the database does not answer; the next call continues.
        ExceptionGroup: no file of some formats could be rewritten.
    """
    with transaction(engine, MAINTENANCE) as conn:
        formats = _formats_waiting(conn)
    done = 0
    failures: list[Exception] = []
    for format in formats:
        try:
            done += _rewrite_format(engine, store, exporter_of(format))
        except Unreachable:
            raise
        except Exception as error:
            failures.append(error)
    if formats:
        remove_unused_assets(engine, store)
    if failures:
        raise ExceptionGroup("files of erased jobs still hold their prompts and are not served", failures)
    return done


@dataclass(frozen=True)
class _File:
    motion: UUID
    format: str
    asset: UUID
    tenant: str
    sha256: str
    media_type: str


def _lock_ended(conn: sa.Connection, tenant: str, job: UUID) -> LockedJob:
    locked = lock_job_of(conn, tenant, job)
    if locked.state not in ENDED:
        raise Conflict(
            f"the job is {locked.state}", where=f"job {job}", hint=f"Cancel it first: `marey jobs cancel {job}`."
        )
    return locked


def _lock_edits(conn: sa.Connection, tenant: str, job: UUID) -> list[LockedJob]:
    """Lock the jobs of all edits of a locked job's motions; a submit that edits one of their motions then waits."""
    locked: dict[UUID, LockedJob] = {}
    while new := [edit for edit in edit_jobs_of(conn, tenant, job) if edit not in locked]:
        locked |= {edit: _lock_ended(conn, tenant, edit) for edit in new}
    return list(locked.values())


def _refuse_evaluations(conn: sa.Connection, tenant: str, job: UUID) -> None:
    refuse_needed(conn, tenant, job)
    table = evaluation_tables.evaluation.c
    ours = (table.tenant_id == tenant) & ((table.generate_job_id == job) | (table.score_job_id == job))
    evaluation = conn.execute(sa.select(table.id).where(ours).limit(1)).scalar_one_or_none()
    if evaluation is not None:
        raise Conflict(
            f"evaluation {evaluation} made it, and its report holds the prompts too",
            where=f"job {job}",
            hint="Prompts of evaluations cannot be erased by job.",
        )


def _forget(conn: sa.Connection, job: LockedJob, by: str) -> None:
    item = job_tables.item.c
    used = sa.select(item.text_key).where(item.job_id == job.id, item.text_key != NO_TEXT).distinct()
    keys: Sequence[str] = conn.execute(used).scalars().all()
    without_prompt = [each.format for each in exporters().values() if not each.holds_prompt]
    values = {"job": job.id, "kept": list(KEPT), "without_prompt": without_prompt}
    for statement in FORGET:
        conn.execute(sa.text(statement), {name: value for name, value in values.items() if f":{name}" in statement})
    _forget_records(conn, job.id)
    # A concurrent submit may have seen these features and rely on them: wait for it, then check.
    conn.execute(sa.select(sa.func.pg_advisory_xact_lock(TEXTS_LOCK)))
    conn.execute(FORGET_TEXTS, {"keys": list(keys)})
    conn.execute(FORGET_SCOPES, {"keys": list(keys)})
    record(conn, job, [NewEvent("erased", f"prompts erased by {by}")])


def _forget_records(conn: sa.Connection, job: UUID) -> None:
    """Remove prompts from the records of edits, and the digests of sources: each source's file held the prompt."""
    motion = job_tables.motion
    for row in conn.execute(EDITED, {"job": job, "key": EDITED_FROM}).all():
        metadata = sa.func.jsonb_set(motion.c.metadata, [EDITED_FROM], sa.cast(_without_words(row.record), JSONB))
        conn.execute(sa.update(motion).where(motion.c.id == row.id).values(metadata=metadata))


def _without_words(record: Any) -> Any:
    """Return a record of an edit without prompts, and without SHA-256: a prompt could be guessed from the digest of its
    file."""
    if isinstance(record, Mapping):
        values = cast("Mapping[str, Any]", record)
        return {
            name: _without_words(value)
            for name, value in values.items()
            if name not in WORDY and not (name == "with" and isinstance(value, str) and DIGEST.fullmatch(value))
        }
    if isinstance(record, Sequence) and not isinstance(record, str):
        return [_without_words(value) for value in cast("Sequence[Any]", record)]
    return record


def _files_left(conn: sa.Connection, jobs: Sequence[UUID]) -> int:
    file, motion = job_tables.motion_file.c, job_tables.motion.c
    query = (
        sa.select(sa.func.count())
        .select_from(job_tables.motion_file)
        .join(job_tables.motion, motion.id == file.motion_id)
    )
    return conn.execute(query.where(among(motion.job_id, jobs), file.erasing)).scalar_one()


def _formats_waiting(conn: sa.Connection) -> Sequence[str]:
    file = job_tables.motion_file.c
    return conn.execute(sa.select(file.format).where(file.erasing).distinct().order_by(file.format)).scalars().all()


def _waiting(conn: sa.Connection, format: str) -> list[_File]:
    file, asset = job_tables.motion_file.c, job_tables.asset.c
    query = (
        sa.select(file.motion_id, file.format, asset.id, asset.tenant_id, asset.sha256, asset.media_type)
        .join(job_tables.asset, asset.id == file.asset_id)
        .where(file.erasing, file.format == format)
        .order_by(file.motion_id)
        .limit(ROUND)
    )
    return [_File(*row) for row in conn.execute(query)]


def _rewrite_format(engine: sa.Engine, store: FileStore, exporter: Exporter[Any]) -> int:
    with transaction(engine, MAINTENANCE) as conn:
        if not exporter.holds_prompt:  # marked by a process that did not have the exporter
            files = job_tables.motion_file.c
            mine = files.erasing & (files.format == exporter.format)
            return conn.execute(sa.update(job_tables.motion_file).where(mine).values(erasing=False)).rowcount
        waiting = _waiting(conn, exporter.format)
    return sum(_rewrite(engine, store, file, exporter) for file in waiting)


def _without_prompt(exporter: Exporter[Any], data: bytes, where: str) -> bytes:
    """Encode a file again, with a manifest that holds only the keys in `KEPT` and the fact that the rest was erased."""
    assert exporter.decode is not None  # `Exporter` checks it of formats that hold prompts
    clip = exporter.decode(data, where, Coordinates())
    manifest = {name: value for name, value in clip.manifest.items() if name in KEPT}
    if EDITED_FROM in manifest:
        manifest[EDITED_FROM] = _without_words(manifest[EDITED_FROM])
    return exporter.encode(replace(clip, manifest={**manifest, "erased": True}), Coordinates())


def _rewrite(engine: sa.Engine, store: FileStore, file: _File, exporter: Exporter[Any]) -> bool:
    """Rewrite a file; return False if the garbage collector interfered: the next round tries again."""
    key = asset_key(file.tenant, file.sha256)
    try:
        data = _without_prompt(exporter, store.get(key), key)
    except (InvalidFile, NotFound):
        with transaction(engine, MAINTENANCE) as conn:
            conn.execute(sa.delete(job_tables.motion_file).where(_row_of(file)))
        return True
    sha256 = write_content(engine, store, file.tenant, data, file.media_type)
    with transaction(engine, MAINTENANCE) as conn:
        ours = keep_content(conn, file.tenant, sha256)
        if ours is None:
            return False
        conn.execute(sa.update(job_tables.motion_file).where(_row_of(file)).values(asset_id=ours, erasing=False))
    return True


def _row_of(file: _File) -> sa.ColumnElement[bool]:
    table = job_tables.motion_file.c
    return (table.motion_id == file.motion) & (table.format == file.format) & (table.asset_id == file.asset)
