"""A chaos run: studios submit, workers work, an operator meddles, and one thing after the other is broken; then nothing
is, until every accepted item has ended."""

from __future__ import annotations

import contextlib
import json
import random
import socket
import threading
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.core.errors import Unreachable
from marey.db import transaction
from marey.jobs import cancel
from marey.jobs.states import OPEN
from marey.jobs.tables import item, job, lease
from marey.runtime.faults import retry_unreachable
from marey.takes import collect_garbage
from marey.tenants import Quotas, create_key, create_tenant
from marey.tenants.types import DEFAULT_TENANT
from tests.chaos import ledger
from tests.chaos.driver import Cluster
from tests.chaos.faults import LIMIT, PATIENCE, SINCE_FAULT, Breaker, meanwhile, recoveries
from tests.chaos.model import ITEM_SECONDS, QUEUE, REFERENCE
from tests.chaos.places import Place
from tests.chaos.silence import EventProbe, bar_of, missed
from tests.chaos.studios import Operator, Quota, Studio
from tests.chaos.webhooks import Flaky, webhooks_wrong
from tests.servers.audit import audit as tables_audit
from tests.servers.receiver import LOOPBACK
from tests.support.live_api import write_bundle
from tests.support.toy_jobs import audit as store_audit
from tests.support.toy_jobs import submit_toys
from tests.support.webhooks import KEY, new_webhook

LOOK = 0.25


@dataclass(frozen=True)
class Plan:
    """Plan of a run.

    Attributes:
        tenants: share of the items and quotas of each.
        toxic: prompts that bring down their worker or hang, dealt out to the tenants in turn.
        kinds: of faults, each once a round in random order; None = all.
        calm: seconds after a fault until the next: half of the time a tenth of it, so that faults overlap too.
        faults: how many at least and at most, while there is work.
    """

    items: int
    seed: int
    tenants: Mapping[str, tuple[float, Quota]]
    toxic: Sequence[str]
    workers: int
    item_seconds: float
    job_sizes: tuple[int, int]
    calm: float
    longest: float
    faults: tuple[int, int]
    times: Mapping[str, str] = field(default_factory=dict)
    kinds: Sequence[str] | None = None
    operator_pause: float = 2.0


class TenantMonitor(threading.Thread):
    """Looks four times a second whether any tenant has more than it may, and starts again what ended by itself, as a
    supervisor does.

    Attributes:
        ended: processes that ended without being told to, by name and exit status.
    """

    def __init__(self, cluster: Cluster, start: Mapping[str, Any], hands: threading.RLock) -> None:
        super().__init__(name="watch", daemon=True)
        self._cluster, self._start, self._hands = cluster, start, hands
        self._done = threading.Event()
        self.looks = 0
        self.over: list[str] = []
        self.ended: Counter[tuple[str, int]] = Counter()

    def run(self) -> None:
        while not self._done.wait(LOOK):
            try:
                with transaction(self._cluster.engine) as conn:
                    self.over += [f"over quota: {tuple(row)}" for row in ledger.over_quota(conn)]
                self.looks += 1
            except Unreachable:
                pass
            if self._hands.acquire(blocking=False):
                try:
                    self.start_again()
                finally:
                    self._hands.release()

    def start_again(self) -> None:
        """Start what has ended; for who has the hands on the processes."""
        for name, process in list(self._cluster.processes.items()):
            status = process.poll()
            if status is not None:
                self.ended[name, status] += 1
                del self._cluster.processes[name]
                self._start[name]()

    def close(self) -> None:
        self._done.set()
        self.join(30)


