"""A database in which every table has rows and everything that has states is in each of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.db import transaction
from marey.db.ids import new_id
from marey.evaluations import EvaluationState, lock_evaluation, move_evaluation
from marey.evaluations import tables as evaluation_tables
from marey.jobs import (
    AssetDigest,
    ItemFailure,
    NewJob,
    Policy,
    Review,
    WorkerHeartbeat,
    beat,
    begin_assets,
    cancel,
    fail_items,
    get_job,
    list_items,
    pause,
    submit,
    sweep,
)
from marey.jobs import tables as job_tables
from marey.migrations.tables import metadata
from marey.streams import (
    NewStream,
    StreamChunk,
    StreamState,
    add_chunk,
    create_stream,
    end_stream,
    take_stream,
)
from marey.takes import NewEdit, erase, reroll, review, submit_edit
from marey.tenants import DEFAULT_TENANT, Actor, Quotas, audit, create_key, create_tenant, rotate_key
from marey.webhooks import Attempt, EventKind, claim_deliveries, record_attempt
from tests.servers.jobs import MODEL, PROBLEM, claim_some, commit_all, let_expire, new_item, parse_texts, submit_items
from tests.support.evaluations import new_evaluation
from tests.support.schedules import new_schedule
from tests.support.webhooks import new_webhook

TRACE = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01"
JUDGE = "judge"
STATES = {
    ("job", "state"): {"queued", "running", "paused", "succeeded", "cancelled", "partial", "failed"},
    ("job", "kind"): {"generate", "edit"},
    ("item", "state"): {"ready", "leased", "succeeded", "failed", "dead", "cancelled"},
    ("item", "stage"): {"text", "generate"},
    ("asset", "state"): {"writing", "stored"},
    ("motion", "review"): {"kept", "rejected", "rerolled"},
    ("stream", "state"): {"waiting", "live", "paused", "ended", "failed"},
    ("evaluation", "state"): {"planned", "generating", "scoring", "done", "failed", "cancelled"},
    ("webhook_delivery", "state"): {"pending", "delivered", "failed"},
}
"""Required values of a fill, by column."""


def fill(engine: sa.Engine) -> None:
    """Fill an empty database of this version."""
    new_webhook(engine, "https://studio.example/hook", *EventKind)
    _tenants(engine)
    _jobs(engine)
    _streams(engine)
    _evaluations(engine)
    _deliveries(engine)
    with transaction(engine) as conn:
        beat(conn, WorkerHeartbeat("w", "hgm3", "host", 7, "cpu", "tiny@0", "batch of tiny@0"))


def _tenants(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        create_tenant(conn, "studio", Quotas(queued=1000, running=10, bytes=10**12, streams=3))
        key = create_key(conn, "ann", ["submit", "read"], tenant="studio", lifetime=1e6).key
        rotate_key(conn, "studio", key.id)
        audit(conn, "studio", Actor("ann", key.id), "key.rotate", key.id, why="yearly")


def _jobs(engine: sa.Engine) -> None:
    rich = [new_item(k, name=f"take {k}", tags=("show=one", f"shot={k}"), seconds=2.0) for k in range(9)]
    with transaction(engine) as conn:
        job = submit(
            conn,
            NewJob(rich, name="rich", comment="first", priority=5, fail_early=0.9, keep_days=30, traceparent=TRACE,
                   idempotency_key="once", body_sha256="0" * 64),
        ).id  # fmt: skip
    parse_texts(engine)
    with transaction(engine) as conn:
        text_key = conn.execute(sa.select(job_tables.text_features.c.key).limit(1)).scalar_one()
        verdict = {"key": "judged", "text_key": text_key, "scope": {"verdict": "known"}}
        conn.execute(sa.insert(job_tables.prompt_scope).values(verdict))
    commit_all(engine, claim_some(engine, limit=4))
    with transaction(engine) as conn:
        motions = [item.motion.id for item in list_items(conn, DEFAULT_TENANT, job).rows if item.motion]
        review(conn, DEFAULT_TENANT, motions[:1], Review.KEPT, by="ann", comment="good")
        review(conn, DEFAULT_TENANT, motions[1:2], Review.REJECTED, by="ann")
        reroll(conn, DEFAULT_TENANT, motions[2:3], lambda item: new_item(item.index, item.prompt), by="ann")
    _made_files(engine, motions[0])
    _rigs(engine, motions[0])
    with transaction(engine) as conn:
        submit_edit(conn, NewEdit(motions[0], [{"op": "mirror"}]))
    _end(engine, retryable=False)
    _end(engine, retryable=True)
    _die(engine)
    _erased(engine)
    _ended(engine)
    submit_items(engine, [new_item(0, "nobody has read this")], tenant="studio")
    held = claim_some(engine, limit=1, worker="busy")
    with transaction(engine) as conn:
        begin_assets(conn, held.lease_token, [AssetDigest("a" * 64, 7, "application/x-npz")])


def _made_files(engine: sa.Engine, motion: UUID) -> None:
    """A file made on request, one that is being made, and one that cannot be made."""
    file, asset, row = job_tables.motion_file.c, job_tables.asset.c, {"motion_id": motion, "tenant_id": DEFAULT_TENANT}
    late = {"expires_at": sa.func.now()}
    with transaction(engine) as conn:
        stored = conn.execute(
            sa.select(asset.id, asset.size)
            .join(job_tables.motion_file, file.asset_id == asset.id)
            .where(file.motion_id == motion)
        ).first()
        assert stored is not None
        for name, values in (
            ("made", {"asset_id": stored.id, "size": stored.size}),
            ("making", {"claim": motion, **late}),
            ("refused", {"problem": {"type": "invalid-input", "message": "no"}, **late}),
        ):
            conn.execute(sa.insert(job_tables.made_file).values(**row, key=name, format="glb", **values))


def _rigs(engine: sa.Engine, motion: UUID) -> None:
    """A rig with a map and one without, and a file made on one."""
    row = {"tenant_id": DEFAULT_TENANT, "format": "glb", "added_by": "ann", "report": {"family": "mixamo"}}
    with transaction(engine) as conn:
        asset = conn.execute(sa.select(job_tables.asset.c.id).limit(1)).scalar_one()
        for name, rig_map in (("hero", {"left_hand": "Hand_L"}), ("extra", sa.null())):
            rig = {"id": new_id(), "name": name, "asset_id": asset, "map": rig_map, **row}
            conn.execute(sa.insert(job_tables.rig).values(**rig))
        made = {"motion_id": motion, "tenant_id": DEFAULT_TENANT, "format": "glb", "key": "on a rig"}
        values = {**made, "rig_id": rig["id"], "claim": motion, "expires_at": sa.func.now()}
        conn.execute(sa.insert(job_tables.made_file).values(**values))


def _end(engine: sa.Engine, *, retryable: bool) -> None:
    held = claim_some(engine, limit=1)
    with transaction(engine) as conn:
        fail_items(conn, held.lease_token, [ItemFailure(held.items[0].id, PROBLEM, retryable)])


def _die(engine: sa.Engine) -> None:
    """An item that was alone in a lease, and lost it."""
    rules = Policy(max_attempts=1)
    while not sweep(engine, rules=rules).items_dead:
        let_expire(engine, claim_some(engine, limit=1).lease_token)


def _erased(engine: sa.Engine) -> None:
    job = submit_items(engine, 1, priority=900, name="secret")
    parse_texts(engine)
    commit_all(engine, claim_some(engine, limit=1))
    with transaction(engine) as conn:
        erase(conn, DEFAULT_TENANT, job, by="ann")


def _ended(engine: sa.Engine) -> None:
    """Jobs that are paused, cancelled, failed and partly done."""
    with transaction(engine) as conn:
        pause(conn, DEFAULT_TENANT, submit(conn, NewJob([new_item(0)])).id)
        cancel(conn, DEFAULT_TENANT, submit(conn, NewJob([new_item(0)])).id)
    for count in (1, 2):
        job = submit_items(engine, count, priority=900)
        parse_texts(engine)
        held = claim_some(engine, limit=2)
        with transaction(engine) as conn:
            fail_items(conn, held.lease_token, [ItemFailure(held.items[0].id, PROBLEM, retryable=False)])
        if count == 2:
            commit_all(engine, held, [held.items[1].id])
        with transaction(engine) as conn:
            assert get_job(conn, DEFAULT_TENANT, job).state == ("failed" if count == 1 else "partial")


def _streams(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        key = create_key(conn, "live", ["submit"], tenant=DEFAULT_TENANT).key.id
        wanted = ("waiting", "live", "paused", "ended", "failed")
        streams = {
            state: create_stream(conn, NewStream(DEFAULT_TENANT, key, "walk", "stroller", "m@0", 1, 9, state), limit=9)
            for state in wanted
        }
        for state, stream in streams.items():
            if state != "waiting":
                take_stream(conn, stream, 1, "live worker")
                add_chunk(conn, stream, 1, StreamChunk(0, 2, b"\0" * 8, [(0, "walk")], "1-0", StreamState.LIVE))
        add_chunk(conn, streams["paused"], 1, StreamChunk(2, 0, b"", [], "2-0", StreamState.PAUSED))
        clip = new_item(0, "walk", model="stroller", text_key="stream-1")
        end_stream(conn, streams["ended"], 1, "stopped", clip=(clip, b"recording"))
        end_stream(conn, streams["failed"], 1, "broken", problem=PROBLEM)


def _evaluations(engine: sa.Engine) -> None:
    schedule = new_schedule(engine)
    for way in (
        (),
        (EvaluationState.GENERATING,),
        (EvaluationState.GENERATING, EvaluationState.SCORING, EvaluationState.DONE),
        (EvaluationState.GENERATING, EvaluationState.SCORING),
        (EvaluationState.FAILED,),
        (EvaluationState.CANCELLED,),
    ):
        evaluation = new_evaluation(engine)
        for state in way:
            _move(engine, evaluation, state)
    evaluation = new_evaluation(engine)
    table = evaluation_tables.evaluation
    with transaction(engine) as conn:
        conn.execute(
            sa.update(table).where(table.c.id == evaluation).values(schedule_id=schedule, due_at=sa.func.now())
        )
        key = {"tenant_id": DEFAULT_TENANT, "key": "evaluated once", "body_sha256": "1" * 64}
        conn.execute(
            sa.insert(job_tables.idempotency).values(**key, evaluation_id=evaluation, created_at=sa.func.now())
        )


def _move(engine: sa.Engine, evaluation: UUID, state: EvaluationState) -> None:
    values: dict[str, Any] = {}
    if state is EvaluationState.DONE:
        _score(engine)
        values = {"summary": {"fid": 1.5}, "regressed": True}
    with transaction(engine) as conn:
        row = lock_evaluation(conn, evaluation)
        assert row is not None
        if state in {EvaluationState.GENERATING, EvaluationState.SCORING}:
            generating = state is EvaluationState.GENERATING
            item = new_item(0, f"of {evaluation}", model=MODEL if generating else JUDGE)
            values["generate_job_id" if generating else "score_job_id"] = submit(conn, NewJob([item], metered=False)).id
        move_evaluation(conn, row, state, "told", **values)
        if state is EvaluationState.DONE:
            asset = conn.execute(sa.select(job_tables.asset.c.id).limit(1)).scalar_one()
            report = {"evaluation_id": evaluation, "format": "json", "asset_id": asset}
            conn.execute(sa.insert(evaluation_tables.evaluation_report).values(**report))


def _score(engine: sa.Engine) -> None:
    """The jobs that judge end; the one of an evaluation that is being scored comes later."""
    parse_texts(engine)
    commit_all(engine, claim_some(engine, JUDGE))


def _deliveries(engine: sa.Engine) -> None:
    """One that arrived, one that will be tried again, one that was given up."""
    with transaction(engine) as conn:
        due = claim_deliveries(conn, 3, each=3)
        record_attempt(conn, due[0], Attempt(200, 0.1, None))
        record_attempt(conn, due[1], Attempt(500, 0.1, "it is broken"))
        table = metadata.tables["webhook_delivery"]
        conn.execute(
            sa.update(table).where(table.c.claim == due[2].claim, table.c.event_id == due[2].event).values(attempts=99)
        )
        record_attempt(conn, replace(due[2], tries=99), Attempt(None, 1.0, "nobody is there"))
