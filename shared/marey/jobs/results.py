"""Writes under a lease: each is fenced by the lease token, the first committed result wins."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.dialects.postgresql import insert

from marey.db.ids import new_id
from marey.db.sql import CLOCK, among, interval
from marey.jobs import tables
from marey.jobs.journal import LaneChange, LockedJob, NewEvent, change_lanes, record, returned
from marey.jobs.lease_rows import LeasedItem, document, drop_empty_lease, end_dead, end_items, give_back, lock_lease
from marey.jobs.lease_types import AssetDigest, Committed, ItemFailure, NewMotion, NewText
from marey.jobs.operate import cancel_if_failing
from marey.jobs.policy import Policy, policy
from marey.jobs.states import Cause, ItemStage, ItemState

# The lease stays until the announcement is committed; heartbeats may continue.
HOLD_LEASE = sa.text("""
    SELECT job.tenant_id FROM lease JOIN job ON job.id = lease.job_id WHERE lease.token = :token FOR KEY SHARE OF lease
""")

# The rows of a batch travel as one JSON array: one statement, compiled and prepared once, for any number of rows.
# VALUES lists and one statement per row took half of the CPU time of a commit.

# In order of content, so that two announcements never wait for each other.
ANNOUNCE = sa.text("""
    WITH announced AS (
        INSERT INTO asset (id, tenant_id, sha256, size, media_type, state, announced_at)
        SELECT id, :tenant, sha256, size, media_type, 'writing', clock_timestamp()
        FROM json_to_recordset(CAST(:assets AS json)) AS new(id uuid, sha256 text, size bigint, media_type text)
        ORDER BY sha256
        ON CONFLICT (tenant_id, sha256) DO UPDATE SET announced_at = clock_timestamp()
        RETURNING id
    )
    INSERT INTO asset_writer (asset_id, lease_token) SELECT id, :token FROM announced ON CONFLICT DO NOTHING
""")

# Everything that finished items write. Assets are locked in the order of their announcement; missing ones are missing
# from the answer.
FINISH = sa.text("""
    WITH ours AS MATERIALIZED (
        SELECT id, sha256, state FROM asset
        WHERE tenant_id = :tenant AND sha256 = ANY(:digests)
        ORDER BY sha256
        FOR UPDATE
    ), stored AS (
        UPDATE asset SET state = 'stored' FROM ours WHERE asset.id = ours.id AND ours.state = 'writing'
    ), made AS (
        INSERT INTO motion (id, tenant_id, job_id, item_id, licence, frames, fps, elapsed, metadata)
        SELECT id, :tenant, :job, item_id, licence, frames, fps, elapsed, metadata
        FROM json_to_recordset(CAST(:motions AS json))
             AS new(id uuid, item_id uuid, licence text, frames int, fps float8, elapsed float8, metadata jsonb)
    ), filed AS (
        INSERT INTO motion_file (motion_id, format, asset_id)
        SELECT new.motion_id, new.format, ours.id
        FROM json_to_recordset(CAST(:files AS json)) AS new(motion_id uuid, format text, sha256 text)
             JOIN ours USING (sha256)
    ), ended AS (
        UPDATE item SET state = 'succeeded', lease_token = NULL, reason = 'committed', finished_at = clock_timestamp()
        WHERE id = ANY(:items)
    )
    SELECT id, sha256 FROM ours
""")


# The worker finds the frames of a cycle, so the submit does not know which rows of a timeline they show.
TELL_CYCLES = sa.text("""
    UPDATE item SET prompt = new.prompt
    FROM json_to_recordset(CAST(:prompts AS json)) AS new(item_id uuid, prompt text)
    WHERE item.id = new.item_id AND item.edits @> '{"ops": [{"op": "loop"}]}' AND item.prompt <> new.prompt
