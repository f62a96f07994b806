"""The real processes of the platform on a home of their own, with a model that does nothing: API, scheduler, workers,
Postgres and Valkey."""

from __future__ import annotations

import shutil
import sys
import tempfile
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import psutil

from marey.client.server_address import Server
from marey.client.transport import Transport
from marey.core.settings import Settings
from marey.db import transaction
from marey.tenants import create_key
from tests.chaos.driver import Cluster
from tests.servers.ports import free_ports
from tests.support.live_api import write_bundle
from tests.support.toy import QUEUE, REFERENCE, TEXT_REFERENCE

BUNDLE = "toy-nothing"
WORKER_QUEUES = f"{QUEUE},text"
WORKER_HANDLERS = f"{REFERENCE},{TEXT_REFERENCE}"


class Platform(Cluster):
    """A cluster that also has an API, a key and a bundle whose queue the toy workers serve."""

    def __init__(self, home: Path, environment: Mapping[str, str]) -> None:
        models = home / "models"
        (self.port,) = free_ports(1)
        self.environment = {
            "MAREY_MODELS": str(models),
            "MAREY_STORE": str(home / "assets"),
            "MAREY_LOG_LEVEL": "WARNING",
            "MAREY_PORT": str(self.port),
            **environment,
        }
        super().__init__(home, self.environment)
        write_bundle(models, BUNDLE, QUEUE)
        with transaction(self.engine) as conn:
            self.key = create_key(conn, "benchmark", ["admin"]).secret
        self.url = f"http://127.0.0.1:{self.port}"

    def serve(self) -> psutil.Process:
        """Start the API and wait until it answers."""
        self.start_api()
        self.wait(self._answers, "the API answers")
        return self.process("api")

    def start_toys(self, name: str) -> None:
        """Start a worker that serves texts and the model that does nothing."""
        self.start_worker(name, queue=WORKER_QUEUES, reference=WORKER_HANDLERS)

    def command_environment(self) -> dict[str, str]:
        """The environment of a command that talks to this platform."""
        return {**self._environment, "MAREY_SERVER": self.url, "MAREY_KEY": self.key}

    def settings(self) -> Settings:
        """The settings of its processes."""
        return Settings.model_validate(
            {
                "home": self.home,
                "models": self.home / "models",
                "store": str(self.home / "assets"),
                "database_url": self.postgres.url,
                "queue_url": self.valkey.url,
            }
        )

    def client(self) -> Transport:
        """The command line's client."""
        return Transport(Server(self.url, self.key))

    def process(self, name: str) -> psutil.Process:
        """A process of it by name."""
        return psutil.Process(self.processes[name].pid)

    def _answers(self) -> bool:
        try:
            with urllib.request.urlopen(f"{self.url}/livez", timeout=2) as response:
                return response.status == 200
        except (urllib.error.URLError, OSError):
            return False


@contextmanager
def platform(**environment: str) -> Iterator[Platform]:
    """A platform with nothing started but Postgres and Valkey; everything is removed after the block."""
    home = Path(tempfile.mkdtemp(prefix="marey-"))
    try:
        made = Platform(home, environment)
        with made:
            yield made
    finally:
        shutil.rmtree(home, ignore_errors=True)


def marey(*arguments: str) -> list[str]:
    """The command line of `marey`."""
    return [sys.executable, "-m", "marey.cli", *arguments]


def processor_seconds(process: psutil.Process) -> float:
    """Processor time used by a process, kernel time included."""
    times = process.cpu_times()
    return times.user + times.system


def peak_megabytes(process: int) -> float:
    """Peak resident memory of a process (VmHWM), MB."""
    for line in Path(f"/proc/{process}/status").read_text(encoding="ascii").splitlines():
        if line.startswith("VmHWM:"):
            return int(line.split()[1]) / 1024
    return 0.0  # it has just ended


def forget_peak(process: int) -> None:
    """Let `peak_megabytes` count from here."""
    Path(f"/proc/{process}/clear_refs").write_text("5", encoding="ascii")
