"""Listings follow the database's clock: the ids of a machine whose clock is a day behind change no order."""

from __future__ import annotations

import base64
import importlib
from collections.abc import Callable
from itertools import count
from typing import Any
from uuid import UUID

import pytest
import sqlalchemy as sa

from marey.core.errors import InvalidInput
from marey.db import create_engine, transaction
from marey.db import ids as ids_module
from marey.evaluations import list_evaluations, list_schedules
from marey.jobs import list_jobs
from marey.streams import NewStream, create_stream, list_streams
from marey.takes import list_motions
from marey.tenants import DEFAULT_TENANT, Actor, audit, create_key, list_audit, list_keys
from marey.webhooks import EventKind, list_deliveries, list_webhooks, send_test
from tests.servers.jobs import claim_some, commit_all, parse_texts, submit_items
from tests.support.evaluations import new_evaluation
from tests.support.schedules import new_schedule
from tests.support.webhooks import new_webhook

Listing = Callable[..., Any]
NEWEST = 0x01A0_0000_0000
numbers = count()


def older_id() -> UUID:
    """An id that looks older than the one before it, as of machines whose clocks differ by a day."""
    number = next(numbers)
    return UUID(int=(NEWEST - number * 86_400_000) << 80 | 0x7 << 76 | 0x2 << 62 | number)


