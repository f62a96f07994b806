"""Watching a job through a server whose event streams carry pings alone."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from marey.api.jobs.events import PING_SECONDS
from marey.cli.watching import watch_job
from marey.client import Client, transport
from marey.client.transport import QUIET_SECONDS

COUNTERS = {"succeeded": 1, "failed": 0, "dead": 0, "cancelled": 0}


class Deaf:
    """A server that has lost its notifications: streams are pinged, events never come."""

    def __init__(self) -> None:
        self.looks = 0
        self.ends_after = 3
        deaf = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if self.path.endswith("/events"):
                    self._stream()
                else:
                    deaf.looks += 1
                    self._answer()

            def _answer(self) -> None:
                ended = deaf.looks >= deaf.ends_after
                job = {"id": "j", "name": None, "state": "succeeded" if ended else "running", "total": 1}
                content = json.dumps({**job, "counters": COUNTERS}).encode()
                self.send_response(200)
                self.send_header("Content-Length", str(len(content)))
                self.end_headers()
                self.wfile.write(content)

            def _stream(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/event-stream")
                self.end_headers()
                self.wfile.write(b'event: progress\nid: 1\ndata: {"seq": 1, "kind": "progress", "data": ')
                self.wfile.write(json.dumps({"state": "running", "counters": COUNTERS}).encode() + b"}\n\n")
                try:
                    for _ in range(2000):
                        time.sleep(0.01)
                        self.wfile.write(b": ping\n\n")
                except OSError:
                    return

            def log_message(self, *_: object) -> None:
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        threading.Thread(target=self.server.serve_forever, daemon=True).start()


@pytest.fixture
def deaf(monkeypatch: pytest.MonkeyPatch) -> Iterator[Deaf]:
    monkeypatch.setattr(transport, "QUIET_SECONDS", 0.1)
    deaf = Deaf()
    yield deaf
    deaf.server.shutdown()
    deaf.server.server_close()


def test_a_watcher_whose_stream_carries_pings_alone_looks_at_the_job_itself(deaf: Deaf) -> None:
    with Client(f"http://127.0.0.1:{deaf.server.server_port}", "key") as client:
        began = time.monotonic()
        assert watch_job(client, "j", quiet=True).state == "succeeded"
    assert time.monotonic() - began < 15
    assert deaf.looks == deaf.ends_after


def test_the_first_ping_of_a_quiet_stream_makes_the_watcher_look() -> None:
    assert QUIET_SECONDS < PING_SECONDS
