"""Faults of a chaos run, and the recovery time after each."""

from __future__ import annotations

import os
import random
import signal
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from functools import partial
from uuid import UUID

import httpx2
import sqlalchemy as sa

from marey.db import transaction
from marey.jobs.tables import item, lease
from marey.runtime.faults import retry_unreachable
from marey.runtime.status import read_status
from marey.takes import collect_garbage
from tests.chaos.driver import Cluster
from tests.chaos.places import Place
from tests.chaos.silence import ALL_SILENT, OPEN_SILENT, UNDER_WAY, EventProbe, stall
from tests.chaos.studios import ask, client_of
from tests.servers.stalling_proxy import StallingProxy

LIMIT = 600.0  # seconds; what takes longer to answer again fails the run
LOOK = 0.05


def now() -> datetime:
    """The machine's clock, which is the database's too."""
    return datetime.now(UTC)


@dataclass
class Fault:
    """Something that was broken.

    Attributes:
        at: when it was broken. back: when it was there again.
        held: items that a killed worker held, and `leases` by which.
        waits: seconds until things that were waited for at once, by what they are.
    """

    kind: str
    at: datetime
    back: datetime | None = None
    held: list[UUID] = field(default_factory=list)
    leases: list[UUID] = field(default_factory=list)
    waits: dict[str, float] = field(default_factory=dict)


