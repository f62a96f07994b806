"""The delivery loop with real receivers: a hanging receiver delays no other, and lost deliveries are repeated."""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import pytest
import sqlalchemy as sa
from cryptography.fernet import Fernet
from standardwebhooks.webhooks import Webhook

from marey.core.addresses import Allowed
from marey.db import transaction
from marey.jobs import cancel, list_schedulers
from marey.scheduler.sending import Sender
from marey.scheduler.webhooks import EACH, Deliverer
from marey.tenants import DEFAULT_TENANT
from marey.webhooks import Attempt, DeliveryState, claim_deliveries, rotate_secret, send_test
from marey.webhooks.vault import Vault, new_signing_secret
from tests.servers.jobs import claim_some, let_expire, parse_texts, submit_items
from tests.servers.receiver import LOOPBACK, Receiver, hang, status
from tests.support.evaluations import wait
from tests.support.scheduler_processes import Start, scheduler_processes
from tests.support.toy_jobs import job_row
from tests.support.webhooks import KEY, SECRET, VAULT, deliveries, errors, happen, new_webhook, time_passes

API = "http://127.0.0.1:8400"
DONE = [DeliveryState.DELIVERED]


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    with Receiver() as made:
        yield made


@contextmanager
def delivering(engine: sa.Engine, *, vault: Vault = VAULT, sender: Sender | None = None) -> Iterator[Deliverer]:
    """A deliverer until the end of the block."""
    stopping = threading.Event()
    sender = sender or Sender(Allowed.of(LOOPBACK), seconds=60)
    thread = Deliverer(engine, vault, sender, api=API, interval=0.02, stopping=stopping)
    thread.start()
    try:
        yield thread
    finally:
        stopping.set()
        thread.join(30)
        assert not thread.is_alive()


def all_delivered(engine: sa.Engine, webhook: object) -> bool:
    return {row.state for row in deliveries(engine, webhook)} == {DeliveryState.DELIVERED}  # type: ignore[arg-type]


def test_an_event_arrives_signed_once_with_where_the_api_shows_it(engine: sa.Engine, receiver: Receiver) -> None:
    webhook = new_webhook(engine, receiver.url())
    job = submit_items(engine, 2)
    with delivering(engine):
        with transaction(engine) as conn:
            cancel(conn, DEFAULT_TENANT, job)
        wait(lambda: all_delivered(engine, webhook))
        happen(engine)  # whatever comes twice would have come by the time of this
        receiver.wait(2)
    first, second = receiver.received
    document = Webhook(SECRET).verify(first.body, first.headers)
    assert document["type"] == "job.ended"
    assert document["data"]["urls"] == {"job": f"{API}/v1/jobs/{job}"}
    assert (document["data"]["state"], document["data"]["counters"]["cancelled"]) == ("cancelled", 2)
    assert first.id != second.id
    (row, _) = deliveries(engine, webhook)
    assert (str(row.event), row.status, row.error, row.attempts) == (first.id, 200, None, 1)


def test_while_a_secret_is_rotated_the_receiver_may_know_either(engine: sa.Engine, receiver: Receiver) -> None:
    webhook, secret = new_webhook(engine, receiver.url()), new_signing_secret()
    with transaction(engine) as conn:
        rotate_secret(conn, DEFAULT_TENANT, webhook, VAULT.encrypt(secret))
    with delivering(engine):
        happen(engine)
        wait(lambda: all_delivered(engine, webhook))
    (request,) = receiver.received
    for known in (SECRET, secret):
        assert Webhook(known).verify(request.body, request.headers)["type"] == "job.ended"


def test_a_receiver_s_wish_to_wait_is_kept(engine: sa.Engine, receiver: Receiver) -> None:
    receiver.answer = status(503, **{"Retry-After": "3600"})
    webhook = new_webhook(engine, receiver.url())
    with delivering(engine):
        happen(engine)
        wait(lambda: deliveries(engine, webhook)[0].status == 503)
    (row,) = deliveries(engine, webhook)
    assert row.next is not None
    assert (row.next - row.created).total_seconds() > 3000


