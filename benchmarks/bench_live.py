"""A live stream end to end: from `POST /v1/streams` to the first frame on a socket, and from a kill -9 of the worker
that shows it to the next frame, by another.

A real `marey serve` on a home of its own with the first model that streams, of random weights at the size of `starter`,
a second live worker beside it, and a client on
the same machine. Both workers have loaded their bundles before anything is measured.
"""

from __future__ import annotations

import itertools
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import sqlalchemy as sa
from websockets.sync.client import ClientConnection

from marey.client.transport import Transport
from marey.db import create_engine
from marey.registry import streaming_models
from marey.streams import tables
from marey.streams.frames import Frame, decode_frame
from tests.support.marey import REPOSITORY, Marey, Serving, serving, socket_of
from tests.support.models import add_text_bundles, random_bundle

STREAMS = 20
KILLS = 5
WARM_SECONDS = 20.0
"""Seconds that a live worker takes to load on a slow machine."""
PATIENCE = 120.0
PROMPT = {"prompt": "a person walks forward"}


def main() -> None:
    """Print both, or say that there is nothing to measure."""
    if not streaming_models():
        print("No installed model streams: nothing is measured.\n")
        return
    model = streaming_models()[0]
    with tempfile.TemporaryDirectory(prefix="marey-", ignore_cleanup_errors=True) as folder:
        models = Path(folder) / "models"
        random_bundle(model, models / "random-starter", config="starter")
        add_text_bundles(models)
        marey = Marey(Path(folder) / "home", models)
        with serving(marey) as server, marey.client() as client:
            _first_frame(marey, client)
            waits = sorted(_first_frame(marey, client) for _ in range(STREAMS))
            gaps = [_gap_of_a_kill(model, marey, client, server) for _ in range(KILLS)]
    low, middle, high = (waits[int(share * (STREAMS - 1))] * 1e3 for share in (0, 0.5, 1))
    print(f"First frame after POST, {STREAMS} streams: median {middle:.0f} ms, {low:.0f} to {high:.0f} (goal 250 ms)\n")
    spread = ", ".join(f"{gap:.2f}" for gap in gaps)
    print(f"Without a frame after a kill -9: median {statistics.median(gaps):.2f} s of {spread} (goal 3 s)\n")


def _first_frame(marey: Marey, client: Transport) -> float:
    began = time.perf_counter()
    stream = client.post_once("/v1/streams", PROMPT)
    with socket_of(marey, stream["id"]) as socket:
        _next(socket)
        took = time.perf_counter() - began
        _stop(socket)
    return took


def _gap_of_a_kill(model: str, marey: Marey, client: Transport, server: Serving) -> float:
    """Seconds between the last frame of the worker that is killed and the first of the other."""
    environment = server.children()["live"].environ()
    with _second_worker(model, environment):
        time.sleep(WARM_SECONDS)
        stream = client.post_once("/v1/streams", PROMPT)
        with socket_of(marey, stream["id"]) as socket:
            for _ in range(60):
                _next(socket)
            os.kill(_holder(environment["MAREY_DATABASE_URL"], stream["id"]), signal.SIGKILL)
            times = [time.perf_counter()]
            while times[-1] - times[0] < 5.0:
                _next(socket)
                times.append(time.perf_counter())
            _stop(socket)
    return max(later - earlier for earlier, later in itertools.pairwise(times))


@contextmanager
def _second_worker(model: str, environment: dict[str, str]) -> Iterator[None]:
    command = [sys.executable, "-m", "marey.cli", "worker", model, "--only", "live"]
    process = subprocess.Popen(
        command, cwd=REPOSITORY, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    try:
        yield
    finally:
        process.kill()
        process.wait()


def _holder(database_url: str, stream: str) -> int:
    """Process that serves a stream."""
    engine = create_engine(database_url)
    with engine.connect() as conn:
        name = conn.scalar(sa.select(tables.stream.c.worker).where(tables.stream.c.id == stream))
    engine.dispose()
    return int(str(name).rpartition("-")[2])


def _next(socket: ClientConnection) -> Frame:
    while True:
        message = socket.recv(timeout=PATIENCE)
        if isinstance(message, bytes):
            return decode_frame(message)
        assert json.loads(message)["type"] == "stream", message


def _stop(socket: ClientConnection) -> None:
    socket.send(json.dumps({"kind": "stop"}))
    while not _next(socket).last:
        pass


if __name__ == "__main__":
    main()
