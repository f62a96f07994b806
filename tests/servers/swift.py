"""Starts the Swift of `swift_server.py` as a child, and can take it away and bring it back."""

from __future__ import annotations

import hashlib
import http.client
import itertools
import subprocess
import sys
import time
from pathlib import Path

from marey.storage.s3 import S3Options, S3Store
from tests.servers.ports import free_ports

ACCOUNT = "AUTH_test"
HASH_PREFIX = HASH_SUFFIX = "marey"
PART_POWER = 4
"""As `swift_server.py` sets them; importing Swift here would bring eventlet into the tests."""
ACCESS_KEY = "test:tester"
SECRET_KEY = "testing"


class Swift:
    """A real S3 server with its data in `folder`."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._ports = free_ports(4)
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

    def limit(self, bucket: str, room: int | None) -> None:
        """Let a bucket take so many bytes more: what is PUT beyond them is refused. None = as many as the disk holds.

        Asked of the container server itself, as the S3 API has no such request; the limit outlives a restart.
        """
        quota = "" if room is None else str(int(self._container("HEAD", bucket)["x-container-bytes-used"]) + room)
        self._container("POST", bucket, **{"x-container-meta-quota-bytes": quota})

    def _container(self, method: str, bucket: str, **headers: str) -> dict[str, str]:
        path = f"/{ACCOUNT}/{bucket}"
        digest = hashlib.md5(f"{HASH_PREFIX}{path}{HASH_SUFFIX}".encode()).digest()
        partition = int.from_bytes(digest[:4], "big") >> (32 - PART_POWER)  # where the ring puts it
        connection = http.client.HTTPConnection("127.0.0.1", self._ports[1], timeout=30)
        try:
            connection.request(
                method, f"/d1/{partition}{path}", headers={"x-timestamp": f"{time.time():016.05f}", **headers}
            )
            answer = connection.getresponse()
            if answer.status // 100 != 2:
                raise RuntimeError(f"the container server answers {answer.status} {answer.reason}")
            return {name.lower(): value for name, value in answer.getheaders()}
        finally:
            connection.close()

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