def test_what_a_receiver_refuses_is_tried_again_under_the_same_id(engine: sa.Engine, receiver: Receiver) -> None:
    receiver.answer = status(500)
    webhook = new_webhook(engine, receiver.url())
    with delivering(engine):
        happen(engine)
        wait(lambda: deliveries(engine, webhook)[0].status == 500)
        receiver.answer = status(204)
        time_passes(engine)
        wait(lambda: all_delivered(engine, webhook))
    first, second = receiver.received
    assert (first.id, first.body) == (second.id, second.body)
    for request in (first, second):
        Webhook(SECRET).verify(request.body, request.headers)
    assert errors(engine, webhook, deliveries(engine, webhook)[0].event) == ["answered 500", None]


def test_a_receiver_that_hangs_holds_up_no_other_and_takes_few_at_a_time(engine: sa.Engine, receiver: Receiver) -> None:
    with Receiver() as slow, delivering(engine):
        slow.answer = hang
        hanging = new_webhook(engine, slow.url())
        happen(engine, EACH + 2)
        slow.wait(EACH)
        webhook = new_webhook(engine, receiver.url())
        happen(engine, EACH + 2)
        wait(lambda: all_delivered(engine, webhook))
        assert len(slow.received) == EACH
        assert not any(row.attempts for row in deliveries(engine, hanging))
        slow.released.set()
    assert len(receiver.received) == EACH + 2


def test_two_deliverers_of_one_database_tell_each_event_once(engine: sa.Engine, receiver: Receiver) -> None:
    webhook = new_webhook(engine, receiver.url())
    with delivering(engine), delivering(engine):
        happen(engine, 25)
        wait(lambda: all_delivered(engine, webhook))
    assert len(receiver.received) == len({request.id for request in receiver.received}) == 25


def test_what_was_claimed_or_sent_and_not_written_down_is_told_again_under_the_same_id(
    engine: sa.Engine, receiver: Receiver
) -> None:
    """As if a scheduler had died at either moment."""
    webhook = new_webhook(engine, receiver.url())
    happen(engine, 2)
    with transaction(engine) as conn:
        claimed = claim_deliveries(conn, 10, each=10)
    assert len(claimed) == 2
    with delivering(engine):
        happen(engine)
        receiver.wait(1)
        wait(lambda: [row.state for row in deliveries(engine, webhook)][-1:] == DONE)
        assert [row.attempts for row in deliveries(engine, webhook)] == [0, 0, 1]  # behind their claims
        time_passes(engine)
        wait(lambda: all_delivered(engine, webhook))
    assert {request.id for request in receiver.received[1:]} == {str(due.event) for due in claimed}


