"""Starts the Swift of `swift_server.py` as a child, and can take it away and bring it back."""

from __future__ import annotations

import itertools
import socket
import subprocess
import sys
from pathlib import Path

from shared.storage.s3 import S3Options, S3Store

ACCESS_KEY = "test:tester"
SECRET_KEY = "testing"


class Swift:
    """A real S3 server with its data in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._ports = _free_ports(4)
        self._buckets = itertools.count()
        self._process: subprocess.Popen[str] | None = None

    @property
    def endpoint(self) -> str:
        """Host and port of the S3 API."""
        return f"127.0.0.1:{self._ports[3]}"

    def start(self) -> None:
        """Start, on the same ports and data each time."""
        log = (self.folder / "swift.log").open("a")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.servers.swift_server", str(self.folder), *map(str, self._ports)],
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            cwd=Path(__file__).resolve().parents[2],
        )
        log.close()
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if line != "ready\n":
            raise RuntimeError(f"Swift did not start:\n{(self.folder / 'swift.log').read_text()[-4000:]}")

    def stop(self) -> None:
        """Take it away, as an outage would."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            assert self._process.stdout is not None
            self._process.stdout.close()
            self._process = None

    def options(self, bucket: str, **changes: object) -> S3Options:
        """How to reach a bucket of it."""
        values: dict[str, object] = {
            "endpoint": self.endpoint,
            "bucket": bucket,
            "access_key": ACCESS_KEY,
            "secret_key": SECRET_KEY,
        }
        return S3Options(**(values | changes))  # pyright: ignore[reportArgumentType]

    def new_store(self) -> S3Store:
        """A store on a new, empty bucket."""
        store = S3Store(self.options(f"marey-{next(self._buckets)}"))
        store.prepare()
        return store


def _free_ports(count: int) -> list[int]:
    sockets = [socket.create_server(("127.0.0.1", 0)) for _ in range(count)]
    ports = [opened.getsockname()[1] for opened in sockets]
    for opened in sockets:
        opened.close()
    return ports
