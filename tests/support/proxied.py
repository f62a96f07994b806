"""The behaviour of a client that reaches its server through a proxy."""

from __future__ import annotations

import threading
import time
from pathlib import Path

from marey.client.downloads import download_all
from marey.client.file_to_fetch import FileToFetch
from marey.client.server_address import Server
from marey.client.stream_socket import Link
from marey.client.transport import Transport
from marey.core.hashing import sha256_of
from tests.support.live_api import LiveApi
from tests.support.live_streams import Hand

CONTENT = bytes(range(256)) * 1000


def submit_watch_and_fetch(url: str, api: LiveApi, folder: Path) -> list[float]:
    """Submit a job, follow its events while it is worked on, and fetch a file; times at which events came."""
    with Transport(Server(url, api.key)) as client:
        job = client.submit([{"prompt": "a person walks"}, {"prompt": "a person waves"}])
        hands = threading.Timer(1.0, api.work, args=(CONTENT,), kwargs={"batch": 1, "pause": 0.5})
        hands.start()
        times = [time.monotonic() for _ in client.events(job["id"])]
        hands.join()
        assert client.get(f"/v1/jobs/{job['id']}")["state"] == "succeeded"
        motion = next(client.pages(f"/v1/jobs/{job['id']}/motions"))
        file = next(file for file in motion["files"] if file["format"] == "npz")
        path = folder / "fetched.npz"
        target = FileToFetch(f"/v1/motions/{motion['id']}/files/npz", file["sha256"], file["size"], path)
        download_all(client, [target], overwrite=False, done=lambda _: None)
        assert sha256_of(path) == file["sha256"]
    return times


def watch_a_stream(url: str, api: LiveApi, hand: Hand) -> None:
    """Open the socket of a live stream, see frames, and send a message."""
    shown = hand.show(3)
    seen: list[bytes] = []
    with Link(Server(url, api.key), str(hand.stream)) as link:
        deadline = time.monotonic() + 30
        while len(seen) < 3:
            assert time.monotonic() < deadline
            seen += [message for message in link.receive(0.1) if isinstance(message, bytes)]
        assert link.send({"kind": "steer", "prompt": "a person waves"})
        while not (received := hand.received()):
            assert time.monotonic() < deadline
            time.sleep(0.05)
    assert seen == shown
    assert received


def receive_until_refused(link: Link) -> None:
    """Receive until the link raises."""
    while True:
        link.receive(0.05)
