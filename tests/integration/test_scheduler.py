"""Relay, sweeper and their threads on a real Postgres and a real Valkey."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import redis
import sqlalchemy as sa
from pydantic import SecretStr

from marey.core.errors import InvalidInput, Unreachable
from marey.core.settings import Settings
from marey.db import QUEUE_CHANNEL, transaction
from marey.jobs import (
    SchedulerRow,
    WorkerHeartbeat,
    beat,
    claim,
    list_schedulers,
    list_workers,
    live_workers,
    pause,
    record_scheduler_heartbeat,
    retire,
    sweep,
)
from marey.runtime.app import DRAIN, create_app
from marey.runtime.queue import redis_client
from marey.scheduler.components import EXIT_STALLED, note_progress, watch
from marey.scheduler.main import scheduler_main
from marey.scheduler.periodic import Periodic
from marey.scheduler.relay import Relay, publisher
from marey.tenants.types import DEFAULT_TENANT
from tests.support.evaluations import wait
from tests.support.toy import QUEUE
from tests.support.toy_jobs import job_row, submit_toys


@pytest.fixture
def lists(queue_url: str) -> Iterator[redis.Redis]:
    with redis_client(queue_url) as client:
        yield client


@pytest.fixture
def relay(engine: sa.Engine, database_url: str, queue_url: str, lists: redis.Redis) -> Iterator[Relay]:
    """A relay whose first hint to idle workers is past."""
    stopping = threading.Event()
    app = create_app(queue_url)
    made = Relay(engine, database_url, lists, publisher(app), interval=0.5, stopping=stopping)
    assert made.round() == {}
    yield made
    stopping.set()
    if made.is_alive():
        made.join(10.0)
    app.close()


def live(engine: sa.Engine, *names: str, queue: str = QUEUE) -> None:
    with transaction(engine) as conn:
        for name in names:
            beat(conn, WorkerHeartbeat(id=f"{name}/{queue}", queue=queue, host="here", pid=1, device="cpu"))


def test_there_are_no_more_hints_than_workers(engine: sa.Engine, relay: Relay, lists: redis.Redis) -> None:
    live(engine, "a", "b")
    submit_toys(engine, ["walk"] * 100)
    assert relay.round() == {QUEUE: 2}
    assert lists.llen(QUEUE) == 2


def test_there_are_no_more_hints_than_batches(engine: sa.Engine, relay: Relay, lists: redis.Redis) -> None:
    live(engine, "a", "b", "c")
    submit_toys(engine, ["walk"] * 33)
    relay.round()
    assert lists.llen(QUEUE) == 2


def test_a_round_adds_only_what_is_missing(engine: sa.Engine, relay: Relay, lists: redis.Redis) -> None:
    live(engine, "a", "b")
    submit_toys(engine, ["walk"] * 100)
    relay.round()
    assert relay.round() == {}
    lists.lpop(QUEUE)
    assert relay.round() == {QUEUE: 1}


def test_a_flushed_queue_is_filled_again_from_the_rows(engine: sa.Engine, relay: Relay, lists: redis.Redis) -> None:
    live(engine, "a", "b")
    submit_toys(engine, ["walk"] * 100)
    relay.round()
    lists.flushall()
    assert relay.round() == {QUEUE: 2}


def test_without_living_workers_there_are_no_hints(engine: sa.Engine, relay: Relay) -> None:
    submit_toys(engine, ["walk"] * 100)
    assert relay.round() == {}
    live(engine, "a")
    with transaction(engine) as conn:
        retire(conn, f"a/{QUEUE}")
    assert relay.round() == {}


def test_paused_and_claimed_items_call_nobody(engine: sa.Engine, relay: Relay) -> None:
    live(engine, "a")
    paused = submit_toys(engine, ["walk"])
    with transaction(engine) as conn:
        pause(conn, DEFAULT_TENANT, paused)
    assert relay.round() == {}
    submit_toys(engine, ["walk"])
    with transaction(engine) as conn:
        assert claim(conn, QUEUE, "a", 32)
    assert relay.round() == {}


def test_an_idle_worker_gets_a_hint_now_and_then(
    engine: sa.Engine, database_url: str, queue_url: str, lists: redis.Redis
) -> None:
    live(engine, "a", "b")
    fresh = Relay(
        engine, database_url, lists, publisher(create_app(queue_url)), interval=0.5, stopping=threading.Event()
    )
    assert fresh.round() == {QUEUE: 2}
    lists.flushall()
    assert fresh.round() == {}


def test_a_hint_names_the_task_and_the_queue(engine: sa.Engine, relay: Relay, lists: redis.Redis) -> None:
    live(engine, "a")
    submit_toys(engine, ["walk"])
    relay.round()
    message = json.loads(lists.lindex(QUEUE, 0))  # pyright: ignore[reportArgumentType]
    assert message["headers"]["task"] == DRAIN
    assert message["headers"]["argsrepr"] == f"['{QUEUE}']"
    assert message["content-type"] == "application/json"


class CountingRelay(Relay):
    """A relay that says when each of its rounds ended; the first ends after it began to listen."""

    def __init__(self, engine: sa.Engine, database_url: str, lists: redis.Redis, queue_url: str) -> None:
        self.stopping = threading.Event()
        publish = publisher(create_app(queue_url))
        super().__init__(engine, database_url, lists, publish, interval=600.0, stopping=self.stopping)
        self.rounds: list[float] = []

    def round(self) -> dict[str, int]:
        try:
            return super().round()
        finally:
            self.rounds.append(time.monotonic())


@pytest.fixture
def slow_relay(engine: sa.Engine, database_url: str, queue_url: str, lists: redis.Redis) -> Iterator[CountingRelay]:
    """A relay that only a notification can wake, listening already."""
    relay = CountingRelay(engine, database_url, lists, queue_url)
    relay.start()
    try:
        wait(lambda: bool(relay.rounds))
        yield relay
    finally:
        relay.stopping.set()
        submit_toys(engine, ["walk"])  # wakes it up to see that
        relay.join(10.0)
    assert not relay.is_alive()


@pytest.mark.usefixtures("slow_relay")
def test_a_submit_wakes_the_relay_at_once(engine: sa.Engine, lists: redis.Redis) -> None:
    live(engine, "a")
    submit_toys(engine, ["walk"])
    wait(lambda: lists.llen(QUEUE) == 1)


def test_a_burst_of_submits_is_few_rounds(engine: sa.Engine, slow_relay: CountingRelay, lists: redis.Redis) -> None:
    live(engine, "a", "b")
    with engine.connect() as conn:
        for _ in range(200):
            conn.execute(sa.text(f"SELECT pg_notify('{QUEUE_CHANNEL}', 'toy')"))
            conn.commit()
    submit_toys(engine, ["walk"] * 64)
    wait(lambda: lists.llen(QUEUE) == 2)
    assert len(slow_relay.rounds) < 100


def test_a_relay_goes_on_after_its_connection_was_killed(engine: sa.Engine, relay: Relay, lists: redis.Redis) -> None:
    relay.start()
    live(engine, "a")
    for _ in range(2):
        with transaction(engine) as conn:
            conn.execute(
                sa.text(
                    "SELECT pg_terminate_backend(pid) FROM pg_stat_activity "
                    "WHERE datname = current_database() AND pid <> pg_backend_pid()"
                )
            )
        lists.flushall()
        submit_toys(engine, ["walk"])
        wait(lambda: lists.llen(QUEUE) == 1)


def test_publishing_to_a_queue_that_is_away_ends_and_says_so(tmp_path: Path) -> None:
    publish = publisher(create_app(f"redis+socket://{tmp_path}/nobody.sock"))
    with pytest.raises(Unreachable, match="queue"):
        publish(QUEUE)


def test_a_periodic_action_outlives_its_errors() -> None:
    stopping = threading.Event()
    calls: list[int] = []

    def act() -> None:
        calls.append(1)
        if len(calls) == 1:
            raise Unreachable("away")
        if len(calls) == 2:
            raise RuntimeError("a bug")

    thread = Periodic("test", act, seconds=0.01, stopping=stopping)
    thread.start()
    wait(lambda: len(calls) > 3)
    stopping.set()
    thread.join(5.0)
    assert not thread.is_alive()


def test_a_periodic_action_that_hangs_is_told_by_its_silence() -> None:
    stopping, released = threading.Event(), threading.Event()
    thread = Periodic("test", lambda: released.wait() and None, seconds=0.05, stopping=stopping)
    thread.start()
    wait(lambda: thread.silence() > 0.3)
    released.set()
    wait(lambda: thread.silence() < 0)
    stopping.set()
    thread.join(5.0)


def test_a_round_that_hangs_is_told_long_before_the_next_would_be_due() -> None:
    stopping, released = threading.Event(), threading.Event()
    thread = Periodic("test", lambda: released.wait() and None, seconds=0.2, stopping=stopping)
    thread._between_rounds = 600.0  # pyright: ignore[reportPrivateUsage] - it comes at once all the same
    thread.start()
    assert not thread.stalled(0.0)
    wait(lambda: thread.stalled(0.3))
    released.set()
    wait(lambda: not thread.stalled(0.0))
    stopping.set()
    thread.join(5.0)


def test_after_an_outage_heartbeats_come_before_the_sweeper() -> None:
    """Leases run out while the database is away; taking them at its return would blame the workers."""
    stopping = threading.Event()
    order: list[str] = []
    away = [True, True, False]

    def act() -> None:
        order.append("act")
        if away[0]:
            raise Unreachable("away")

    def probe() -> None:
        away.pop(0)
        order.append("probe")
        if away[0]:
            raise Unreachable("away")

    thread = Periodic("test", act, seconds=0.0, stopping=stopping, probe=probe, grace=0.0)
    for _ in range(3):
        try:
            thread.once()
        except Unreachable:
            thread.away = True
    assert order == ["act", "probe", "probe", "act"]


def test_an_outage_that_a_retry_has_hidden_holds_the_sweeper_back_too() -> None:
    """A silent connection was replaced before use: no call failed, but workers may not have found the way back yet."""
    order: list[str] = []
    outages = [0]

    def probe() -> None:
        order.append("probe")
        if len(order) == 3:
            outages[0] += 1

    thread = Periodic(
        "test",
        lambda: order.append("act"),
        seconds=0.0,
        stopping=threading.Event(),
        probe=probe,
        grace=0.01,
        outages=lambda: outages[0],
        meanwhile=lambda: order.append("meanwhile"),
    )
    for _ in range(3):
        thread.once()
    assert order == ["probe", "act", "probe", "meanwhile", "act", "probe", "act"]


def test_scheduler_returns_lost_leases_and_stops_when_told(
    engine: sa.Engine, database_url: str, queue_url: str, tmp_path: Path
) -> None:
    job = submit_toys(engine, ["walk"] * 3)
    with transaction(engine) as conn:
        assert claim(conn, QUEUE, "dead", 32)
        conn.execute(sa.text("UPDATE lease SET expires_at = now() - interval '1 second'"))
    chosen = Settings(
        home=tmp_path,
        database_url=SecretStr(database_url),
        queue_url=SecretStr(queue_url),
        store=str(tmp_path / "assets"),
        sweep_seconds=0.05,
    )
    stopping = threading.Event()
    thread = threading.Thread(target=scheduler_main, args=(chosen,), kwargs={"stopping": stopping})
    thread.start()
    try:
        wait(lambda: job_row(engine, job).ready == 3)
    finally:
        stopping.set()
        thread.join(20.0)
    assert not thread.is_alive()


# --- a scheduler that stalls ---


def run_alone(chosen: Settings, seconds: float, before: str = "pass") -> subprocess.Popen[str]:
    """A scheduler process that exits when a part makes no progress for `seconds`; `before`: what is run in it first."""
    code = (
        "import marey.scheduler.main as main, marey.scheduler.components as parts, marey.scheduler.upkeep as upkeep, "
        "marey.core.settings as settings; "
        f"parts.LOOK_SECONDS = {seconds / 4}; parts.STALL_SECONDS = {seconds}; main.BEAT_SECONDS = 0.2; "
        f"import sys, time; {before}; sys.exit(main.scheduler_main(settings.settings()))"
    )
    environment = {
        **os.environ,
        "MAREY_HOME": str(chosen.home),
        "MAREY_DATABASE_URL": chosen.database_url.get_secret_value() if chosen.database_url else "",
        "MAREY_QUEUE_URL": chosen.queue_url.get_secret_value() if chosen.queue_url else "",
        "MAREY_STORE": str(chosen.home / "assets"),
        "MAREY_SWEEP_SECONDS": "2",
        "MAREY_LEASE_SECONDS": "2",
        "MAREY_HEARTBEAT_SECONDS": "0.4",
    }
    return subprocess.Popen([sys.executable, "-c", code], env=environment, stderr=subprocess.PIPE, text=True)


def test_a_scheduler_whose_part_hangs_exits_with_a_line_in_the_log(
    engine: sa.Engine, database_url: str, queue_url: str, tmp_path: Path
) -> None:
    """The sweeper hangs in something that no deadline ends; the relay goes on beside it."""
    chosen = Settings(home=tmp_path, database_url=SecretStr(database_url), queue_url=SecretStr(queue_url))
    process = run_alone(chosen, seconds=4.0, before="upkeep.sweep = lambda _engine: time.sleep(3600)")
    try:
        wait(lambda: bool(schedulers(engine)), 60.0)
        _, log = process.communicate(timeout=120.0)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == EXIT_STALLED, log
    assert "scheduler_stalled" in log
    assert "sweeper" in log.partition("scheduler_stalled")[2]
    assert "relay" not in log.partition("scheduler_stalled")[2]
    (row,) = schedulers(engine)
    assert row.pid == process.pid  # doctor tells of it


def test_a_scheduler_says_that_it_works_until_it_is_told_to_stop(
    engine: sa.Engine, database_url: str, queue_url: str, tmp_path: Path
) -> None:
    with transaction(engine) as conn:
        record_scheduler_heartbeat(conn, "stalled", host="here", pid=1)
        conn.execute(sa.text("UPDATE worker SET seen_at = now() - interval '1 minute'"))
    chosen = Settings(home=tmp_path, database_url=SecretStr(database_url), queue_url=SecretStr(queue_url))
    process = run_alone(chosen, seconds=60.0)
    try:
        wait(lambda: [row.pid for row in schedulers(engine)] == [process.pid], 60.0)
        first = schedulers(engine)[0]
        wait(lambda: schedulers(engine)[0].seen > first.seen, 60.0)
        with transaction(engine) as conn:
            assert list_workers(conn) == []
            assert live_workers(conn) == {}
    finally:
        process.terminate()
        process.communicate(timeout=60.0)
    assert process.returncode == 0
    assert schedulers(engine) == []


def schedulers(engine: sa.Engine) -> list[SchedulerRow]:
    with transaction(engine) as conn:
        return list_schedulers(conn)


def test_a_round_that_takes_long_is_no_stall_as_long_as_its_statements_are_answered(engine: sa.Engine) -> None:
    note_progress(engine)
    stopping, slow = threading.Event(), threading.Event()

    def act() -> None:
        while not stopping.is_set() and not slow.is_set():
            with transaction(engine) as conn:
                conn.execute(sa.text("SELECT pg_sleep(0.05)"))
        stopping.wait()

    part = Periodic("retention", act, seconds=0.01, stopping=stopping)
    part.start()
    found: list[bool] = []
    watcher = threading.Thread(target=lambda: found.append(watch([part], stopping, seconds=2.0, look=0.5)))
    watcher.start()
    time.sleep(4.5)
    assert watcher.is_alive()
    slow.set()
    watcher.join(30.0)
    assert found == [True]
    stopping.set()
    part.join(10.0)


def test_one_look_that_finds_every_part_silent_is_a_machine_that_slept() -> None:
    stopping = threading.Event()
    part = Periodic("part", lambda: None, seconds=0.05, stopping=stopping)
    part.start()
    found: list[bool] = []
    watcher = threading.Thread(target=lambda: found.append(watch([part], stopping, seconds=1.0, look=0.2)))
    watcher.start()
    part._ticked -= 100.0
    time.sleep(1.0)
    stopping.set()
    watcher.join(10.0)
    part.join(10.0)
    assert found == [False]


def test_a_scheduler_without_database_says_what_to_set() -> None:
    with pytest.raises(InvalidInput, match="MAREY_DATABASE_URL"):
        scheduler_main(Settings(database_url=None, queue_url=None), stopping=threading.Event())


def test_a_worker_that_was_not_seen_for_a_day_is_forgotten(engine: sa.Engine) -> None:
    live(engine, "a", "b")
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE worker SET seen_at = seen_at - interval '25 hours' WHERE id LIKE 'a/%'"))
        conn.execute(sa.text("UPDATE worker SET seen_at = seen_at - interval '23 hours' WHERE id LIKE 'b/%'"))
    sweep(engine)
    with transaction(engine) as conn:
        assert [row.id for row in list_workers(conn)] == [f"b/{QUEUE}"]


def test_a_new_scheduler_takes_the_place_of_silent_ones_and_of_no_worker(engine: sa.Engine) -> None:
    live(engine, "a", "b")
    with transaction(engine) as conn:
        for name in ("old", "beside"):
            record_scheduler_heartbeat(conn, name, host="here", pid=2)
        conn.execute(
            sa.text("UPDATE worker SET seen_at = seen_at - interval '1 hour' WHERE id LIKE 'a/%' OR id = 'old'")
        )
    found = {row.id: row for row in schedulers(engine)}
    assert {name: row.live for name, row in found.items()} == {"old": False, "beside": True}
    assert 3600 <= found["old"].silence < 3700
    assert 0 <= found["beside"].silence < 100
    with transaction(engine) as conn:
        record_scheduler_heartbeat(conn, "beside", host="here", pid=2)
    assert len(schedulers(engine)) == 2, "it is known"
    with transaction(engine) as conn:
        record_scheduler_heartbeat(conn, "new", host="there", pid=3)
        assert {row.id for row in list_workers(conn)} == {f"a/{QUEUE}", f"b/{QUEUE}"}
    assert [(row.id, row.host, row.pid) for row in schedulers(engine)] == [("new", "there", 3), ("beside", "here", 2)]
