"""Ledger of all items and jobs of a chaos run, written by triggers of the run's own database, and its replay."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from uuid import UUID

import sqlalchemy as sa
from sqlalchemy.exc import IntegrityError

from marey.jobs import tables as job_tables
from marey.jobs.states import RETRYABLE, TRANSITIONS, Cause, ItemState
from marey.tenants import tables as tenant_tables

OPEN = {ItemState.READY, ItemState.LEASED}

INSTALL = """
    CREATE TABLE ledger_item (
        id bigserial PRIMARY KEY, at timestamptz NOT NULL, item uuid NOT NULL, job uuid NOT NULL,
        before text NOT NULL, after text NOT NULL, reason text, lease uuid
    );
    CREATE FUNCTION ledger_item() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN
        INSERT INTO ledger_item (at, item, job, before, after, reason, lease)
        VALUES (clock_timestamp(), NEW.id, NEW.job_id, OLD.state, NEW.state, NEW.reason,
                coalesce(NEW.lease_token, OLD.lease_token));
        RETURN NULL;
    END $$;
    CREATE TRIGGER ledger_item AFTER UPDATE OF state ON item
        FOR EACH ROW WHEN (OLD.state <> NEW.state) EXECUTE FUNCTION ledger_item();
    CREATE INDEX ON ledger_item (after, at);

    CREATE TABLE ledger_job (id bigserial PRIMARY KEY, tenant text NOT NULL, queued int NOT NULL, running int NOT NULL);
    CREATE FUNCTION ledger_job() RETURNS trigger LANGUAGE plpgsql AS $$
    BEGIN
        INSERT INTO ledger_job (tenant, queued, running)
        VALUES (NEW.tenant_id, NEW.ready + NEW.leased - OLD.ready - OLD.leased, NEW.leased - OLD.leased);
        RETURN NULL;
    END $$;
    CREATE TRIGGER ledger_job AFTER UPDATE ON job
        FOR EACH ROW WHEN ((OLD.ready, OLD.leased) <> (NEW.ready, NEW.leased)) EXECUTE FUNCTION ledger_job();
"""

# Who takes of a quota writes here after counting under the tenant's lock; who gives back, before that is seen. So no
# sum is above what was in use, and one above the quota is a quota that did not hold.
PEAKS = """
    SELECT tenant, max(queued) AS queued, max(running) AS running FROM
      (SELECT tenant, sum(queued) OVER sofar AS queued, sum(running) OVER sofar AS running FROM ledger_job
       WINDOW sofar AS (PARTITION BY tenant ORDER BY id)) AS sums
    GROUP BY tenant
"""

QUOTAS_NOW = """
    SELECT tenant.id, coalesce(open.queued, 0), coalesce(open.running, 0), coalesce(stored.bytes, 0) FROM tenant
    LEFT JOIN (SELECT tenant_id, sum(ready + leased) AS queued, sum(leased) AS running FROM job GROUP BY 1) AS open
      ON open.tenant_id = tenant.id
    LEFT JOIN (SELECT tenant_id, sum(size) AS bytes FROM asset WHERE state = 'stored' GROUP BY 1) AS stored
      ON stored.tenant_id = tenant.id
    WHERE open.queued > max_queued OR open.running > max_running OR stored.bytes > max_bytes
"""

FLOWS = {"progress": "succeeded", "item_dead": "dead", "item_failed": "failed", "cancelled": "cancelled"}
"""Kinds of events that bring items to an end, and to which."""


def install(engine: sa.Engine) -> None:
    """Let the database keep the ledger from now on."""
    with engine.begin() as conn:
        conn.exec_driver_sql(INSTALL)


def over_quota(conn: sa.Connection) -> Sequence[sa.Row]:
    """Tenants that have more than they may at this moment."""
    return conn.execute(sa.text(QUOTAS_NOW)).all()


def replayed(conn: sa.Connection) -> list[str]:
    """Inconsistencies of the history: items, quotas, events."""
    return [*_items_wrong(conn), *_harmless_wrong(conn), *_quotas_wrong(conn), *_events_wrong(conn)]


def refused(conn: sa.Connection) -> list[str]:
    """Illegal transitions that the database lets an item of the run make; everything is rolled back."""
    wrong: list[str] = []
    for before, after in product(ItemState, ItemState):
        if before is after or (before, after) in TRANSITIONS:
            continue
        found = conn.execute(sa.select(job_tables.item.c.id).where(job_tables.item.c.state == before).limit(1)).scalar()
        if found is None:
            continue
        ended = None if after in OPEN else sa.func.now()
        change = sa.update(job_tables.item).where(job_tables.item.c.id == found).values(state=after, finished_at=ended)
        with conn.begin_nested() as savepoint:
            try:
                conn.execute(change)
            except IntegrityError as error:
                if f"from {before} to {after}" not in str(error.orig):
                    wrong.append(f"{before} → {after} is refused for another reason: {error.orig}")
            else:
                wrong.append(f"{before} → {after} is allowed")
            savepoint.rollback()
    return wrong


def _items_wrong(conn: sa.Connection) -> Iterator[str]:
    """Each item's own story through the state machine, to the state it is in, with one end (and one more a retry)."""
    stories: dict[UUID, list[sa.Row]] = defaultdict(list)
    for row in conn.execute(sa.text("SELECT item, before, after, reason FROM ledger_item ORDER BY id")):
        stories[row.item].append(row)
    for item, state in conn.execute(sa.select(job_tables.item.c.id, job_tables.item.c.state)):
        story = stories.pop(item, [])
        states = [ItemState.READY, *(ItemState(row.after) for row in story)]
        if [row.before for row in story] != states[:-1] or states[-1] != state:
            yield f"item {item}: its story {states} does not lead to {state} without a gap"
        for row in story:
            causes = TRANSITIONS.get((ItemState(row.before), ItemState(row.after)))
            if causes is None or (row.after != ItemState.LEASED and _cause(row.reason) not in causes):
                yield f"item {item}: {row.before} → {row.after} because of {row.reason!r}"
        ends = sum(after not in OPEN for after in states)
        retries = sum(before in RETRYABLE for before in states[:-1])
        if ends != retries + 1:
            yield f"item {item} ended {ends} times and was retried {retries} times"
    for item in stories:
        yield f"item {item} is gone"


