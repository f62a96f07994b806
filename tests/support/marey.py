"""`marey` as a person runs it: a subprocess, its exit code, and what it says."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
from websockets.sync.client import ClientConnection, connect

from marey.client.server_address import read_server
from marey.client.transport import Transport
from marey.core import defaults
from marey.registry import model_names
from tests.support.forking import forks
from tests.support.models import add_text_bundles, random_bundle

REPOSITORY = Path(__file__).resolve().parents[2]
MIGRATIONS = REPOSITORY / "migrations" / "marey" / "migrations"
COMMAND = (sys.executable, "-m", "marey.cli")
START_SECONDS = 300.0  # a bound for what hangs; a machine full of other work takes two minutes
TINY = f"{defaults.MODEL}-tiny"


@dataclass(frozen=True)
class Ran:
    """Result of a command."""

    code: int
    out: str
    err: str

    @property
    def lines(self) -> list[dict[str, Any]]:
        """stdout as JSON lines."""
        return [json.loads(line) for line in self.out.splitlines()]

    def ok(self) -> Ran:
        """Itself, if it succeeded."""
        assert self.code == 0, f"exit {self.code}\n{self.out}\n{self.err}"
        return self

    def refused(self, code: int, *said: str) -> Ran:
        """Itself, if it ended with `code`, a message that holds all of `said`, and no traceback."""
        assert self.code == code, f"exit {self.code}, not {code}\n{self.out}\n{self.err}"
        assert "Traceback" not in self.err, self.err
        for part in said:
            assert part in self.err, f"{part!r} is not in:\n{self.err}"
        return self


@dataclass(frozen=True)
class Marey:
    """The command line with a home and models of its own."""

    home: Path
    models: Path
    environment: dict[str, str] = field(default_factory=dict[str, str])

    def environ(self) -> dict[str, str]:
        """The environment of a command: nothing of the caller's own Marey settings."""
        kept = {name: value for name, value in os.environ.items() if not name.startswith("MAREY_")}
        own = {"MAREY_HOME": str(self.home), "MAREY_MODELS": str(self.models)}
        # Two threads that wait for each other on a machine full of tests are ten times slower than one.
        own |= {"MAREY_THREADS": "1", "OMP_NUM_THREADS": "1"}
        return {**kept, **own, **self.environment}

    def __call__(
        self, *arguments: object, stdin: str | bytes = b"", cwd: Path = REPOSITORY, timeout: float = 120
    ) -> Ran:
        """Run a command to its end."""
        words, content = list(map(str, arguments)), stdin.encode() if isinstance(stdin, str) else stdin
        code, out, err = forks().run(words, self.environ(), REPOSITORY, content, timeout)
        return Ran(code, out.decode(), err.decode())

    def start(self, *arguments: object) -> subprocess.Popen[bytes]:
        """Start a command and do not wait for it; what it says is thrown away."""
        return subprocess.Popen(
            [*COMMAND, *map(str, arguments)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=REPOSITORY,
            env=self.environ(),
        )

    def submit(self, *arguments: object, stdin: str = "") -> str:
        """Submit and give the job's id."""
        return self("submit", *arguments, stdin=stdin).ok().out.strip()

    def jobs(self) -> list[dict[str, Any]]:
        """Jobs on the server."""
        with self.client() as client:
            return list(client.pages("/v1/jobs", limit=1000))

    def client(self) -> Transport:
        """The HTTP client on this home's server: asking it costs no new process."""
        server = read_server(self.home)
        assert server is not None
        return Transport(server)


@dataclass(frozen=True)
class Serving:
    """A running `marey serve`."""

    process: subprocess.Popen[bytes]
    log: Path

    def children(self) -> dict[str, psutil.Process]:
        """Its children by role: `postgres`, `valkey-server`, `api`, `scheduler`, `worker`, `editor`, `live`."""
        found: dict[str, psutil.Process] = {}
        for child in psutil.Process(self.process.pid).children():
            with contextlib.suppress(psutil.Error):  # just killed, and not waited for yet
                found[_role(child)] = child
        return found

    def stop(self) -> None:
        """SIGTERM, and wait."""
        self.process.send_signal(signal.SIGTERM)
        assert self.process.wait(60) == 0, self.log.read_text()


@contextlib.contextmanager
def serving(marey: Marey, *options: str) -> Iterator[Serving]:
    """`marey serve` on any free port, ready, until the end of the block; with one worker unless `options` say more."""
    if "--with" not in options and "--workers" not in options:
        options = (*options, "--workers", "1")
    marey.home.mkdir(mode=0o700, parents=True, exist_ok=True)
    log = marey.home / "serve.log"
    with log.open("wb") as output:
        process = subprocess.Popen(
            [*COMMAND, "serve", "--port", "0", *options],
            stdout=output,
            stderr=output,
            cwd=REPOSITORY,
            env=marey.environ(),
        )
    try:
        deadline = time.monotonic() + START_SECONDS
        while "Ready." not in log.read_text():
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.1)
        yield Serving(process, log)
    finally:
        process.terminate()
        process.wait(60)


def tiny_models(folder: Path) -> Path:
    """A folder of models: a bundle of random weights of each, and what reads prompts."""
    for model in model_names():
        random_bundle(model, folder / tiny(model))
    add_text_bundles(folder)
    return folder


def tiny(model: str) -> str:
    """The name of a model's bundle in `tiny_models`."""
    return f"{model}-tiny"


def _role(process: psutil.Process) -> str:
    command = process.cmdline()
    if "marey.cli" in command:
        if "edit" in command:
            return "editor"
        return "live" if command[-2:] == ["--only", "live"] else command[command.index("marey.cli") + 1]
    return process.name()


def socket_of(marey: Marey, stream: str) -> ClientConnection:
    """An open socket on a stream of the server that runs in this home."""
    server = read_server(marey.home)
    assert server is not None
    url = f"{server.url.replace('http', 'ws', 1)}/v1/streams/{stream}"
    headers = {"Authorization": f"Bearer {server.key}"}
    return connect(url, additional_headers=headers, open_timeout=START_SECONDS)