class Breaker:
    """Breaks one thing at a time of a cluster, by seeded draws.

    Args:
        url, key: of the API. metrics_url: of the scheduler.
        workers: how many `worker-N` there are.
        start: starts the process of a name.
        longest: seconds by which outages are measured.
        start_again: starts what has ended by itself.
        probe: follows the events of a job.
    """

    def __init__(
        self,
        cluster: Cluster,
        place: Place,
        *,
        probe: EventProbe,
        draw: random.Random,
        url: str,
        key: str,
        metrics_url: str,
        workers: int,
        start: Mapping[str, Callable[[], None]],
        longest: float,
        start_again: Callable[[], None],
    ) -> None:
        self._cluster = cluster
        self._place = place
        self._draw = draw
        self._url, self._key, self._metrics_url = url, key, metrics_url
        self._workers = workers
        self._start = start
        self._longest = longest
        self._start_again = start_again
        self._probe = probe
        self.faults: list[Fault] = []
        self.kinds = self._kinds()

    def _kinds(self) -> dict[str, Callable[[Fault], None]]:
        """Return what breaks something of each kind."""
        place, proxies = self._place, dict(self._cluster.proxies)
        if place.proxy is not None:
            proxies["store"] = place.proxy
        kinds: dict[str, Callable[[Fault], None]] = {
            "worker's child killed": self._child,
            "worker killed, its child left": self._parent,
            "worker and child killed": self._worker,
            "worker stopped for a while": self._freeze,
            "scheduler killed": self._scheduler,
            "API killed": self._api,
            "queue flushed": self._flush,
            "queue killed": self._valkey,
            "Postgres stopped (fast)": lambda fault: self._postgres(fault, "fast"),
            "Postgres stopped (immediate)": lambda fault: self._postgres(fault, "immediate"),
            "Postgres killed": lambda fault: self._postgres(fault, "kill"),
            "Postgres session killed": lambda fault: self._postgres(fault, "session"),
            "store away": lambda fault: self._without_store(fault, place.away()),
            "store full": lambda fault: self._without_store(fault, place.full()),
            "garbage collected": self._collect,
        }
        for name, proxy in proxies.items():
            kinds[f"{name} {OPEN_SILENT}"] = partial(self._open_silent, proxy=proxy)
            kinds[f"{name} {ALL_SILENT}"] = partial(self._all_silent, proxy=proxy)
        return kinds

    def break_one(self, kind: str) -> Fault:
        """Break something of this kind and bring it back."""
        fault = Fault(kind, now())
        self.faults.append(fault)
        self.kinds[kind](fault)
        fault.back = fault.back or now()
        return fault

    # --- processes ---

    def _some_worker(self) -> str:
        return f"worker-{self._draw.randrange(self._workers)}"

    def _note_held(self, fault: Fault, name: str) -> None:
        query = sa.select(item.c.id, lease.c.token).join(lease, lease.c.token == item.c.lease_token)
        ours = query.where(lease.c.worker.like(f"{name}/%"))

        def look() -> Sequence[sa.Row[tuple[UUID, UUID]]]:
            with transaction(self._cluster.engine) as conn:
                return conn.execute(ours).all()

        rows = retry_unreachable(look, seconds=LIMIT)
        fault.held, fault.leases = [row.id for row in rows], list({row.token for row in rows})
        fault.at = now()

    def _child(self, fault: Fault) -> None:
        name = self._some_worker()
        self._note_held(fault, name)
        if self._cluster.child(name):
            self._cluster.kill_child(name)

    def _parent(self, fault: Fault) -> None:
        """Its child goes on until its drain ends, for all it knows: what it held shows as lost only if it was."""
        name = self._some_worker()
        self._note_held(fault, name)
        self._cluster.kill(name, children=False)
        self._away(3.0)
        self._start[name]()

    def _worker(self, fault: Fault) -> None:
        name = self._some_worker()
        self._note_held(fault, name)
        self._cluster.kill(name)
        self._away(3.0)
        self._start[name]()

    def _freeze(self, fault: Fault) -> None:
        """SIGSTOP for longer than a lease lasts: after it wakes up, its items belong to another worker."""
        name = self._some_worker()
        status = read_status(self._cluster.home, name)
        if status is None or not self._cluster.child(name):
            return
        self._note_held(fault, name)
        try:
            os.kill(status.pid, signal.SIGSTOP)
            self._away(2 * self._longest, least=self._longest)
            os.kill(status.pid, signal.SIGCONT)
        except ProcessLookupError:
            return

    def _scheduler(self, fault: Fault) -> None:
        self._cluster.kill("scheduler")
        self._away(3.0)
        self._start["scheduler"]()
        fault.back = now()
        for part in ("relay", "sweeper"):
            self._wait(fault, f"{part} at work", lambda part=part: self._rounds(part) > 0)

    def _api(self, fault: Fault) -> None:
        self._cluster.kill("api")
        self._away(2.0)
        self._start["api"]()
        fault.back = now()
        self._wait(fault, "API answers", self._answers)

    # --- servers ---

    def _flush(self, _fault: Fault) -> None:
        self._cluster.flush_queue()

    def _valkey(self, fault: Fault) -> None:
        self._cluster.restart_valkey(self._draw.uniform(0.0, 4.0))
        fault.back = now()

    def _postgres(self, fault: Fault, how: str) -> None:
        self._cluster.restart_postgres(self._draw.uniform(0.0, 4.0), how)
        fault.back = now()
        self._wait(fault, "API answers", self._answers)

    def _without_store(self, fault: Fault, gone: AbstractContextManager[None]) -> None:
        with gone:
            self._away(1.5 * self._longest, least=1.0)
        fault.back = now()

    def _open_silent(self, fault: Fault, *, proxy: StallingProxy) -> None:
        stall(proxy, new=False)
        fault.at = fault.back = now()
        self._wait_for_all(fault)

    def _all_silent(self, fault: Fault, *, proxy: StallingProxy) -> None:
        """A third of them for up to a minute, where outages are measured by ten seconds."""
        stall(proxy, new=True)
        fault.at = now()
        most = self._longest * self._draw.choice((1, 1, 6))
        self._away(most, least=most / 2)
        proxy.resume()
        fault.back = now()
        self._wait_for_all(fault)

    def _collect(self, _fault: Fault) -> None:
        """No fault: it must do no harm at any moment."""
        retry_unreachable(lambda: collect_garbage(self._cluster.engine, self._place.store), seconds=LIMIT)

    # --- waiting ---

    def _away(self, most: float, least: float = 0.0) -> None:
        time.sleep(self._draw.uniform(least, most))

    def _wait(self, fault: Fault, what: str, condition: Callable[[], bool]) -> None:
        assert fault.back is not None
        deadline = time.monotonic() + LIMIT
        while not condition():
            if time.monotonic() > deadline:
                raise AssertionError(f"{fault.kind}, and then not in {LIMIT:.0f} s: {what}\n{self._cluster.logs()}")
            self._start_again()
            time.sleep(LOOK)
        fault.waits[what] = (now() - fault.back).total_seconds()

    def _wait_for_all(self, fault: Fault) -> None:
        """Wait for everything at the same time, each on a thread: what hangs must not hide when the others came."""
        conditions: dict[str, Callable[[], bool]] = {
            "API answers": self._answers,
            "event delivered": self._probe.delivers,
        }
        for part in ("relay", "sweeper"):
            before = self._rounds(part)
            conditions[f"{part} at work"] = lambda part=part, before=before: self._rounds(part) not in (0.0, before)
        assert fault.back is not None
        with ThreadPoolExecutor(len(conditions)) as threads:
            waiting = {what: threads.submit(_until, condition) for what, condition in conditions.items()}
            while not all(future.done() for future in waiting.values()):
                self._start_again()
                time.sleep(LOOK)
        for what, future in waiting.items():
            when = future.result()
            if when is None:
                raise AssertionError(f"{fault.kind}, and then not in {LIMIT:.0f} s: {what}\n{self._cluster.logs()}")
            fault.waits[what] = (when - fault.back).total_seconds()

    def _answers(self) -> bool:
        with client_of(self._url, self._key) as http:
            answer = ask(http, "GET", "/v1/jobs", params={"limit": 1})
        return answer is not None and answer.status_code == httpx2.codes.OK

    def _rounds(self, part: str) -> float:
        """Rounds that this part of the scheduler has done since it was started."""
        try:
            with urllib.request.urlopen(self._metrics_url, timeout=5) as response:
                lines = response.read().decode().splitlines()
        except (urllib.error.URLError, OSError):
            return 0.0
        wanted = f'marey_scheduler_rounds_total{{outcome="done",part="{part}"}}'
        return next((float(line.rpartition(" ")[2]) for line in lines if line.startswith(wanted)), 0.0)


