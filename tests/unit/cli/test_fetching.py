"""Fetching from a server that names and sends what it should not."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from marey.client.downloads import ATTEMPTS, BLOCK, download_all
from marey.client.fetching import FetchObserver, fetch_job, plan
from marey.client.file_to_fetch import FileToFetch
from marey.client.folder_lock import alone_in
from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.errors import InvalidFile, InvalidInput

ITEM: dict[str, Any] = {
    "id": "i",
    "index": 0,
    "name": "a",
    "prompt": "a person walks",
    "seed": 1,
    "variant": 0,
    "model": "hgm3",
    "bundle": "b",
    "job": "j",
    "tags": [],
}


@pytest.mark.parametrize("ending", ["x/../../evil", "../evil", "bvh\x1b[31m", "", "npz/", "NPZ\n", "n.z", "a" * 17])
def test_a_format_that_a_server_names_leads_out_of_no_folder(tmp_path: Path, ending: str) -> None:
    file = {"format": ending, "sha256": "0" * 64, "size": 1}
    with pytest.raises(InvalidFile, match="file format"):
        plan([{**ITEM, "motion": {"id": "m", "files": [file]}}], tmp_path, None)


class Endless(BaseHTTPRequestHandler):
    """Sends more and more, until the client stops reading."""

    sent = 0

    def do_GET(self) -> None:
        self.send_response(200)
        self.end_headers()
        try:
            for _ in range(400):
                self.wfile.write(bytes(BLOCK))
                type(self).sent += BLOCK
        except OSError:
            pass

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def endless() -> Iterator[str]:
    with ThreadingHTTPServer(("127.0.0.1", 0), Endless) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def test_no_more_is_read_than_the_size_that_was_told(tmp_path: Path, endless: str) -> None:
    wanted = FileToFetch("/file", "0" * 64, 1000, tmp_path / "a.npz")
    with Transport(Server(endless, "key")) as client, pytest.raises(InvalidFile, match="another sha256"):
        download_all(client, [wanted], overwrite=False, done=lambda _: None)
    assert list(tmp_path.iterdir()) == []
    assert Endless.sent < ATTEMPTS * 100 * BLOCK


class Empty(BaseHTTPRequestHandler):
    """Answers every listing with no items."""

    def do_GET(self) -> None:
        body = b'{"items": [], "next": null}'
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        pass


def test_a_format_that_is_not_known_is_refused_before_there_is_a_motion(tmp_path: Path) -> None:
    with ThreadingHTTPServer(("127.0.0.1", 0), Empty) as http:
        threading.Thread(target=http.serve_forever, args=(0.05,), daemon=True).start()
        with Transport(Server(f"http://127.0.0.1:{http.server_port}", "key")) as transport:
            with pytest.raises(InvalidInput, match="'wav' is not a known motion format"):
                fetch_job(transport, "j", tmp_path / "out", ["npz", "wav"])
            assert not (tmp_path / "out").exists()
            assert fetch_job(transport, "j", tmp_path / "out", ["npz", "glb"]) == []
        http.shutdown()


def test_a_fetch_waits_for_another_one_into_the_folder(tmp_path: Path) -> None:
    waits = threading.Event()

    class Observer(FetchObserver):
        def waiting(self, folder: Path) -> None:
            assert folder == tmp_path
            waits.set()

    http = ThreadingHTTPServer(("127.0.0.1", 0), Empty)
    threading.Thread(target=http.serve_forever, args=(0.05,), daemon=True).start()
    with Transport(Server(f"http://127.0.0.1:{http.server_port}", "key")) as transport:
        second = threading.Thread(target=fetch_job, args=(transport, "j", tmp_path), kwargs={"observer": Observer()})
        with alone_in(tmp_path):
            second.start()
            assert waits.wait(20)
            second.join(0.2)
            assert second.is_alive()
            assert list(tmp_path.iterdir()) == []
        second.join(20)
    http.shutdown()
    http.server_close()
    assert [path.name for path in tmp_path.iterdir()] == ["manifest.csv"]
