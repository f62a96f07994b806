"""Upkeep: what a scheduler does at intervals, beside the relay and the webhooks."""

from __future__ import annotations

import threading
from functools import partial

import sqlalchemy as sa

from marey.core import metrics
from marey.core.settings import Settings
from marey.db import outages, transaction
from marey.evaluations import remove_unused_prompts
from marey.jobs import FailureReason, make_due, sweep
from marey.runtime.logs import logger
from marey.scheduler.evaluations import EvaluationScheduler
from marey.scheduler.periodic import Periodic
from marey.scheduler.servers import CHECK_SECONDS, server_check
from marey.storage import AssetStore, open_store
from marey.streams import abandoned_streams, end_stream
from marey.takes import delete_expired, remove_expired_makings, remove_stale_assets, rewrite_files

log = logger(__name__)

NO_WORKER = FailureReason(
    "unreachable", "no worker served this stream for 15 minutes", hint="Check that a worker of its model runs."
)
STALE_ASSETS_SECONDS = 600.0  # assets of a dead worker wait an hour anyway
ABANDONED_SECONDS = 900.0  # seconds that a stream waits for a worker, or for its worker's successor
ABANDONED_EVERY = 30.0


def upkeep(engine: sa.Engine, queue_url: str, chosen: Settings, stopping: threading.Event) -> list[Periodic]:
    """Return a component, not started yet, for each task.

    Raises:
        InvalidInput: the settings of the store are missing or invalid.
    """
    store = open_store(chosen)
    evaluations = EvaluationScheduler(engine, chosen)
    probe = partial(_reach, engine)
    hidden = partial(outages, engine)
    return [
        # A lease that expired during an outage of the database is not its worker's fault: let heartbeats come first.
        Periodic(
            "sweeper",
            partial(sweep_leases, engine),
            seconds=chosen.sweep_seconds,
            stopping=stopping,
            probe=probe,
            grace=chosen.lease_seconds,
            outages=hidden,
            meanwhile=partial(make_due, engine),
        ),
        Periodic(
            "retention",
            partial(retain, engine, store),
            seconds=chosen.retention_seconds,
            stopping=stopping,
            probe=probe,
        ),
        Periodic("stale_assets", partial(remove_stale, engine, store), seconds=STALE_ASSETS_SECONDS, stopping=stopping),
        Periodic(
            "streams",
            partial(end_abandoned, engine),
            seconds=ABANDONED_EVERY,
            stopping=stopping,
            probe=probe,
            grace=ABANDONED_EVERY,
            outages=hidden,
        ),
        Periodic("servers", server_check(engine, queue_url), seconds=CHECK_SECONDS, stopping=stopping),
        Periodic("evaluations", evaluations.round, seconds=chosen.evaluation_seconds, stopping=stopping),
    ]


def sweep_leases(engine: sa.Engine) -> None:
    """Return the items of expired leases to their queues, and count them."""
    report = sweep(engine)
    metrics.LEASES_LOST.inc(report.leases_lost)
    metrics.SWEPT.labels("ready").inc(report.items_returned)
    metrics.SWEPT.labels("dead").inc(report.items_dead)
    if report.leases_lost or report.items_dead:
        log.warning("swept", leases_lost=report.leases_lost, returned=report.items_returned, dead=report.items_dead)


def retain(engine: sa.Engine, store: AssetStore) -> None:
    """Delete jobs past their retention, and rewrite the files of erased ones."""
    deleted = delete_expired(engine, store)
    rewritten = rewrite_files(engine, store)
    if deleted or rewritten:
        log.info("retained", jobs_deleted=deleted, files_rewritten=rewritten)


def remove_stale(engine: sa.Engine, store: AssetStore) -> None:
    """Remove what dead processes left (unfinished assets, claims on files to make), and unused sets of prompts."""
    removed = remove_stale_assets(engine, store)
    if removed:
        log.info("stale_assets_removed", assets=removed)
    remove_expired_makings(engine)
    with transaction(engine) as conn:
        unused = remove_unused_prompts(conn)
    if unused:
        log.info("unused_prompts_removed", sets=unused)


def end_abandoned(engine: sa.Engine) -> None:
    """End streams that no worker has served for `ABANDONED_SECONDS`."""
    with transaction(engine) as conn:
        for stream in abandoned_streams(conn, ABANDONED_SECONDS):
            end_stream(conn, stream, None, NO_WORKER.message, problem=NO_WORKER)
            log.warning("stream_abandoned", stream=str(stream))


def _reach(engine: sa.Engine) -> None:
    with transaction(engine):
        pass
