"""Findings of `marey doctor`: each fault, on the real thing, and the advice."""

from __future__ import annotations

import shutil
import socket
import threading
import time
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
import sqlalchemy as sa
from pydantic import SecretStr

from marey.api.health.metrics import render
from marey.cli import doctor
from marey.cli import doctor_servers as backing
from marey.cli.doctor import models
from marey.cli.doctor_findings import Finding
from marey.core.settings import Settings
from marey.db import downgrade, transaction
from marey.jobs import WorkerHeartbeat, beat, record_scheduler_heartbeat
from marey.runtime.queue import redis_client
from marey.storage import FolderStore
from tests.servers.jobs import claim_some, parse_texts, submit_items
from tests.support.live_api import BUNDLE, write_bundle
from tests.support.models import TEXT_BUNDLES, add_text_bundles


def bad(check: Finding, *said: str, state: str = "bad") -> None:
    """It is bad, and its words hold all of `said`, with something to do."""
    assert check.state == state, check
    assert check.hint
    for part in said:
        assert part in f"{check.message} {check.hint}"


def test_a_database_of_an_older_revision_wants_migrating(engine: sa.Engine) -> None:
    assert backing.database(engine).state == "ok"
    downgrade(engine, "-1")
    bad(backing.database(engine), "revision", "marey admin migrate")


def test_items_that_nobody_serves_are_told_with_the_worker_to_start(engine: sa.Engine) -> None:
    bad(backing.workers(engine), "none", "marey serve", state="warn")
    bad(backing.workers(engine, Path("logs")), "runs here", "Wait", state="warn")
    submit_items(engine, 2)
    parse_texts(engine)
    bad(backing.workers(engine), "items wait in hgm3", "marey worker hgm3")
    with transaction(engine) as conn:
        beat(conn, WorkerHeartbeat("one", "hgm3", "here", 1, "cpu"))
    assert backing.workers(engine) == Finding("workers", "ok", "1 live, for hgm3")
    with transaction(engine) as conn:
        beat(conn, WorkerHeartbeat("two", "hgm3", "there", 2, "cpu"))
        conn.execute(sa.text("UPDATE worker SET seen_at = now() - interval '1 hour' WHERE id = 'two'"))
    bad(backing.workers(engine), "two on there fell silent", state="warn")


def test_leases_that_nobody_takes_back_mean_that_no_scheduler_runs(engine: sa.Engine) -> None:
    submit_items(engine, 1)
    claim_some(engine, "text")
    bad(backing.scheduler(engine), "none was heard of", "marey scheduler", state="warn")
    with transaction(engine) as conn:
        record_scheduler_heartbeat(conn, "one", host="here", pid=1)
    assert backing.scheduler(engine).state == "ok"
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE lease SET expires_at = now() - interval '1 minute'"))
    bad(backing.scheduler(engine), "1 leases", "marey scheduler")


def test_a_scheduler_that_stalls_is_told_with_its_last_progress(engine: sa.Engine) -> None:
    with transaction(engine) as conn:
        record_scheduler_heartbeat(conn, "one", host="here", pid=17)
        conn.execute(sa.text("UPDATE worker SET seen_at = now() - interval '40 seconds'"))
    bad(backing.scheduler(engine), "on here (process 17)", "40 s ago", "marey scheduler")
    assert backing.workers(engine).message == "none was heard of lately"
    shown = render(engine).decode()
    (line,) = [line for line in shown.splitlines() if line.startswith("marey_scheduler_silent_seconds{")]
    assert 40.0 <= float(line.split()[1]) < 400.0
    with transaction(engine) as conn:
        conn.execute(
            sa.text(
                "INSERT INTO worker SELECT 'two', queue, 'there', 18, device, bundle, batch_key, "
                "started_at, now() FROM worker"
            )
        )
    bad(backing.scheduler(engine), "another works", "on here (process 17)", state="warn")


def test_a_server_that_hangs_is_told_apart_from_one_that_is_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "ANSWER_SECONDS", 0.3)
    monkeypatch.setattr(doctor, "LIVE_SECONDS", 0.3)
    with socket.create_server(("127.0.0.1", 0), backlog=16) as silent:
        address = f"http://127.0.0.1:{silent.getsockname()[1]}"
        monkeypatch.setenv("MAREY_SERVER", address)
        monkeypatch.setenv("MAREY_KEY", "k")
        bad(doctor._server(), "accepts connections", "restart")
    bad(doctor._server(), "does not answer", "marey serve")


class HangingListings(BaseHTTPRequestHandler):
    """Answers /livez, and nothing else before the test is over."""

    def do_GET(self) -> None:
        if self.path != "/livez":
            time.sleep(2.0)
            return
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        pass