class Run:
    """See the module. `go` does it all; `wrong` then says what the audit found, `report` the figures."""

    def __init__(self, cluster: Cluster, place: Place, plan: Plan, receiver: Flaky, ports: tuple[int, int]) -> None:
        self.cluster, self.place, self.plan, self.receiver = cluster, place, plan, receiver
        self._draw = random.Random(plan.seed)
        self._done = threading.Event()
        self._hands = threading.RLock()
        self.url = f"http://127.0.0.1:{ports[0]}"
        ledger.install(cluster.engine)
        write_bundle(cluster.home / "models")
        self.studios = self._studios()
        self.webhook = new_webhook(cluster.engine, receiver.url(), tenant=self.studios[0].tenant)
        self.operator = Operator(self.studios, plan.seed, self._done, plan.operator_pause)
        self._start = {
            "api": cluster.start_api,
            "scheduler": partial(cluster.start_scheduler, MAREY_METRICS_PORT=str(ports[1])),
            **{
                f"worker-{n}": partial(cluster.start_worker, f"worker-{n}", queue=QUEUE, reference=REFERENCE)
                for n in range(plan.workers)
            },
        }
        self.watch = TenantMonitor(cluster, self._start, self._hands)
        # No worker serves its queue: it stays open, for events that a fault must not hold up.
        self._probed = submit_toys(cluster.engine, ["probe"])
        with transaction(cluster.engine) as conn:
            key = create_key(conn, "probe", ["read", "operate"]).secret
        self.probe = EventProbe(self.url, key, self._probed)
        self.breaker = Breaker(
            cluster,
            place,
            draw=self._draw,
            url=self.url,
            key=self.studios[0].key,
            metrics_url=f"http://127.0.0.1:{ports[1]}/metrics",
            workers=plan.workers,
            start=self._start,
            longest=plan.longest,
            start_again=self.watch.start_again,
            probe=self.probe,
        )
        self.seconds = 0.0

    def _studios(self) -> list[Studio]:
        tenants, toxic = self.plan.tenants, self.plan.toxic
        return [
            self._studio(name, share, quota, toxic[number :: len(tenants)])
            for number, (name, (share, quota)) in enumerate(tenants.items())
        ]

    def _studio(self, name: str, share: float, quota: Quota, toxic: Sequence[str]) -> Studio:
        plan = self.plan
        with transaction(self.cluster.engine) as conn:
            create_tenant(conn, name, Quotas(**quota.values()))
            key = create_key(conn, name, ["submit", "read", "operate"], tenant=name).secret
        return Studio(
            url=self.url,
            key=key,
            tenant=name,
            items=round(plan.items * share),
            toxic=toxic,
            seed=plan.seed,
            job_sizes=plan.job_sizes,
            stop=self._done,
        )

    # --- the run ---

    def go(self, seconds: float) -> None:
        """Until every accepted item has ended, in `seconds` at most."""
        began = time.monotonic()
        deadline = began + seconds
        for start in self._start.values():
            start()
        for name in self._start:
            if name.startswith("worker"):
                self.cluster.wait_ready(name)
        for thread in (*self.studios, self.watch, self.operator, self.probe):
            thread.start()
        try:
            self._break(deadline)
            self._end_probe()
            self._wait(deadline, "every job is accepted", lambda: not any(s.is_alive() for s in self.studios))
            self._done.set()
            self.operator.join(60)
            self.operator.release()
            self._wait(deadline, "every item ends", lambda: self._open() == 0)
            self._wait(deadline, "no lease is held", self._no_lease)
            self._wait(deadline, "webhooks are told", self._is_hinted)
        finally:
            self._done.set()
            self.probe.close()
            self.watch.close()
        self.seconds = time.monotonic() - began

    def _break(self, deadline: float) -> None:
        least, most = self.plan.faults
        names = list(self.plan.kinds or self.breaker.kinds)
        waiting: list[str] = []
        while len(self.breaker.faults) < most and time.monotonic() < deadline:
            if len(self.breaker.faults) >= least and self._nearly_done():
                return
            self._check_clients()
            if not waiting:
                waiting = self._draw.sample(names, len(names))
            with self._hands:
                self.breaker.break_one(waiting.pop())
            time.sleep(self.plan.calm * self._draw.choice((0.1, 1.0)) * self._draw.uniform(0.5, 1.5))

    def _end_probe(self) -> None:
        self.probe.close()

        def end() -> None:
            with transaction(self.cluster.engine) as conn:
                cancel(conn, DEFAULT_TENANT, self._probed)

        retry_unreachable(end, seconds=LIMIT)

    def _nearly_done(self) -> bool:
        if any(studio.is_alive() for studio in self.studios):
            return False
        return retry_unreachable(self._open, seconds=LIMIT) < self.plan.items // 20

    def _check_clients(self) -> None:
        for client in (*self.studios, self.operator):
            if client.error is not None:
                raise AssertionError(f"{client.name}: {client.error}") from client.error

    def _wait(self, deadline: float, what: str, condition: Any) -> None:
        while True:
            self._check_clients()
            try:
                if condition():
                    return
            except Unreachable:
                pass
            if time.monotonic() > deadline:
                raise AssertionError(f"not in time: {what}; {self._standing()}\n{self.cluster.logs()}")
            time.sleep(LOOK)

    def _standing(self) -> dict[str, Any]:
        with transaction(self.cluster.engine) as conn:
            return {
                "jobs": dict(conn.execute(sa.select(job.c.state, sa.func.count()).group_by(job.c.state)).all()),
                "items": dict(conn.execute(sa.select(item.c.state, sa.func.count()).group_by(item.c.state)).all()),
                "open": [
                    tuple(row)
                    for row in conn.execute(
                        sa.select(item.c.prompt, item.c.state, item.c.solo, item.c.attempts, item.c.run_after)
                        .where(item.c.state.in_(sorted(OPEN)))
                        .limit(10)
                    )
                ],
                "leases": conn.execute(sa.select(sa.func.count()).select_from(lease)).scalar_one(),
            }

    def _open(self) -> int:
        with transaction(self.cluster.engine) as conn:
            counted = sa.select(sa.func.coalesce(sa.func.sum(job.c.ready + job.c.leased), 0))
            return conn.execute(counted).scalar_one()

    def _no_lease(self) -> bool:
        with transaction(self.cluster.engine) as conn:
            return conn.execute(sa.select(sa.func.count()).select_from(lease)).scalar_one() == 0

    def _is_hinted(self) -> bool:
        query = "SELECT count(*) FROM webhook_delivery WHERE state = 'pending'"
        with transaction(self.cluster.engine) as conn:
            return conn.execute(sa.text(query)).scalar_one() == 0

    # --- afterwards ---

    def wrong(self) -> list[str]:
        """Findings of the audit; empty if all is well. Collects garbage once."""
        collect_garbage(self.cluster.engine, self.place.store)
        found = [*self._accepted_wrong(), *self.watch.over[:5]]
        with transaction(self.cluster.engine) as conn:
            found += ledger.replayed(conn)
            found += ledger.refused(conn)
            found += tables_audit(conn)
            found += webhooks_wrong(conn, self.webhook, self.receiver)
        found += store_audit(self.cluster.engine, self.place.store)
        if not self.watch.looks:
            found.append("nobody looked at the quotas")
        return found

    def _accepted_wrong(self) -> list[str]:
        """Check that everything answered with 202 exists once, whole; and nothing else."""
        accepted = {UUID(job): count for studio in self.studios for job, count in studio.accepted.items()}
        accepted[self._probed] = 1
        with transaction(self.cluster.engine) as conn:
            rows = conn.execute(sa.select(item.c.job_id, sa.func.count()).group_by(item.c.job_id)).all()
        found = {row[0]: row[1] for row in rows}
        return [
            f"job {one}: {accepted.get(one, 0)} items were accepted, {found.get(one, 0)} are there"
            for one in accepted | found
            if accepted.get(one) != found.get(one)
        ]

    def report(self) -> dict[str, Any]:
        """Print the events and the recovery times."""
        with transaction(self.cluster.engine) as conn:
            states = dict(conn.execute(sa.select(item.c.state, sa.func.count()).group_by(item.c.state)).all())
            moves = conn.execute(sa.text("SELECT count(*) FROM ledger_item")).scalar_one()
            lost = conn.execute(
                sa.text("SELECT count(*) FROM ledger_item WHERE after = 'ready' AND reason LIKE 'lease_lost%'")
            ).scalar_one()
        samples = self._samples()
        return {
            "seed": self.plan.seed,
            "seconds": round(self.seconds),
            "jobs": sum(len(studio.accepted) for studio in self.studios),
            "items": sum(sum(studio.accepted.values()) for studio in self.studios),
            "states": states,
            "transitions": moves,
            "items_of_lost_leases": lost,
            "faults": dict(Counter(fault.kind for fault in self.breaker.faults)),
            "ended_by_themselves": {f"{name} ({status})": n for (name, status), n in self.watch.ended.items()},
            "refused": {s.tenant: dict(s.refused) for s in self.studios},
            "asked_again": sum(studio.asked_again for studio in self.studios),
            "odd_answers": [*self.operator.odd, *(odd for studio in self.studios for odd in studio.odd)],
            "verbs": {f"{verb} {status}": n for (verb, status), n in sorted(self.operator.answers.items())},
            "quota_looks": self.watch.looks,
            "webhook_messages": len(self.receiver.received),
            "webhook_events": len({request.id for request in self.receiver.received}),
            "samples": samples,
            "bars_missed": missed(samples),
        }

    def _samples(self) -> list[dict[str, Any]]:
        """Return the recovery times after each fault; `alone`: before the next fault began."""
        faults = self.breaker.faults
        following = [*(fault.at for fault in faults[1:]), None]
        samples: list[dict[str, Any]] = []
        for fault, other in zip(faults, following, strict=True):
            for what, seconds in recoveries(self.cluster.engine, fault).items():
                start = fault.at if what in SINCE_FAULT else fault.back or fault.at
                alone = other is None or (other - start).total_seconds() >= seconds
                sample: dict[str, Any] = {
                    "fault": fault.kind,
                    "until": what,
                    "seconds": round(seconds, 2),
                    "alone": alone,
                    "bar": bar_of(fault.kind, what),
                }
                if what in SINCE_FAULT and seconds > PATIENCE:
                    sample["meanwhile"] = meanwhile(self.cluster.engine, fault, seconds)
                samples.append(sample)
        return samples


def environment(place: Place, home: Path, port: int, plan: Plan) -> dict[str, str]:
    """Settings of every process of a run."""
    return {
        **place.environment,
        **plan.times,
        "MAREY_WEBHOOK_KEY": KEY,
        "MAREY_WEBHOOK_ALLOW": json.dumps(LOOPBACK),
        "MAREY_MODELS": str(home / "models"),
        "MAREY_PORT": str(port),
        ITEM_SECONDS: str(plan.item_seconds),
    }


def free_ports(count: int) -> list[int]:
    """Unused ports outside the range of connections: they must be free after each kill."""
    found: list[int] = []
    while len(found) < count:
        port = random.randrange(20_000, 32_000)
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            found += [port] if port not in found else []
    return found