def _until(condition: Callable[[], bool]) -> datetime | None:
    """When a condition held first; None = not within the limit of a run."""
    deadline = time.monotonic() + LIMIT
    while not condition():
        if time.monotonic() > deadline:
            return None
        time.sleep(4 * LOOK)
    return now()


# --- what the ledger says of it afterwards ---

STARTED_AGAIN = """
    SELECT min(at) FROM ledger_item
    WHERE after = 'leased' AND at > :at AND item = ANY(:items) AND NOT lease = ANY(:leases)
"""
SINCE_FAULT = frozenset({"all items given back", "first item again"})
"""Counted from the fault itself; other waits from when what was broken is back."""
GIVEN_BACK = """
    SELECT max(at) FROM ledger_item WHERE after = 'ready' AND at > :at AND item = ANY(:items) AND lease = ANY(:leases)
"""
MEANWHILE = """
    SELECT CASE WHEN job = ANY(:jobs) THEN 'their jobs' ELSE 'other jobs' END, reason, count(*), count(DISTINCT lease)
    FROM ledger_item WHERE after = 'leased' AND at BETWEEN :since AND :until GROUP BY 1, 2
"""
STEERED = """
    SELECT at, kind, reason, data FROM job_event WHERE job_id = ANY(:jobs) AND at BETWEEN :since AND :until ORDER BY at
"""
JOBS = "SELECT array_agg(DISTINCT job_id) FROM item WHERE id = ANY(:items)"
PATIENCE = 15.0
WANTED = {"Postgres": ("succeeded", "leased"), "store": ("succeeded",), "queue": ("leased",)}
NEXT_NAMES = {"succeeded": "next motion stored", "leased": "next claim"}
NEXT = "SELECT min(at) FROM ledger_item WHERE after = :after AND at > :at"


def recoveries(engine: sa.Engine, fault: Fault) -> dict[str, float]:
    """Seconds until work went on, by what was waited for."""
    found = dict(fault.waits)
    with transaction(engine) as conn:
        if fault.held:
            asked = {"at": fault.at, "items": fault.held, "leases": fault.leases}
            given_back = conn.execute(sa.text(GIVEN_BACK), asked).scalar_one()
            if given_back is not None:
                found["all items given back"] = (given_back - fault.at).total_seconds()
                again = conn.execute(sa.text(STARTED_AGAIN), asked).scalar_one()
                if again is not None:
                    found["first item again"] = (again - fault.at).total_seconds()
        wanted = WANTED.get(fault.kind.split()[0], ()) if fault.back is not None else ()
        silent = fault.kind.endswith(OPEN_SILENT)
        for after in wanted:
            since = fault.back + timedelta(seconds=UNDER_WAY if silent else 0.0)
            first = conn.execute(sa.text(NEXT), {"at": since, "after": after}).scalar_one()
            if first is not None:
                found[NEXT_NAMES[after]] = (first - fault.back).total_seconds()
    return found


def meanwhile(engine: sa.Engine, fault: Fault, seconds: float) -> dict[str, object]:
    """Jobs that ran, and operations on them, while items of a killed worker waited to start again."""
    asked: dict[str, object] = {"since": fault.at, "until": fault.at + timedelta(seconds=seconds)}
    with transaction(engine) as conn:
        asked["jobs"] = conn.execute(sa.text(JOBS), {"items": fault.held}).scalar_one()
        ran = [list(map(str, row)) for row in conn.execute(sa.text(MEANWHILE), asked)]
        done = [
            f"{row.at:%H:%M:%S} {row.kind} {row.reason} {row.data}"[:120]
            for row in conn.execute(sa.text(STEERED), asked)
        ]
    return {"ran": ran, "events": done[-40:]}
