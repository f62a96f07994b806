"""Submitting jobs for the toy, and the audit of what became of them."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Sequence
from uuid import UUID

import sqlalchemy as sa

from marey.db import transaction
from marey.evaluations.tables import evaluation_report
from marey.jobs import EVALUATOR_QUEUE, NewItem, NewJob, asset_key, get_job, submit
from marey.jobs.states import ENDED
from marey.jobs.tables import asset, item, job_event, lease, motion, motion_file, text_features
from marey.jobs.types import JobRow
from marey.storage import AssetStore
from marey.tenants.types import DEFAULT_TENANT
from tests.support.toy import QUEUE

TEXT_KEY = hashlib.sha256(b"toy").hexdigest()
BUNDLE = "toy@0123456789ab"


def submit_toys(
    engine: sa.Engine, prompts: Sequence[str], *, bundle: str = BUNDLE, queue: str = QUEUE, **settings: object
) -> UUID:
    """A job with one item a prompt; their text features are there already, so that they begin at `generate`."""
    lane = hashlib.sha256(repr((bundle, sorted(settings.items()))).encode()).hexdigest()
    items = [
        NewItem(
            index=index,
            prompt=prompt,
            model=queue,
            bundle=bundle,
            batch_key=lane,
            text_key=TEXT_KEY,
            text_batch_key="toy",
            seed=index,
            settings=settings,
        )
        for index, prompt in enumerate(prompts)
    ]
    with transaction(engine) as conn:
        known = conn.execute(sa.select(text_features.c.key).where(text_features.c.key == TEXT_KEY)).first()
        if known is None:
            conn.execute(text_features.insert().values(key=TEXT_KEY, blob=b"toy"))
        return submit(conn, NewJob(items)).id


def job_row(engine: sa.Engine, job: UUID) -> JobRow:
    """The job as it stands."""
    with transaction(engine) as conn:
        return get_job(conn, DEFAULT_TENANT, job)


def ended(engine: sa.Engine, job: UUID) -> bool:
    """Return True if every item of the job has ended."""
    return job_row(engine, job).state in ENDED


def states(engine: sa.Engine, job: UUID) -> dict[str, list[str]]:
    """Prompts by the state their item is in, in input order."""
    found: dict[str, list[str]] = {}
    with transaction(engine) as conn:
        for row in conn.execute(sa.select(item).where(item.c.job_id == job).order_by(item.c.position)):
            found.setdefault(row.state, []).append(row.prompt)
    return found


def audit(engine: sa.Engine, store: AssetStore) -> list[str]:
    """Violations in SQL and on the store, after everything has ended and one garbage collection."""
    wrong: list[str] = []
    with transaction(engine) as conn:
        items = conn.execute(sa.select(item)).all()
        motions = Counter(conn.execute(sa.select(motion.c.item_id)).scalars())
        leases = conn.execute(sa.select(lease.c.token)).scalars().all()
        assets = conn.execute(sa.select(asset)).all()
        used = set(conn.execute(sa.select(motion_file.c.asset_id)).scalars())
        used |= set(conn.execute(sa.select(evaluation_report.c.asset_id)).scalars())
        events = conn.execute(sa.select(job_event.c.job_id, job_event.c.seq)).all()
    wrong += [f"item {row.position} is {row.state}" for row in items if row.state in ("ready", "leased")]
    wrong += [f"item {row.position} holds a lease" for row in items if row.lease_token is not None]
    wrong += [
        f"item {row.position} is {row.state} and has {motions[row.id]} motions"
        for row in items
        if motions[row.id] != (row.state == "succeeded" and row.queue != EVALUATOR_QUEUE)
    ]
    wrong += [f"lease {token} is held" for token in leases]
    wrong += [f"asset {row.sha256[:8]} is {row.state}" for row in assets if row.state != "stored"]
    wrong += [f"asset {row.sha256[:8]} belongs to no motion or report" for row in assets if row.id not in used]
    rows = {asset_key(row.tenant_id, row.sha256) for row in assets}
    objects = set(store.keys())
    wrong += [f"object {key} has no row" for key in sorted(objects - rows)]
    wrong += [f"row {key} has no object" for key in sorted(rows - objects)]
    for job, seqs in _by_job(events).items():
        if seqs != list(range(1, len(seqs) + 1)):
            wrong.append(f"events of job {job} have gaps")
    return wrong


def _by_job(events: Sequence[sa.Row[tuple[UUID, int]]]) -> dict[UUID, list[int]]:
    by_job: dict[UUID, list[int]] = {}
    for job, seq in sorted((row.job_id, row.seq) for row in events):
        by_job.setdefault(job, []).append(seq)
    return by_job