@pytest.fixture
def clock_goes_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every module makes such ids."""
    of_jobs = ("jobs.submit", "jobs.results", "streams.repository", "evaluations.schedules")
    of_tenants = ("tenants.audit", "tenants.keys")
    for name in (*of_jobs, *of_tenants, "webhooks.repository", "webhooks.deliveries", "webhooks.outbox"):
        module = importlib.import_module(f"marey.{name}")
        assert module.new_id is ids_module.new_id
        monkeypatch.setattr(module, "new_id", older_id)


def listings(engine: sa.Engine) -> dict[str, tuple[Listing, Callable[[int], UUID]]]:
    """Each listing, and how one more of it is made."""
    webhook = new_webhook(engine, "https://studio.example/hook", *EventKind)

    def stream(n: int) -> UUID:
        with transaction(engine) as conn:
            key = create_key(conn, f"live {n}", ["submit"]).key.id
            return create_stream(conn, NewStream(DEFAULT_TENANT, key, "walk", "stroller", "m@0", 1, 9), limit=9)

    def delivery(_: int) -> UUID:
        with transaction(engine) as conn:
            return send_test(conn, DEFAULT_TENANT, webhook).event

    def noted(n: int) -> UUID:
        with transaction(engine) as conn:
            audit(conn, DEFAULT_TENANT, Actor("ann", None), f"test.{n}", n)
            rows = conn.execute(sa.text("SELECT id FROM audit_event WHERE verb = :verb"), {"verb": f"test.{n}"})
            return rows.scalar_one()

    def motion(_: int) -> UUID:
        submit_items(engine, 1)
        parse_texts(engine)
        (item,) = commit_all(engine, claim_some(engine, limit=1))
        with transaction(engine) as conn:
            return conn.execute(sa.text("SELECT id FROM motion WHERE item_id = :item"), {"item": item}).scalar_one()

    def evaluation(_: int) -> UUID:
        return new_evaluation(engine, id=older_id())

    return {
        "jobs": (list_jobs, lambda _: submit_items(engine, 1)),
        "streams": (list_streams, stream),
        "webhooks": (list_webhooks, lambda n: new_webhook(engine, f"https://studio.example/{n}", *EventKind)),
        "schedules": (list_schedules, lambda _: new_schedule(engine)),
        "evaluations": (list_evaluations, evaluation),
        "deliveries": (lambda c, t, **k: list_deliveries(c, t, webhook, **k), delivery),
        "audit": (lambda c, t, **k: list_audit(c, tenant=t, verb="test", **k), noted),
        "audit of all": (lambda c, _, **k: list_audit(c, verb="test", **k), noted),
        "motions": (list_motions, motion),
    }


def identifier(row: Any) -> UUID:
    return getattr(row, "event", None) or row.id


@pytest.mark.usefixtures("clock_goes_back")
@pytest.mark.parametrize(
    "name",
    ["jobs", "streams", "webhooks", "schedules", "evaluations", "deliveries", "audit", "audit of all", "motions"],
)
def test_the_newest_comes_first_however_old_its_id_looks(engine: sa.Engine, name: str) -> None:
    listing, make = listings(engine)[name]
    made = [make(n) for n in range(4)]
    if name != "deliveries":
        assert made == sorted(made, reverse=True), "the clock did go back"
    with transaction(engine) as conn:
        whole = [identifier(row) for row in listing(conn, DEFAULT_TENANT, limit=100).rows]
        assert [each for each in whole if each in made] == made[::-1]
        walked: list[UUID] = []
        cursor = None
        while True:
            page = listing(conn, DEFAULT_TENANT, limit=1, cursor=cursor)
            walked += map(identifier, page.rows)
            cursor = page.cursor
            if cursor is None:
                break
        assert walked == whole
        old = base64.urlsafe_b64encode(str(made[2]).encode()).decode().rstrip("=")  # as an earlier release wrote it
        rest = [identifier(row) for row in listing(conn, DEFAULT_TENANT, limit=100, cursor=old).rows]
        assert rest == whole[whole.index(made[2]) + 1 :]


@pytest.mark.usefixtures("clock_goes_back")
def test_keys_are_listed_newest_first(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        first = create_key(conn, "first", ["read"]).key.id
    with transaction(engine) as conn:
        second = create_key(conn, "second", ["read"]).key.id
        assert [key.id for key in list_keys(conn, DEFAULT_TENANT)] == [second, first]


def test_an_old_cursor_whose_row_is_gone_goes_on_at_the_time_in_its_id(engine: sa.Engine) -> None:
    made = [submit_items(engine, 1) for _ in range(3)]
    with transaction(engine) as conn:
        conn.execute(sa.text("DELETE FROM job WHERE id = :id"), {"id": made[1]})
        conn.execute(
            sa.text("UPDATE job SET created_at = created_at - interval '1 hour' WHERE id = :id"), {"id": made[0]}
        )
        conn.execute(
            sa.text("UPDATE job SET created_at = created_at + interval '1 hour' WHERE id = :id"), {"id": made[2]}
        )
        old = base64.urlsafe_b64encode(str(made[1]).encode()).decode()
        assert [job.id for job in list_jobs(conn, DEFAULT_TENANT, cursor=old).rows] == [made[0]]


@pytest.mark.parametrize(
    "text",
    ["", "x", "0|2026-01-01", "{01900000-0000-7000-8000-000000000000}|2026-01-01T00:00:00", "x|99999-01-01"],
)
def test_what_is_no_cursor_is_refused(engine: sa.Engine, text: str) -> None:
    for cursor in (
        base64.urlsafe_b64encode(text.encode()).decode(),
        "".join(base64.urlsafe_b64encode(part.encode()).decode() for part in text.split("|")),
    ):
        with transaction(engine) as conn, pytest.raises(InvalidInput, match="not a cursor"):
            list_jobs(conn, DEFAULT_TENANT, cursor=cursor)


def test_an_earlier_release_reads_the_id_of_our_cursors(engine: sa.Engine) -> None:
    """While releases are exchanged, the next page may be asked of a process of the earlier one."""
    made = [submit_items(engine, 1) for _ in range(3)]
    with transaction(engine) as conn:
        cursor = list_jobs(conn, DEFAULT_TENANT, limit=1).cursor
    assert cursor is not None
    earlier = base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)).decode()  # as it reads them
    assert UUID(earlier) == made[2]


DEEP = {
    "ix_job_created": "FROM job",
    "ix_stream_created": "FROM stream",
    "ix_schedule_created": "FROM schedule",
    "ix_webhook_created": "FROM webhook",
    "ix_evaluation_created": "FROM evaluation",
    "ix_webhook_delivery_created": "FROM webhook_delivery",
    "ix_audit_event_created": "FROM audit_event",
}


def test_a_deep_page_is_read_from_its_index_in_order(engine: sa.Engine, database_url: str) -> None:
    """Asked of the planner with sorting forbidden: an order that no index has is sorted all the same."""
    made = listings(engine)
    marks = {}
    for name, (listing, make) in made.items():
        if name not in ("audit of all", "motions"):
            make(0), make(1)
            with transaction(engine) as conn:
                marks[name] = listing(conn, DEFAULT_TENANT, limit=1).cursor
    plans: list[str] = []

    def explain(conn: sa.Connection, _cursor: object, statement: str, parameters: object, *_: object) -> None:
        if (
            "LIMIT" in statement and "ORDER BY" in statement and "created_at" in statement
        ) or "audit_event.at" in statement:
            raw = conn.connection.cursor()
            raw.execute("EXPLAIN " + statement, parameters)
            plans.append("\n".join(row[0] for row in raw.fetchall()))

    own = create_engine(database_url)
    sa.event.listen(own, "before_cursor_execute", explain)
    with own.connect() as conn:
        for setting in ("sort", "seqscan", "bitmapscan", "hashjoin", "mergejoin", "incremental_sort"):
            conn.execute(sa.text(f"SET LOCAL enable_{setting} = off"))
        for name, cursor in marks.items():
            made[name][0](conn, DEFAULT_TENANT, limit=1, cursor=cursor)
        conn.rollback()
    own.dispose()
    for index in DEEP:
        assert any(f"Backward using {index} on" in plan for plan in plans), f"{index}\n" + "\n\n".join(plans)


@pytest.mark.parametrize("name", ["jobs", "audit"])
def test_a_page_holds_fifty_unless_another_size_is_asked_for(engine: sa.Engine, name: str) -> None:
    listing, make = listings(engine)[name]
    for n in range(51):
        make(n)
    with transaction(engine) as conn:
        page = listing(conn, DEFAULT_TENANT)
        assert (len(page.rows), page.cursor is None) == (50, False)
        assert listing(conn, DEFAULT_TENANT, cursor=page.cursor).rows
