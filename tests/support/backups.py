"""Jobs, motions, edits and rigs of a tenant, for tests of backups."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.db import transaction
from marey.jobs import (
    EDIT_QUEUE,
    ItemFailure,
    JobRow,
    NewMotion,
    Review,
    asset_key,
    begin_assets,
    cancel,
    commit_motions,
    events_after,
    fail_items,
    get_job,
    list_items,
)
from marey.jobs.types import EventRow, ItemRow
from marey.storage import FolderStore
from marey.takes import NewEdit, NewRig, add_rig, list_rigs, reroll, review, submit_edit
from marey.tenants import Actor
from tests.servers.jobs import MODEL, PROBLEM, claim_some, motion_of, new_item, parse_texts, submit_items

TABLES = "job, asset, text_features, idempotency"


def work(engine: sa.Engine, store: FolderStore, *, fail: int = 0, queue: str = MODEL) -> None:
    claimed = claim_some(engine, queue)
    good = claimed.items[: len(claimed.items) - fail]
    motions: list[NewMotion] = [motion_of(item.id) for item in good]
    with transaction(engine) as conn:
        begin_assets(conn, claimed.lease_token, [file for motion in motions for file in motion.files.values()])
        for motion in motions:
            store.put(asset_key("default", motion.files["npz"].sha256), str(motion.item).encode())
        bad = claimed.items[len(good) :]
        fail_items(conn, claimed.lease_token, [ItemFailure(item.id, PROBLEM, False) for item in bad])
        commit_motions(conn, claimed.lease_token, motions)


def studio(engine: sa.Engine, store: FolderStore) -> list[UUID]:
    """A job with a failed item, a verdict and a re-roll; one that was cancelled before its prompts were read."""
    rows = [{"start": 0.0, "end": 3.0, "prompt": "walk"}]
    items = [new_item(k, name=f"n{k}", tags=(f"shot={k}",)) for k in range(4)]
    items[0] = replace(
        items[0], timeline=rows, constraints=[{"type": "root_path", "frames": [0], "positions_xz": [[0.0, 1.0]]}]
    )
    rich = submit_items(engine, items, name="rich")
    parse_texts(engine)
    work(engine, store, fail=1)
    with transaction(engine) as conn:
        motions = [item.motion.id for item in list_items(conn, "default", rich).rows if item.motion]
        review(conn, "default", motions[:1], Review.KEPT, by="ann", comment="good")
        reroll(conn, "default", motions[1:2], lambda item: new_item(item.index, item.prompt), by="ann")
    work(engine, store)
    gone = submit_items(engine, [new_item(0, "nobody walks")], keep_days=1)
    with transaction(engine) as conn:
        cancel(conn, "default", gone)
    return [rich, gone]


def snapshot(engine: sa.Engine, jobs: Sequence[UUID]) -> list[tuple[JobRow, Sequence[ItemRow], list[EventRow]]]:
    with transaction(engine) as conn:
        return [
            (get_job(conn, "default", job), list_items(conn, "default", job).rows, events_after(conn, "default", job))
            for job in jobs
        ]


def contents(store: FolderStore) -> dict[str, bytes]:
    return {key: store.get(key) for key in list(store.keys())}


def lose_everything(engine: sa.Engine, store: FolderStore) -> None:
    with transaction(engine) as conn:
        conn.execute(sa.text(f"TRUNCATE {TABLES} CASCADE"))
    for key in list(store.keys()):
        store.delete(key)


def motion_in(engine: sa.Engine, job: UUID) -> UUID:
    """The first motion of a job."""
    with transaction(engine) as conn:
        (first, *_) = (item.motion.id for item in list_items(conn, "default", job).rows if item.motion)
    return first


def character(
    engine: sa.Engine,
    store: FolderStore,
    name: str = "hero",
    data: bytes = b"a character",
    rig_map: dict[str, str | None] | None = None,
) -> None:
    new = NewRig("default", name, "glb", data, rig_map, {"parts": {"hips": {"joint": "Hips", "how": "words"}}})
    add_rig(engine, store, new, Actor("ann", None), limit=9)


def rigs_of(engine: sa.Engine) -> list[dict[str, Any]]:
    """The rigs, in the order of their names; their ids are made anew."""
    with transaction(engine) as conn:
        rows = list_rigs(conn, "default").rows
    return sorted(({**vars(row), "id": None} for row in rows), key=lambda row: row["name"])


def mirrored(engine: sa.Engine, store: FolderStore, source: UUID) -> UUID:
    """The finished job of an edit of a job's motion."""
    with transaction(engine) as conn:
        made = submit_edit(conn, NewEdit(motion_in(engine, source), [{"op": "mirror"}])).id
    work(engine, store, queue=EDIT_QUEUE)
    return made