""")


def begin_assets(conn: sa.Connection, lease_token: UUID, assets: Sequence[AssetDigest]) -> bool:
    """Announce assets before their upload (rows `writing`), in a transaction of its own.

    Existing content is announced again: the garbage collector keeps it while this lease lives.

    Returns:
        False if the lease is gone: upload nothing.
    """
    tenant = conn.execute(HOLD_LEASE, {"token": lease_token}).scalar_one_or_none()
    if tenant is None:
        return False
    new = [
        {"id": str(new_id()), "sha256": asset.sha256, "size": asset.size, "media_type": asset.media_type}
        for asset in {asset.sha256: asset for asset in assets}.values()
    ]
    if new:
        conn.execute(ANNOUNCE, {"tenant": tenant, "token": lease_token, "assets": json.dumps(new)})
    return True


def commit_motions(conn: sa.Connection, lease_token: UUID, motions: Sequence[NewMotion]) -> Committed:
    """Finish items: assets, motions, counters and one progress event in this transaction.

    The files must be in the asset store and have been announced by `begin_assets`.
    """
    leased = lock_lease(conn, lease_token, [motion.item for motion in motions])
    if leased is None:
        return Committed((), tuple(motion.item for motion in motions))
    done = [motion for motion in motions if motion.item in leased.items]
    if done:
        _finish(conn, leased.job, done)
        event = NewEvent("progress", f"{len(done)} motions stored", data={"items": len(done)})
        record(conn, leased.job, [event], moved={(ItemState.LEASED, ItemState.SUCCEEDED): len(done)})
        drop_empty_lease(conn, lease_token)
    return leased.committed([motion.item for motion in motions])


def commit_texts(conn: sa.Connection, lease_token: UUID, texts: Sequence[NewText]) -> Committed:
    """Store text features and move their items to the stage `generate`.

    Ready items of the same job, key and bundle move with them, and get the same scope.
    """
    leased = lock_lease(conn, lease_token, [text.item for text in texts])
    if leased is None:
        return Committed((), tuple(text.item for text in texts))
    done = [text for text in texts if text.item in leased.items]
    for text in done:
        if text.key != leased.items[text.item].text_key:
            raise ValueError(f"features {text.key} are not those of item {text.item}")
    if done:
        blobs = {text.key: text.blob for text in done}
        rows = [{"key": key, "blob": blobs[key]} for key in sorted(blobs)]  # in order: two commits may share keys
        conn.execute(insert(tables.text_features).values(rows).on_conflict_do_nothing())
        siblings = _leave_text_stage(conn, leased.job, [leased.items[text.item] for text in done])
        _store_scopes(conn, done, siblings)
        drop_empty_lease(conn, lease_token)
    return leased.committed([text.item for text in texts])


def fail_items(
    conn: sa.Connection, lease_token: UUID, failures: Sequence[ItemFailure], *, rules: Policy | None = None
) -> Committed:
    """Record errors: permanent ones end the item as `failed`; retryable ones count an attempt and retry after a delay,
    or end it as `dead` when no attempts are left."""
    rules = rules or policy()
    leased = lock_lease(conn, lease_token, [failure.item for failure in failures])
    if leased is None:
        return Committed((), tuple(failure.item for failure in failures))
    states: dict[UUID, ItemState] = {}
    events: list[NewEvent] = []
    for failure in failures:
        row = leased.items.get(failure.item)
        if row is not None:
            states[failure.item], event = _fail(conn, row, failure, rules)
            events.append(event)
    if events:
        moved = {(ItemState.LEASED, state): count for state, count in Counter(states.values()).items()}
        job = record(conn, leased.job, events, moved=moved)
        drop_empty_lease(conn, lease_token)
        cancel_if_failing(conn, job)
    return replace(leased.committed([failure.item for failure in failures]), states=states)


def release(conn: sa.Connection, lease_token: UUID, reason: str, items: Sequence[UUID] | None = None) -> Committed:
    """Release items (the whole lease, by default) without counting an attempt: SIGTERM, a store or database outage."""
    leased = lock_lease(conn, lease_token, items)
    if leased is None:
        return Committed((), tuple(items or ()))
    if leased.items:
        give_back(conn, leased.job, list(leased.items.values()), Cause.RELEASED, reason)
        event = NewEvent("released", reason, data={"items": len(leased.items)})
        record(conn, leased.job, [event], moved={(ItemState.LEASED, ItemState.READY): len(leased.items)})
        drop_empty_lease(conn, lease_token)
    return leased.committed(list(leased.items) if items is None else items)


# --- shared with evaluations ---


def store_assets(conn: sa.Connection, job: LockedJob, digests: Collection[str]) -> dict[str, UUID]:
    """Mark announced assets as stored, in the transaction that refers to them; return their ids by digest.

    Raises:
        ValueError: one was not announced by `begin_assets`.
    """
    return _store(conn, job, digests)


# --- helpers ---


def _finish(conn: sa.Connection, job: LockedJob, motions: Sequence[NewMotion]) -> None:
    """Write succeeded items with their motions; mark their announced assets as stored."""
    ids = {motion.item: str(new_id()) for motion in motions}
    rows = [
        {
            "id": ids[motion.item],
            "item_id": str(motion.item),
            "licence": motion.licence,
            "frames": motion.frames,
            "fps": motion.fps,
            "elapsed": motion.elapsed,
            "metadata": dict(motion.metadata),
        }
        for motion in motions
    ]
    files = [
        {"motion_id": ids[motion.item], "format": name, "sha256": file.sha256}
        for motion in motions
        for name, file in motion.files.items()
    ]
    _tell_cycles(conn, motions)
    digests = {file["sha256"] for file in files}
    _store(conn, job, digests, items=[motion.item for motion in motions], motions=rows, files=files)


def _tell_cycles(conn: sa.Connection, motions: Sequence[NewMotion]) -> None:
    """Set the prompts of items whose operations cut a cycle to those of the frames that they hold, as their manifests
    have them; before the motions are written, which are searched by the prompts of their items."""
    edited = [motion for motion in motions if "edited_from" in motion.metadata]
    prompts = [{"item_id": str(each.item), "prompt": each.metadata.get("prompt")} for each in edited]
    told = [each for each in prompts if each["prompt"]]
    if told:
        conn.execute(TELL_CYCLES, {"prompts": json.dumps(told)})


def _store(
    conn: sa.Connection,
    job: LockedJob,
    digests: Collection[str],
    *,
    items: Sequence[UUID] = (),
    motions: Sequence[Mapping[str, object]] = (),
    files: Sequence[Mapping[str, object]] = (),
) -> dict[str, UUID]:
    """Mark announced assets as stored, and write motions and succeeded items; return the assets by digest."""
    values = {
        "tenant": job.tenant,
        "job": job.id,
        "items": list(items),
        "digests": list(digests),
        "motions": json.dumps(motions),
        "files": json.dumps(files),
    }
    found = {row.sha256: row.id for row in conn.execute(FINISH, values)}
    if missing := set(digests) - set(found):
        raise ValueError(f"assets committed without begin_assets: {sorted(missing)}")
    return found


def _store_scopes(conn: sa.Connection, texts: Sequence[NewText], siblings: Mapping[UUID, Sequence[UUID]]) -> None:
    """Store verdicts of the encoder, for later jobs and on the items of each text."""
    judged = [(text, text.scope) for text in texts if text.scope is not None]
    if not judged:
        return
    rows = {scope.key: {"key": scope.key, "text_key": text.key, "scope": scope.scope} for text, scope in judged}
    ordered = [rows[key] for key in sorted(rows)]  # as the features: two commits may share keys
    conn.execute(insert(tables.prompt_scope).values(ordered).on_conflict_do_nothing())
    table = tables.item
    for text, scope in judged:
        ids = [text.item, *siblings[text.item]]
        conn.execute(sa.update(table).where(among(table.c.id, ids)).values(scope=dict(scope.scope)))


def _leave_text_stage(conn: sa.Connection, job: LockedJob, done: Sequence[LeasedItem]) -> dict[UUID, list[UUID]]:
    """Move items on, with ready ones of the same text and bundle; return the latter by the item they follow."""
    table = tables.item
    items, keys = [item.id for item in done], list({item.text_key for item in done})
    leaders = {(item.text_key, item.bundle): item.id for item in done}
    waiting = (
        (table.c.job_id == job.id)
        & (table.c.state == ItemState.READY)
        & (table.c.stage == ItemStage.TEXT)
        & among(table.c.text_key, keys)
    )
    columns = (table.c.id, table.c.queue, table.c.batch_key, table.c.solo, table.c.run_after)
    found = conn.execute(sa.select(*columns, table.c.text_key, table.c.bundle).where(waiting).with_for_update())
    siblings = [row for row in found if (row.text_key, row.bundle) in leaders]
    lanes = returned((row.queue, row.batch_key, row.solo) for row in siblings if row.run_after is None)
    change_lanes(conn, job.id, {lane: LaneChange(-gain.ready, -gain.solo) for lane, gain in lanes.items()})
    moved = conn.execute(
        sa.update(table)
        .where(among(table.c.id, [*items, *(row.id for row in siblings)]))
        .values(
            stage=ItemStage.GENERATE,
            queue=table.c.model,
            batch_key=table.c.generate_batch_key,
            state=ItemState.READY,
            lease_token=None,
            run_after=None,
            solo=False,  # a new stage starts with fresh attempts
            attempts=0,
            reason=str(Cause.TEXT_READY),
        )
        .returning(table.c.queue, table.c.batch_key)
    ).all()
    change_lanes(conn, job.id, returned((row.queue, row.batch_key, False) for row in moved))
    event = NewEvent("progress", f"{len(moved)} prompts parsed", data={"items": 0, "prompts": len(moved)})
    record(conn, job, [event], moved={(ItemState.LEASED, ItemState.READY): len(items)})
    followers: dict[UUID, list[UUID]] = {item: [] for item in items}
    for row in siblings:
        followers[leaders[row.text_key, row.bundle]].append(row.id)
    return followers


def _fail(conn: sa.Connection, item: LeasedItem, failure: ItemFailure, rules: Policy) -> tuple[ItemState, NewEvent]:
    stored_problem = document(failure.problem)
    message = failure.problem.message
    if not failure.retryable:
        end_items(conn, [item.id], ItemState.FAILED, Cause.ERROR, problem=stored_problem)
        return ItemState.FAILED, NewEvent("item_failed", message, item.id, {"problem": stored_problem})
    attempts = item.attempts + 1
    if attempts >= rules.max_attempts:
        return ItemState.DEAD, end_dead(conn, item, failure.problem)
    delay = min(rules.backoff * 2 ** (attempts - 1), rules.backoff_limit)
    conn.execute(
        sa.update(tables.item)
        .where(tables.item.c.id == item.id)
        .values(
            state=ItemState.READY,
            lease_token=None,
            attempts=attempts,
            run_after=CLOCK + interval(delay),
            reason=f"{Cause.ERROR}: {message}",
            problem=stored_problem,
        )
    )
    data = {"attempts": attempts, "delay": delay, "problem": stored_problem}
    return ItemState.READY, NewEvent("item_retried", f"again in {delay:g} s: {message}", item.id, data)
