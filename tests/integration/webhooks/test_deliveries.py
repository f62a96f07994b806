"""Deliveries in the database: claimed by one, written by the holder of the claim, tried eight times, replayed."""

from __future__ import annotations

from uuid import UUID, uuid4

import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput, NotFound
from marey.db import transaction
from marey.jobs import sweep
from marey.tenants import DEFAULT_TENANT, list_audit
from marey.webhooks import (
    Attempt,
    DeliveryState,
    DueDelivery,
    WebhookChange,
    change_webhook,
    claim_deliveries,
    delete_webhook,
    get_delivery,
    get_webhook,
    give_back_deliveries,
    list_deliveries,
    list_webhooks,
    record_attempt,
    replay_delivery,
    rotate_secret,
    send_test,
)
from marey.webhooks.deliveries import DELAYS, JITTER, MAX_WAIT
from tests.support.webhooks import deliveries, errors, events_written, happen, messages_of, new_webhook, time_passes

REFUSED = Attempt(500, 0.1, "answered 500")
ARRIVED = Attempt(204, 0.1, None)


def claim(
    engine: sa.Engine, limit: int = 100, *, each: int = 100, busy: dict[UUID, int] | None = None
) -> list[DueDelivery]:
    with transaction(engine) as conn:
        return claim_deliveries(conn, limit, each=each, busy=busy)


def record(engine: sa.Engine, due: DueDelivery, attempt: Attempt) -> DeliveryState | None:
    with transaction(engine) as conn:
        return record_attempt(conn, due, attempt)


def next_in(engine: sa.Engine, due: DueDelivery) -> float | None:
    """Seconds until the next try, as the database says."""
    query = "SELECT extract(epoch FROM next_at - clock_timestamp()) FROM webhook_delivery WHERE event_id = :event"
    with transaction(engine) as conn:
        found = conn.execute(sa.text(query), {"event": due.event}).scalar_one()
    return None if found is None else float(found)


def test_what_one_has_claimed_no_other_gets_until_the_claim_runs_out(engine: sa.Engine) -> None:
    webhook = new_webhook(engine, "https://a.example/")
    happen(engine)
    (first,) = claim(engine)
    assert (first.webhook, first.url, first.kind, first.tries) == (
        webhook,
        "https://a.example/",
        "job.ended",
        0,
    )
    assert claim(engine) == []
    time_passes(engine)
    (second,) = claim(engine)
    assert (second.event, second.data, second.at, second.tries) == (first.event, first.data, first.at, 0)
    assert record(engine, first, REFUSED) is None  # its claim was lost: nothing is written
    assert record(engine, second, ARRIVED) is DeliveryState.DELIVERED
    assert record(engine, second, ARRIVED) is None
    assert errors(engine, webhook, first.event) == [None]


def test_transactions_that_claim_at_the_same_time_get_different_deliveries(engine: sa.Engine) -> None:
    new_webhook(engine)
    happen(engine, 4)
    with transaction(engine) as one, transaction(engine) as other:
        mine = claim_deliveries(one, 2, each=2)
        theirs = claim_deliveries(other, 10, each=10)
    assert (len(mine), len(theirs)) == (2, 2)
    assert not {each.event for each in mine} & {each.event for each in theirs}