def _harmless_wrong(conn: sa.Connection) -> Iterator[str]:
    """Outages cost no motion: harmless items never fail, and die only by workers lost under them alone."""
    query = """
        SELECT id, state, problem FROM item WHERE prompt LIKE 'walk%'
        AND (state = 'failed' OR state = 'dead' AND problem ->> 'type' <> 'worker-lost')
    """
    for row in conn.execute(sa.text(query)):
        yield f"item {row.id} is harmless, and {row.state}: {row.problem}"


def _cause(reason: str | None) -> Cause | None:
    word = (reason or "").partition(":")[0]
    return Cause(word) if word in set(Cause) else None


def _quotas_wrong(conn: sa.Connection) -> Iterator[str]:
    quotas = {row.id: row for row in conn.execute(sa.select(tenant_tables.tenant))}
    for row in conn.execute(sa.text(PEAKS)):
        may = quotas[row.tenant]
        if may.max_queued is not None and row.queued > may.max_queued:
            yield f"tenant {row.tenant} had {row.queued} items queued of {may.max_queued}"
        if may.max_running is not None and row.running > may.max_running:
            yield f"tenant {row.tenant} had {row.running} items running of {may.max_running}"


def _events_wrong(conn: sa.Connection) -> Iterator[str]:
    events: dict[UUID, list[sa.Row]] = defaultdict(list)
    table = job_tables.job_event.c
    for row in conn.execute(sa.select(job_tables.job_event).order_by(table.job_id, table.seq)):
        events[row.job_id].append(row)
    for job in conn.execute(sa.select(job_tables.job)):
        told = events[job.id]
        if [event.seq for event in told] != list(range(1, job.event_seq + 1)):
            yield f"job {job.id}: its events have gaps"
        yield from (f"job {job.id}: {wrong}" for wrong in _counters_wrong(told, job.total))
        yield from (f"job {job.id}: {wrong}" for wrong in _states_wrong(told, job.state))


def _counters_wrong(events: Sequence[sa.Row], total: int) -> Iterator[str]:
    """Every end that the counters count was told by an event, and every event by the counters."""
    ends: Counter[str] = Counter()
    for event, following in zip(events, [*events[1:], None], strict=True):
        counters = event.data["counters"]
        if event.kind == "retried":
            gone = {state: ends[state] for state in map(str, RETRYABLE) if counters[state] == 0}
            if sum(gone.values()) != event.data["items"]:
                yield f"event {event.seq} retries {event.data['items']} items of {dict(ends)}"
            ends.subtract(gone)
        elif event.kind in FLOWS:
            ends[FLOWS[event.kind]] += 1 if event.item_id else event.data["items"]
        if following is not None and following.data["counters"] == counters:
            continue  # written together; the counters are those after all of them
        if any(ends[state] != counters[state] for state in FLOWS.values()) or counters["total"] != total:
            yield f"event {event.seq} ({event.kind}) counts {counters}, the events before it {dict(ends)}"


def _states_wrong(events: Sequence[sa.Row], state: str) -> Iterator[str]:
    """States follow each other by events `state` alone, and end where the job is."""
    changes = [event.data for event in events if event.kind == "state"]
    for one, other in pairwise(changes):
        if one["to"] != other["from"]:
            yield f"it was {one['to']}, then went from {other['from']}"
    if changes and changes[-1]["to"] != state:
        yield f"it is {state}; its events say {changes[-1]['to']}"
