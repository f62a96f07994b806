"""Exit codes and operator verbs of the command line."""

from __future__ import annotations

import contextlib
import signal
import socket
import time
from dataclasses import replace
from pathlib import Path
from uuid import uuid4

import psutil
import pytest

from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.errors import NotFound, Unauthenticated
from tests.servers.ports import free_ports
from tests.support.marey import Marey, Serving


@pytest.fixture
def paused(marey: Marey) -> str:
    """A job whose items wait: it is paused before a worker can take them all."""
    items = [{"prompt": f"a person walks {n} steps", "seconds": 9} for n in range(200)]
    with marey.client() as client:
        job: str = client.post_once("/v1/jobs", {"items": items, "priority": -1000})["id"]
        client.post(f"/v1/jobs/{job}/pause")
    return job


def test_not_found_is_3(marey: Marey) -> None:
    marey("jobs", "show", uuid4()).refused(3, "no such job")
    marey("fetch", uuid4()).refused(3, "no such job")
    for command in (("jobs", "show"), ("fetch",)):
        marey(*command, "nope").refused(3, "marey: job 'nope': there is no such job", "marey jobs list")


def test_usage_is_2(marey: Marey) -> None:
    marey("submit", "walk", "--priority", 99999).refused(
        2, "--priority: 99999 is above 1,000, the most that is allowed"
    )
    marey("motions", "list", "--tag", "").refused(2, "tag", "is empty")
    marey("webhooks", "add", "https://x.example", "--event", "nope").refused(
        2, "--event: 'nope' is not known", "job.ended"
    )
    marey("nonsense").refused(2, "nonsense")
    marey("submit", "--nonsense").refused(2, "--nonsense")


def test_no_server_is_4(offline: Marey) -> None:
    offline("jobs", "list").refused(4, "no server is running here", "marey serve", "MAREY_SERVER")
    away = replace(offline, environment={"MAREY_SERVER": "http://127.0.0.1:9", "MAREY_KEY": "x"})
    away("jobs", "list").refused(4, "http://127.0.0.1:9", "does not answer")
    replace(offline, environment={"MAREY_SERVER": "ftp://x"})("jobs", "list").refused(2, "MAREY_SERVER")


def test_a_wrong_key_is_5(elsewhere: Marey) -> None:
    wrong = replace(elsewhere, environment={**elsewhere.environment, "MAREY_KEY": "marey_00000000_wrong"})
    wrong("jobs", "list").refused(5, "key")
    replace(elsewhere, environment={"MAREY_SERVER": elsewhere.environment["MAREY_SERVER"]})("jobs", "list").refused(
        5, "MAREY_KEY"
    )


def wait_for_connection(pid: int) -> None:
    """Wait until a process asks a server."""
    deadline = time.monotonic() + 60
    while not psutil.Process(pid).net_connections("tcp"):
        assert time.monotonic() < deadline
        time.sleep(0.1)


def test_cancelled_items_are_6_and_a_timeout_is_7_and_an_interrupt_130(marey: Marey, paused: str) -> None:
    marey("jobs", "wait", paused, "--timeout", 0.5).refused(7, paused, "the time allowed has passed")
    waiting = marey.start("jobs", "watch", paused)
    wait_for_connection(waiting.pid)
    waiting.send_signal(signal.SIGINT)
    assert waiting.wait(60) == 130
    marey("jobs", "cancel", paused).ok()
    marey("jobs", "wait", paused).refused(6, "cancelled of 200 items", f"marey jobs retry {paused}")
    marey("jobs", "watch", paused).refused(6, "cancelled")


def test_an_operator_sees_changes_and_deletes_jobs(marey: Marey, paused: str) -> None:
    assert "paused" in marey("jobs", "show", paused).ok().out
    assert paused in marey("jobs", "list", "--state", "paused").ok().out
    marey("jobs", "resume", paused).ok()
    marey("jobs", "pause", paused).ok()
    marey("jobs", "delete", paused, "--yes").refused(2, "Cancel it first")
    marey("jobs", "cancel", paused).ok()
    marey("jobs", "delete", paused, "--yes").ok()
    marey("jobs", "show", paused).refused(3)


