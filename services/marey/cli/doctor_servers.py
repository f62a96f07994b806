"""Checks of the database, queue, store and workers of a server, for `marey doctor` on a machine that reaches them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from marey.cli.database import engine_of, settings_here
from marey.cli.doctor_findings import Finding, broken, free_space
from marey.cli.ports import try_port
from marey.client.server_address import read_server
from marey.core.errors import MareyError, Unreachable

if TYPE_CHECKING:
    import sqlalchemy as sa

    from marey.core.settings import Settings
    from marey.jobs import SchedulerRow
    from marey.storage import AssetStore

SKEW_WARN, SKEW_BAD = 2.0, 60.0
"""Seconds. Leases and retries go by the database's clock alone; signed URLs and webhooks' signatures by the machine's:
receivers allow five minutes, object stores fifteen."""
UNSWEPT = 30.0
"""Seconds after which a lease that ran out should have been taken back many times over."""


def check_backing() -> Iterator[Finding]:
    """Run each check by itself; only that of the port if no server is named and none runs here."""
    from marey.core.settings import settings

    config = settings_here()
    home = config.home.expanduser().absolute()
    runs_here = read_server(home) is not None
    if not runs_here and not os.environ.get("MAREY_SERVER"):
        yield _port(config)
    if not runs_here and settings().database_url is None:
        return
    engine = engine_of(config)
    try:
        found = database(engine)
        yield found
        if found.state != "bad":
            yield from _guarded("clock", lambda: _clock(engine))
            yield from _guarded("workers", lambda: workers(engine, home / "logs" if runs_here else None))
            yield from _guarded("scheduler", lambda: scheduler(engine))
    finally:
        engine.dispose()
    yield from _queues(config)
    yield from store(config)


def _guarded(name: str, check: Callable[[], Finding]) -> Iterator[Finding]:
    try:
        yield check()
    except MareyError as error:
        yield broken(name, error)


def _port(config: Settings) -> Finding:
    try:
        try_port(config.host, config.port)
    except MareyError as error:
        return Finding("port", "warn", error.message, error.hint)
    return Finding("port", "ok", f"{config.port} of {config.host} is free for `marey serve`")


def database(engine: sa.Engine) -> Finding:
    """Check that the database answers and has the tables of this version."""
    from marey.db import check_revision, transaction
    from marey.jobs import server_version

    try:
        with transaction(engine) as conn:
            version = server_version(conn)
        check_revision(engine)
    except MareyError as error:
        return broken("database", error)
    return Finding("database", "ok", f"PostgreSQL {version}, with all that this version needs")


def _clock(engine: sa.Engine) -> Finding:
    from marey.db import transaction
    from marey.jobs import database_now

    with transaction(engine) as conn:
        before = datetime.now(UTC)
        there = database_now(conn)
        after = datetime.now(UTC)
    return clock_check(there, before, after)


def clock_check(there: datetime, before: datetime, after: datetime) -> Finding:
    """Compare the database's clock with this machine's, which was read before and after it."""
    skew = max(before - there, there - after, timedelta()).total_seconds()
    state = "bad" if skew > SKEW_BAD else "warn" if skew > SKEW_WARN else "ok"
    hint = None if state == "ok" else "Let both machines take the time from one source (NTP)."
    return Finding("clock", state, f"{skew:.1f} s between this machine and the database", hint)


def workers(engine: sa.Engine, logs: Path | None = None) -> Finding:
    """Check that every queue with waiting items has a worker, and that every worker reports.

    Args:
        logs: of the `marey serve` that runs here and starts workers itself; None = there is none.
    """
    from marey.db import transaction
    from marey.jobs import list_workers, queue_depths

    with transaction(engine) as conn:
        known, depths = list_workers(conn), queue_depths(conn)
    live = sorted({worker.queue for worker in known if worker.live})
    if not live and logs is not None:
        hint = f"Wait while it loads its model; if that takes minutes, see {logs}."
        return Finding("workers", "warn", "none is ready yet; the server that runs here starts its own", hint)
    alone = sorted({row.queue for row in depths if row.waiting} - set(live))
    if alone:
        message = f"items wait in {', '.join(alone)}, and no worker serves that"
        return Finding("workers", "bad", message, f"Start one: `marey worker {'+'.join(alone)}`; `marey models list`.")
    if not live:
        return Finding(
            "workers", "warn", "none was heard of lately", "`marey serve` or `marey worker hgm3` starts one."
        )
    silent = [f"{worker.id} on {worker.host}" for worker in known if not worker.live]
    if silent:
        message = f"{', '.join(silent[:3])} fell silent, last heard of {known[-1].seen:%H:%M} UTC"
        return Finding("workers", "warn", message, "See its log; what it held goes to others by itself.")
    return Finding("workers", "ok", f"{len([w for w in known if w.live])} live, for {', '.join(live)}")


def scheduler(engine: sa.Engine) -> Finding:
    """Check that a scheduler has reported lately and takes back expired leases."""
    from marey.db import transaction
    from marey.jobs import list_schedulers, overdue_leases

    with transaction(engine) as conn:
        unswept, known = overdue_leases(conn, UNSWEPT), list_schedulers(conn)
    if known and not known[0].live:
        message = f"no scheduler works: {_silence_of(known[0])}"
        return Finding("scheduler", "bad", message, f"See its log. {STALLED_HINT}")
    if unswept:
        message = f"{unswept} leases ran out over {UNSWEPT:g} s ago, and nobody took them back"
        return Finding("scheduler", "bad", message, "Start `marey scheduler`, or see its log.")
    if not known:
        return Finding(
            "scheduler", "warn", "none was heard of lately", "`marey serve` or `marey scheduler` starts one."
        )
    if silent := [row for row in known if not row.live]:
        return Finding("scheduler", "warn", f"another works, but {_silence_of(silent[0])}", STALLED_HINT)
    return Finding("scheduler", "ok", f"{len(known)} at work, no lease is overdue")


STALLED_HINT = (
    "A scheduler that stalls exits by itself, and its supervisor starts another; if none does: `marey scheduler`."
)


def _silence_of(row: SchedulerRow) -> str:
    return (
        f"that on {row.host} (process {row.pid}) stalled or was killed; its last progress was "
        f"{row.silence:.0f} s ago, at {row.seen:%H:%M:%S} UTC"
    )


def _queues(config: Settings) -> Iterator[Finding]:
    from marey.embedded import valkey_url

    named = config.queue_url
    url = valkey_url(config.home.expanduser().absolute()) if named is None else named.get_secret_value()
    yield queue("queue", url)
    if config.streams_url is not None:
        yield queue("streams", config.streams_url.get_secret_value())


def queue(name: str, url: str) -> Finding:
    """Check that Redis answers and evicts no keys."""
    import redis

    from marey.runtime.queue import check_queue, redis_client

    try:
        version = check_queue(url)
        with redis_client(url) as client:
            policy = _memory_policy(client)
    except MareyError as error:
        return broken(name, error)
    except (redis.RedisError, ValueError) as error:
        hint = "Is it running, and is MAREY_QUEUE_URL (MAREY_STREAMS_URL) right? Embedded: `marey serve` starts it."
        return Finding(name, "bad", f"it does not answer ({type(error).__name__})", hint)
    if policy is None:
        message = f"Redis {version}; it does not tell its maxmemory-policy"
        return Finding(name, "warn", message, "See that it is noeviction.")
    if policy != "noeviction":
        message = f"Redis {version}, maxmemory-policy {policy}: it may throw away hints and frames"
        return Finding(name, "bad", message, "Set maxmemory-policy noeviction.")
    return Finding(name, "ok", f"Redis {version}, noeviction")


def _memory_policy(client: object) -> str | None:
    """Return the eviction policy; None if the server refuses CONFIG, as hosted ones often do."""
    import redis

    try:
        return client.config_get("maxmemory-policy").get("maxmemory-policy")  # pyright: ignore[reportAttributeAccessIssue]
    except redis.ResponseError:
        return None


def store(config: Settings) -> Iterator[Finding]:
    """Check that the store writes, reads and deletes."""
    from marey.storage import FolderStore, open_store

    try:
        assets = open_store(config)
        assets.check()
        _try_store(assets)
    except MareyError as error:
        yield broken("store", error)
        return
    yield Finding("store", "ok", f"{config.store or config.home / 'assets'} takes, gives and deletes objects")
    if isinstance(assets, FolderStore):
        yield free_space("store", assets.root)


def _try_store(store: AssetStore) -> None:
    """Write, read and delete an object.

    Raises:
        Unreachable: one of these does not work.
    """
    content = os.urandom(32)
    key = f"doctor/probe-{content.hex()[:16]}"
    store.put(key, content)
    try:
        if store.get(key) != content:
            raise Unreachable("it gave other bytes than it was given", where=key, hint="Check its disks.")
    finally:
        store.delete(key)
    if store.exists(key):
        raise Unreachable("what was deleted is still there", where=key, hint="Check what the keys may do.")
