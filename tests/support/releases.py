"""Earlier releases beside this one: their wheels, each in an environment of its own, on the same database, queue and
store."""

from __future__ import annotations

import contextlib
import io
import subprocess
import tarfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import httpx2
import pytest

from tests.support.marey import REPOSITORY
from tests.support.wheels import Environment, build_wheel, make_environment

SECONDS = 120.0
THREADS = {"MAREY_THREADS": "1", "OMP_NUM_THREADS": "1"}


@dataclass(frozen=True)
class Release:
    """The commands of one release.

    Attributes:
        command: what `marey` is.
        environment: variables of its processes.
        folder: where they run.
    """

    command: tuple[str, ...]
    environment: Mapping[str, str]
    folder: Path

    def run(self, *arguments: str) -> str:
        """Run a command that ends by itself; what it printed."""
        done = subprocess.run(
            [*self.command, *arguments], cwd=self.folder, env=self.environment, capture_output=True, text=True,
            timeout=SECONDS, check=False,
        )  # fmt: skip
        assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
        return done.stdout

    @contextlib.contextmanager
    def running(self, log: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
        """A command that runs until the end of the block."""
        with log.open("ab") as output:
            process = subprocess.Popen(
                [*self.command, *arguments], cwd=self.folder, env=self.environment, stdout=output, stderr=output
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


def earlier_release(commit: str, folder: Path, values: Mapping[str, str]) -> Release:
    """The release of a commit, from the history; skips the test where that is not here."""
    done = subprocess.run(
        ["git", "archive", commit, ":(exclude)models", ":(exclude)docs", ":(exclude)tests"],
        cwd=REPOSITORY, capture_output=True, check=False,
    )  # fmt: skip
    if done.returncode:
        pytest.skip(f"the history ends before {commit}: {done.stderr.decode().strip()}")
    tree = folder / "tree"
    with tarfile.open(fileobj=io.BytesIO(done.stdout)) as archive:
        archive.extractall(tree, filter="data")
    made = make_environment(folder / "environment", [build_wheel(tree, folder / "wheels")], borrow=True)
    return installed_release(made, values, folder)


def installed_release(made: Environment, values: Mapping[str, str], folder: Path) -> Release:
    """The release whose wheel an environment holds."""
    return Release((made.marey,), made.environ({**THREADS, **values}), folder)


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