def test_results_go_to_stdout_and_words_to_stderr(marey: Marey) -> None:
    ran = marey("submit", "a person waves", "--seconds", 2, "--watch").ok()
    assert len(ran.out.splitlines()) == 1
    assert "succeeded" in ran.err
    assert len(ran.out.strip()) == 36


def test_keys_are_made_limited_and_revoked(marey: Marey, elsewhere: Marey) -> None:
    made = marey("admin", "keys", "create", "reader", "--scope", "read", "--json").ok().lines[0]
    reader = replace(elsewhere, environment={**elsewhere.environment, "MAREY_KEY": made["secret"]})
    reader("jobs", "list").ok()
    reader("submit", "a person waves").refused(5, "reader", "submit")
    assert made["secret"] not in marey("admin", "keys", "list").ok().out
    marey("admin", "keys", "revoke", made["id"]).ok()
    reader("jobs", "list").refused(5)
    marey("admin", "keys", "create", "x", "--scope", "everything").refused(2, "everything")


def test_a_database_and_a_store_that_are_ready_are_left_alone_and_nothing_is_lost(marey: Marey) -> None:
    marey("admin", "migrate").ok()
    report = marey("admin", "gc", "--json").ok().lines[0]
    assert report["missing"] == []


def test_models_texts_and_this_machine_can_be_looked_at(marey: Marey, offline: Marey) -> None:
    served = marey("models", "list", "--json").ok().lines
    assert served == offline("models", "list", "--json").ok().lines
    assert served[0]["random"] is True
    assert "never trained" in marey("models", "show", "hgm3").ok().out
    graph = offline("text", "parse", "a person walks and waves", "--json").ok().lines[0]
    about = ["prompt", "text", "rewrite_reason", "movements", "warnings"]
    assert list(graph) == [*about, "words", "nodes", "edges", "cut"]
    with marey.client() as client:
        parsed = client.post("/v1/texts/parse", {"prompts": ["a person walks and waves"]})
    assert parsed["items"] == [graph]
    assert all(check["state"] == "ok" for check in marey("doctor", "--json").ok().lines)


def test_the_text_service_needs_no_database_and_wants_the_secret_of_the_api(offline: Marey) -> None:
    (port,) = free_ports(1)
    own = {"MAREY_TEXT_KEY": "shared", "MAREY_PORT": str(port)}
    refused = replace(offline, environment={"MAREY_PORT": str(port)})("text", "serve")
    assert refused.code == 2
    assert "MAREY_TEXT_KEY" in refused.err
    process = replace(offline, environment=own).start("text", "serve")
    try:
        wait_for_port(port)
        with Transport(Server(f"http://127.0.0.1:{port}", "shared")) as alone:
            assert alone.post("/v1/texts/parse", {"prompts": ["a person bows"]})["items"][0]["text"] == "a person bows"
            with pytest.raises(NotFound):
                alone.get("/v1/jobs")
        with Transport(Server(f"http://127.0.0.1:{port}", "another")) as stranger, pytest.raises(Unauthenticated):
            stranger.post("/v1/texts/parse", {"prompts": ["a person bows"]})
    finally:
        process.terminate()
        process.wait(20)


def wait_for_port(port: int) -> None:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=1):
            return
        time.sleep(0.1)
    raise AssertionError(f"nothing listens on {port}")


def test_a_second_serve_says_who_runs(served: tuple[Marey, Serving]) -> None:
    marey, server = served
    with marey.client() as client:
        url = client.server.url
    for port in (0, url.rpartition(":")[2]):  # that the port is taken, too, would send one the wrong way
        marey("serve", "--port", port).refused(2, url, f"process {server.process.pid}", "MAREY_HOME")


def test_a_taken_port_is_told_before_anything_starts(marey: Marey, offline: Marey) -> None:
    with marey.client() as client:
        port = client.server.url.rpartition(":")[2]
    offline("serve", "--port", port).refused(2, f"port {port}", "--port")
    assert not offline.home.exists()


def test_the_server_file_is_for_its_owner_alone(marey: Marey) -> None:
    assert (marey.home / "server.json").stat().st_mode & 0o777 == 0o600
    assert Path(marey.home).stat().st_mode & 0o077 == 0