def test_eight_tries_are_made_later_and_later_and_then_it_has_failed(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    happen(engine)
    for number, delay in enumerate(DELAYS, 1):
        (due,) = claim(engine)
        assert due.tries == number - 1
        assert record(engine, due, REFUSED) is DeliveryState.PENDING
        waits = next_in(engine, due)
        assert waits is not None
        assert waits <= (1 + JITTER) * delay
        assert waits > (1 - JITTER) * delay - 4  # the first delay is 4.5 seconds at least: it is not due at once
        assert claim(engine) == []
        time_passes(engine)
    (due,) = claim(engine)
    assert record(engine, due, Attempt(None, 15.0, "x" * 1000)) is DeliveryState.FAILED
    assert next_in(engine, due) is None
    time_passes(engine)
    assert claim(engine) == []
    (row,) = deliveries(engine, webhook)
    assert (row.state, row.attempts, row.status, row.error) == (DeliveryState.FAILED, 8, None, "x" * 300)
    assert errors(engine, webhook, row.event) == ["answered 500"] * 7 + ["x" * 300]


@pytest.mark.parametrize(("asked", "kept"), [(1.0, DELAYS[0]), (300.0, 300.0), (1e9, MAX_WAIT)])
def test_a_receiver_may_put_off_the_next_try_but_not_for_ever_and_not_bring_it_forward(
    engine: sa.Engine, asked: float, kept: float
) -> None:
    new_webhook(engine)
    happen(engine)
    (due,) = claim(engine)
    assert record(engine, due, Attempt(429, 0.1, "answered 429", asked)) is DeliveryState.PENDING
    waits = next_in(engine, due)
    assert waits is not None
    assert waits <= (1 + JITTER) * kept
    assert asked < kept or waits > DELAYS[0] * (1 + JITTER)


def test_a_receiver_that_is_gone_is_told_nothing_more_and_the_audit_log_says_why(engine: sa.Engine) -> None:
    webhook, other = new_webhook(engine), new_webhook(engine)
    happen(engine, 2)
    first, second = (each for each in claim(engine) if each.webhook == webhook)
    assert record(engine, first, Attempt(410, 0.1, "answered 410")) is DeliveryState.FAILED
    assert record(engine, second, Attempt(410, 0.1, "answered 410")) is DeliveryState.FAILED
    with transaction(engine) as conn:
        assert get_webhook(conn, DEFAULT_TENANT, webhook).paused
        assert not get_webhook(conn, DEFAULT_TENANT, other).paused
        (noted,) = list_audit(conn, verb="webhook.gone").rows
    assert (noted.target, noted.tenant, noted.data["event"]) == (str(webhook), DEFAULT_TENANT, str(first.event))
    happen(engine)
    assert webhook not in {each.webhook for each in claim(engine)}
    with transaction(engine) as conn:
        change_webhook(conn, DEFAULT_TENANT, webhook, WebhookChange(paused=False))
    assert webhook in {each.webhook for each in claim(engine)}


def test_a_rotated_secret_signs_until_its_overlap_is_over(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)

    def secrets() -> list[bytes]:
        time_passes(engine)
        (due,) = claim(engine)
        return [bytes(secret) for secret in due.secrets]

    happen(engine)
    (first,) = secrets()
    with transaction(engine) as conn:
        rotate_secret(conn, DEFAULT_TENANT, webhook, b"second")
    assert secrets() == [b"second", first]
    with transaction(engine) as conn:
        rotate_secret(conn, DEFAULT_TENANT, webhook, b"third", overlap=60)
    assert secrets() == [b"third", b"second"]
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE webhook SET previous_until = now()"))
    assert secrets() == [b"third"]
    with transaction(engine) as conn:
        rotate_secret(conn, DEFAULT_TENANT, webhook, b"fourth", overlap=0)
    assert secrets() == [b"fourth"]
    with transaction(engine) as conn, pytest.raises(InvalidInput, match="valid duration"):
        rotate_secret(conn, DEFAULT_TENANT, webhook, b"x", overlap=-1)
    with transaction(engine) as conn, pytest.raises(NotFound):
        rotate_secret(conn, "studio", webhook, b"x")


def test_a_replay_has_all_tries_again_and_the_same_id_and_the_log_goes_on(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    happen(engine)
    (due,) = claim(engine)
    record(engine, due, ARRIVED)
    for state in (DeliveryState.DELIVERED, DeliveryState.PENDING):  # what has ended, and what waits for its next try
        with transaction(engine) as conn:
            assert get_delivery(conn, DEFAULT_TENANT, webhook, due.event).state is state
            assert replay_delivery(conn, DEFAULT_TENANT, webhook, due.event).state is DeliveryState.PENDING
        (again,) = claim(engine)
        assert (again.event, again.tries) == (due.event, 0)
        record(engine, again, REFUSED)
    assert errors(engine, webhook, due.event) == [None, "answered 500", "answered 500"]
    with transaction(engine) as conn, pytest.raises(NotFound, match="no such delivery"):
        replay_delivery(conn, DEFAULT_TENANT, webhook, uuid4())


def test_while_a_webhook_is_paused_its_deliveries_wait(engine: sa.Engine) -> None:
    webhook = new_webhook(engine, "https://old.example/")
    with transaction(engine) as conn:
        change_webhook(conn, DEFAULT_TENANT, webhook, WebhookChange(paused=True))
    happen(engine, 2)
    assert claim(engine) == []
    with transaction(engine) as conn:
        assert get_webhook(conn, DEFAULT_TENANT, webhook).pending == 2
        with pytest.raises(Conflict, match="is paused"):
            send_test(conn, DEFAULT_TENANT, webhook)
        with pytest.raises(Conflict, match="is paused"):
            replay_delivery(conn, DEFAULT_TENANT, webhook, deliveries(engine, webhook)[0].event)
        change_webhook(conn, DEFAULT_TENANT, webhook, WebhookChange(paused=False, url="https://new.example/"))
    assert [due.url for due in claim(engine)] == ["https://new.example/"] * 2


def test_a_webhook_with_many_deliveries_does_not_stand_before_the_others(engine: sa.Engine) -> None:
    loud = new_webhook(engine)
    happen(engine, 6)
    quiet = new_webhook(engine, "https://quiet.example/")
    happen(engine, 1)
    assert sorted(str(due.webhook) for due in claim(engine, each=2)) == sorted(map(str, [loud, loud, quiet]))
    assert claim(engine, each=2, busy={loud: 2, quiet: 1}) == []
    assert len(claim(engine, each=2, busy={loud: 1})) == 1
    assert len(claim(engine, 1, each=2)) == 1
    assert len(claim(engine, each=10)) == 3


def test_claims_that_are_given_back_cost_no_try(engine: sa.Engine) -> None:
    new_webhook(engine)
    happen(engine, 2)
    first = claim(engine)
    record(engine, first[0], ARRIVED)
    with transaction(engine) as conn:
        give_back_deliveries(conn, first)  # the first is past giving back
    (again,) = claim(engine)
    assert (again.event, again.tries) == (first[1].event, 0)


def test_a_test_message_goes_to_one_webhook_and_is_tried_once(engine: sa.Engine) -> None:
    webhook, other = new_webhook(engine), new_webhook(engine)
    with transaction(engine) as conn:
        sent = send_test(conn, DEFAULT_TENANT, webhook)
    (due,) = claim(engine)
    assert (due.event, due.kind, due.data) == (sent.event, "webhook.test", {"webhook": str(webhook)})
    assert record(engine, due, REFUSED) is DeliveryState.FAILED
    assert messages_of(engine, other) == []


def test_a_delivery_is_made_at_the_moment_of_its_event(engine: sa.Engine) -> None:
    """Listings are in this order, also of a transaction that took long."""
    webhook = new_webhook(engine)
    happen(engine)
    with transaction(engine) as conn:
        conn.execute(sa.text("SELECT pg_sleep(0.05)"))
        send_test(conn, DEFAULT_TENANT, webhook)
    with transaction(engine) as conn:
        times = {row.id: row.at for row in conn.execute(sa.text("SELECT id, at FROM webhook_event"))}
    made = deliveries(engine, webhook)
    assert [row.kind for row in made] == ["job.ended", "webhook.test"]
    assert [row.created for row in made] == [times[row.event] for row in made]


def test_a_webhook_counts_its_own_deliveries_that_wait_and_that_failed(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    happen(engine, 3)
    other = new_webhook(engine)
    with transaction(engine) as conn:
        sent = send_test(conn, DEFAULT_TENANT, webhook)
    due = {each.event: each for each in claim(engine)}
    assert record(engine, due.pop(sent.event), REFUSED) is DeliveryState.FAILED  # a test is tried once
    assert record(engine, due.popitem()[1], ARRIVED) is DeliveryState.DELIVERED
    with transaction(engine) as conn:
        rows = {row.id: (row.pending, row.failed) for row in list_webhooks(conn, DEFAULT_TENANT).rows}
    assert rows == {webhook: (2, 1), other: (0, 0)}


def test_a_removed_webhook_takes_its_deliveries_along_also_those_under_way(engine: sa.Engine) -> None:
    webhook, other = new_webhook(engine), new_webhook(engine)
    happen(engine)
    due = {each.webhook: each for each in claim(engine)}
    with transaction(engine) as conn:
        delete_webhook(conn, DEFAULT_TENANT, webhook)
    assert record(engine, due[webhook], ARRIVED) is None
    assert record(engine, due[other], ARRIVED) is DeliveryState.DELIVERED
    with transaction(engine) as conn, pytest.raises(NotFound, match="no such webhook"):
        list_deliveries(conn, DEFAULT_TENANT, webhook)


def test_events_are_forgotten_after_a_month_with_their_deliveries(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    happen(engine, 2)
    for due in claim(engine):
        record(engine, due, ARRIVED)
    old = deliveries(engine, webhook)[0].event
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE webhook_event SET at = at - interval '30 days' WHERE id = :id"), {"id": old})
    sweep(engine)
    assert (len(deliveries(engine, webhook)), events_written(engine)) == (1, 1)
