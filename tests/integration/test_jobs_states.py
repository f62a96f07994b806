"""The database's copy of the state machine is the one in the code."""

from __future__ import annotations

from itertools import product
from uuid import uuid4

import pytest
import sqlalchemy as sa
from sqlalchemy.exc import IntegrityError

from marey.db import transaction
from marey.db.ids import new_id
from marey.jobs import JobControl, tables
from marey.jobs.journal import LockedJob
from marey.jobs.states import ItemState, allowed, job_state
from tests.servers.jobs import claim_some, parse_texts, submit_items

# A way to each state, by allowed steps.
WAYS: dict[ItemState, list[ItemState]] = {
    ItemState.READY: [],
    ItemState.LEASED: [ItemState.LEASED],
    ItemState.SUCCEEDED: [ItemState.LEASED, ItemState.SUCCEEDED],
    ItemState.FAILED: [ItemState.LEASED, ItemState.FAILED],
    ItemState.DEAD: [ItemState.LEASED, ItemState.DEAD],
    ItemState.CANCELLED: [ItemState.CANCELLED],
}


def put(conn: sa.Connection, item: object, state: ItemState, lease: object) -> None:
    """Set a state and what must go with it, so that the transition alone decides."""
    conn.execute(
        sa.update(tables.item)
        .where(tables.item.c.id == item)
        .values(
            state=state,
            lease_token=lease if state is ItemState.LEASED else None,
            finished_at=None if state in (ItemState.READY, ItemState.LEASED) else sa.func.now(),
        )
    )


def test_the_database_allows_the_transitions_of_the_table_and_no_other(engine: sa.Engine) -> None:
    submit_items(engine, 2)
    parse_texts(engine)
    claimed = claim_some(engine, limit=1)
    with transaction(engine) as conn:
        item = conn.execute(sa.select(tables.item.c.id).where(tables.item.c.state == "ready")).scalar_one()
    for before, after in product(ItemState, ItemState):
        if before is after:
            continue
        with engine.connect() as conn:
            for step in WAYS[before]:
                put(conn, item, step, claimed.lease_token)
            if allowed(before, after):
                put(conn, item, after, claimed.lease_token)
            else:
                with pytest.raises(IntegrityError, match=f"from {before} to {after}"):
                    put(conn, item, after, claimed.lease_token)
            conn.rollback()


def test_an_item_cannot_begin_in_another_state_than_ready(engine: sa.Engine) -> None:
    submit_items(engine, 1)
    with engine.connect() as conn:
        first = dict(conn.execute(sa.select(tables.item)).mappings().one())
        for position, state in enumerate(ItemState, 1):
            second = sa.insert(tables.item).values(first | {"id": new_id(), "position": position, "state": state})
            with conn.begin_nested() as savepoint:
                if state is ItemState.READY:
                    conn.execute(second)
                else:
                    with pytest.raises(IntegrityError, match=f"begins ready, not {state}"):
                        conn.execute(second)
                    savepoint.rollback()


@pytest.mark.parametrize(
    ("change", "constraint"),
    [
        ("lease_token = NULL", "ck_item_lease"),
        ("state = 'ready'", "ck_item_lease"),
        ("state = 'ready', lease_token = NULL, finished_at = now()", "ck_item_finished"),
        ("state = 'failed', lease_token = NULL", "ck_item_finished"),
        ("run_after = now()", "ck_item_run_after"),
        ("stage = 'paint'", "ck_item_stage"),
        ("state = 'succeeded', stage = 'text', lease_token = NULL, finished_at = now()", "ck_item_succeeded"),
    ],
)
def test_a_row_that_contradicts_itself_is_refused(engine: sa.Engine, change: str, constraint: str) -> None:
    submit_items(engine, 1)
    parse_texts(engine)
    claim_some(engine)
    with pytest.raises(IntegrityError, match=constraint), engine.begin() as conn:
        conn.execute(sa.text(f"UPDATE item SET {change}"))


def test_the_database_derives_the_state_of_a_job_as_the_code_does(engine: sa.Engine) -> None:
    with engine.begin() as conn:
        for counts, control, started in product(product((0, 2), repeat=6), JobControl, (False, True)):
            values = {str(state): count for state, count in zip(ItemState, counts, strict=True)}
            found = conn.execute(
                sa.insert(tables.job)
                .values(id=new_id(), tenant_id="default", total=sum(counts), control=control, **values)
                .values(started_at=sa.func.now() if started else None)
                .returning(tables.job.c.state)
            ).scalar_one()
            counters = LockedJob(uuid4(), "default", control, None, started, sum(counts), **values)
            assert found == job_state(control, counters, started=started), (values, control, started)


def test_counters_that_do_not_add_up_are_refused(engine: sa.Engine) -> None:
    job = submit_items(engine, 2)
    for change in ("ready = 1", "ready = 3, leased = -1", "total = 1"):
        with pytest.raises(IntegrityError, match="ck_job_counters"), engine.begin() as conn:
            conn.execute(sa.text(f"UPDATE job SET {change} WHERE id = :job"), {"job": job})