def test_a_server_whose_listings_hang_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor, "ANSWER_SECONDS", 0.3)
    server = ThreadingHTTPServer(("127.0.0.1", 0), HangingListings)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    monkeypatch.setenv("MAREY_SERVER", f"http://127.0.0.1:{server.server_port}")
    monkeypatch.setenv("MAREY_KEY", "k")
    try:
        bad(doctor._server(), "answers /livez, but not /v1/jobs", "restart")
    finally:
        server.shutdown()
        server.server_close()


@pytest.mark.parametrize(
    ("seconds", "state"), [(0.0, "ok"), (1.9, "ok"), (-5.0, "warn"), (5.0, "warn"), (-90.0, "bad"), (90.0, "bad")]
)
def test_clocks_apart_are_told_either_way_round(seconds: float, state: str) -> None:
    now = datetime(2026, 11, 23, tzinfo=UTC)
    there = now + timedelta(seconds=seconds)
    assert backing.clock_check(there, now, now).state == state
    slow = backing.clock_check(now, now - timedelta(minutes=5), now + timedelta(minutes=5))
    assert slow.state == "ok"  # an answer that took long says nothing of the clocks


def test_a_queue_that_may_evict_or_is_away_is_bad(queue_url: str, tmp_path: Path) -> None:
    assert backing.queue("queue", queue_url).state == "ok"
    with redis_client(queue_url) as client:
        client.config_set("maxmemory-policy", "allkeys-lru")
        try:
            bad(backing.queue("queue", queue_url), "allkeys-lru", "noeviction")
        finally:
            client.config_set("maxmemory-policy", "noeviction")
    bad(backing.queue("queue", f"redis+socket://{tmp_path}/nobody.sock"), "does not answer", "MAREY_QUEUE_URL")


def test_a_store_is_tried_and_left_as_it_was(tmp_path: Path) -> None:
    config = Settings(home=tmp_path, store=str(tmp_path / "assets"))
    FolderStore(tmp_path / "assets").prepare()
    takes, room = backing.store(config)
    assert (takes.state, room.name) == ("ok", "store")
    assert list(FolderStore(tmp_path / "assets").keys()) == []
    (tmp_path / "file").write_text("not a folder")
    (refused,) = backing.store(Settings(home=tmp_path, store=str(tmp_path / "file")))
    bad(refused, "file", "MAREY_STORE")


def test_a_store_without_its_keys_or_server_is_bad(tmp_path: Path) -> None:
    (keyless,) = backing.store(Settings(home=tmp_path, store="s3://marey"))
    bad(keyless, "MAREY_S3_ACCESS_KEY")
    key = SecretStr("k")
    away = Settings(home=tmp_path, store="s3://marey", s3_endpoint="127.0.0.1:9", s3_access_key=key, s3_secret_key=key)
    (unreachable,) = backing.store(away)
    bad(unreachable, "the object store does not answer", "MAREY_S3_ENDPOINT")


def test_a_bundle_that_was_changed_is_bad_and_one_whose_encoder_is_another_too(tmp_path: Path) -> None:
    write_bundle(tmp_path / "models")
    add_text_bundles(tmp_path / "models")
    config = Settings(home=tmp_path, models=tmp_path / "models")
    whole, reads, *others = models(config)
    assert {check.state for check in (whole, *others)} == {"ok"}
    assert len(others) == len(TEXT_BUNDLES)
    bad(reads, "other weights", "minilm")  # it names an encoder of noughts
    shard = next((tmp_path / "models" / BUNDLE).glob("*.safetensors"))
    content = bytearray(shard.read_bytes())
    content[-1] ^= 1
    shard.write_bytes(content)
    broken, *_ = models(config)
    bad(broken, "sha256", "again")
    shutil.rmtree(tmp_path / "models" / BUNDLE)
    shutil.rmtree(tmp_path / "models" / "minilm-l6")
    write_bundle(tmp_path / "models")
    _, unread, *_ = models(config)
    bad(unread, "minilm-l6", "marey-bundles-open")


def test_a_bundle_that_cannot_be_read_is_bad_and_hides_no_other(tmp_path: Path) -> None:
    write_bundle(tmp_path / "models")
    (tmp_path / "models" / "another").mkdir()
    (tmp_path / "models" / "another" / "manifest.json").write_text("[" * 100_000)
    broken, whole, _ = models(Settings(home=tmp_path, models=tmp_path / "models"))
    bad(broken, "another", "nested more than", "again")
    assert whole.state == "ok"
