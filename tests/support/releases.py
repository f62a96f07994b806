"""The previous release's own code beside this one's: commands of either, on the same database, queue and store."""

from __future__ import annotations

import contextlib
import io
import os
import subprocess
import sys
import tarfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx2
import pytest

from tests.support.marey import REPOSITORY

PREVIOUS = "03315bd6"
"""The commit of the previous release."""
COMMAND = (sys.executable, "-m", "services.cli")
SECONDS = 120.0


def previous_release(folder: Path) -> Path:
    """The tree of the previous release, from the history; skips the test where that is not here."""
    done = subprocess.run(
        ["git", "archive", PREVIOUS, "shared", "services", "workers", "migrations"],
        cwd=REPOSITORY, capture_output=True, check=False,
    )  # fmt: skip
    if done.returncode:
        pytest.skip(f"the history ends before {PREVIOUS}: {done.stderr.decode().strip()}")
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(folder, filter="data")
    return folder


@dataclass(frozen=True)
class Release:
    """Commands of one tree of the code."""

    tree: Path
    environment: dict[str, str]

    def environ(self) -> dict[str, str]:
        """Of a command: nothing of the caller's own settings."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith("MAREY_")}
        return {**kept, "MAREY_THREADS": "1", "OMP_NUM_THREADS": "1", **self.environment}

    def python(self, code: str) -> str:
        """Run a piece of code on its tree; what it printed."""
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=self.tree, env=self.environ(), capture_output=True, text=True,
            timeout=SECONDS, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
        return done.stdout

    @contextlib.contextmanager
    def running(self, log: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
        """A command that runs until the end of the block."""
        with log.open("ab") as output:
            process = subprocess.Popen(
                [*COMMAND, *arguments], cwd=self.tree, env=self.environ(), stdout=output, stderr=output
            )
        try:
            yield process
            assert process.poll() is None, log.read_text()
        finally:
            process.terminate()
            process.wait(60)

    @contextlib.contextmanager
    def api(self, log: Path, key: str) -> Iterator[httpx2.Client]:
        """Its API, ready, and a client of it."""
        url = f"http://127.0.0.1:{self.environment['MAREY_PORT']}"
        with self.running(log, "api"), httpx2.Client(base_url=url, timeout=20) as client:
            client.headers["Authorization"] = f"Bearer {key}"
            wait_until(lambda: _answers(client), log)
            yield client


def wait_until(ready: Callable[[], object], log: Path) -> None:
    """Until `ready()` is true; the log is shown if it does not become so."""
    deadline = time.monotonic() + SECONDS
    while not ready():
        assert time.monotonic() < deadline, log.read_text()
        time.sleep(0.2)


def _answers(client: httpx2.Client) -> bool:
    try:
        return client.get("/livez").status_code == 200
    except httpx2.TransportError:
        return False