def test_who_stops_gives_back_what_is_under_way(
    engine: sa.Engine, receiver: Receiver, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("marey.scheduler.webhooks.STOP_SECONDS", 0.1)
    receiver.answer = hang
    webhook = new_webhook(engine, receiver.url())
    with delivering(engine):
        happen(engine)
        receiver.wait(1)
    assert [(row.state, row.attempts) for row in deliveries(engine, webhook)] == [(DeliveryState.PENDING, 0)]
    receiver.answer = status(200)
    with delivering(engine):  # at once: no wait for a claim to expire
        wait(lambda: all_delivered(engine, webhook))
    first, second = receiver.received
    assert first.id == second.id


def test_a_secret_that_does_not_open_is_told_in_the_log_and_nothing_is_sent(
    engine: sa.Engine, receiver: Receiver
) -> None:
    webhook = new_webhook(engine, receiver.url())
    with transaction(engine) as conn:
        sent = send_test(conn, DEFAULT_TENANT, webhook)
    with delivering(engine, vault=Vault(Fernet.generate_key().decode())):
        wait(lambda: deliveries(engine, webhook)[0].state is DeliveryState.FAILED)
    assert errors(engine, webhook, sent.event) == ["MAREY_WEBHOOK_KEY: does not open this webhook's secret"]
    assert receiver.received == []


class Tripping(Sender):
    """A sender with a bug."""

    async def send(self, url: str, headers: Mapping[str, str], body: bytes) -> Attempt:
        raise ZeroDivisionError(url)


def test_a_bug_costs_a_try_and_holds_up_nobody(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    happen(engine)
    with delivering(engine, sender=Tripping(Allowed.of([]))):
        wait(lambda: deliveries(engine, webhook)[0].attempts == 1)
    (row,) = deliveries(engine, webhook)
    assert (row.state, "internal error" in (row.error or "")) == (DeliveryState.PENDING, True)


# --- the process ---


@pytest.fixture
def start(database_url: str, queue_url: str, tmp_path: Path) -> Iterator[Start]:
    """Starts `marey scheduler`s."""
    settings = {
        "MAREY_HOME": str(tmp_path),
        "MAREY_DATABASE_URL": database_url,
        "MAREY_QUEUE_URL": queue_url,
        "MAREY_WEBHOOK_KEY": KEY,
        "MAREY_WEBHOOK_ALLOW": json.dumps(LOOPBACK),
        "MAREY_WEBHOOK_SECONDS": "0.05",
        "MAREY_SWEEP_SECONDS": "0.05",
    }
    with scheduler_processes(settings, tmp_path) as start:
        yield start


def test_a_scheduler_that_is_killed_loses_nothing_and_sweeps_while_receivers_hang(
    engine: sa.Engine, receiver: Receiver, start: Start, tmp_path: Path
) -> None:
    receiver.answer = hang
    webhook = new_webhook(engine, receiver.url("127.0.0.1", "/secret-path"))
    happen(engine, 6)
    process = start()
    under_way = {request.id for request in receiver.wait(EACH)}
    job = submit_items(engine, 1)
    parse_texts(engine)
    let_expire(engine, claim_some(engine).lease_token)
    wait(lambda: job_row(engine, job).leased == 0)  # swept, by a scheduler whose receivers all hang
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert all(row.attempts == 0 for row in deliveries(engine, webhook))
    receiver.answer = status(200)
    time_passes(engine)
    process = start()
    wait(lambda: all_delivered(engine, webhook))
    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == 0
    again = [request.id for request in receiver.received[EACH:]]
    assert len(again) == len(set(again)) == 6
    assert under_way < set(again)
    logs = "".join(log.read_text() for log in tmp_path.glob("scheduler*.log"))
    assert "webhook_delivered" in logs
    for hidden in ("secret-path", SECRET, KEY):
        assert hidden not in logs


def at_work(engine: sa.Engine) -> int:
    """Schedulers that have made progress."""
    with transaction(engine) as conn:
        return sum(scheduler.live for scheduler in list_schedulers(conn))


def test_two_scheduler_processes_tell_each_event_once_and_take_a_lease_back_once(
    engine: sa.Engine, receiver: Receiver, start: Start, tmp_path: Path
) -> None:
    webhook = new_webhook(engine, receiver.url())
    processes = [start(), start()]
    wait(lambda: at_work(engine) == 2)
    happen(engine, 20)
    job = submit_items(engine, 1)
    parse_texts(engine)
    let_expire(engine, claim_some(engine).lease_token)
    happen(engine, 20)
    wait(lambda: job_row(engine, job).leased == 0 and len(deliveries(engine, webhook)) == 40)
    wait(lambda: all_delivered(engine, webhook))
    for process in processes:
        process.send_signal(signal.SIGTERM)
    assert [process.wait(60) for process in processes] == [0, 0]
    assert len({request.id for request in receiver.received}) == len(receiver.received) == 40
    logs = [log.read_text() for log in sorted(tmp_path.glob("scheduler*.log"))]
    assert all("webhook_delivered" in log for log in logs), "one of the two did nothing"
    with transaction(engine) as conn:
        lost = "SELECT count(*) FROM job_event WHERE kind = 'lease_lost'"
        assert conn.execute(sa.text(lost)).scalar_one() == 1
