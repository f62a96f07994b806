"""Services of `docker-compose.yml` as processes of this machine: the same command, variables, secrets and health check.

What a container would bring is put in its place: addresses of the network by ports of loopback, folders of the image by
folders of the checkout.
"""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from tests.support.compose import Service, image_environment
from tests.support.marey import REPOSITORY

BIN = Path(sys.executable).parent
HEALTHY_SECONDS = 180.0


@dataclass(frozen=True)
class Network:
    """Where processes find what containers find by name.

    Attributes:
        folder: of homes, logs and secrets.
        api: port of the API; the text service has the one after it.
        store: host and port of the S3 server.
    """

    folder: Path
    api: int
    store: str

    @property
    def secrets(self) -> Path:
        """Replacement of /run/secrets."""
        return self.folder / "secrets"

    def place(self, text: str) -> str:
        """A value or a command's argument with what it names here."""
        for there, here in (
            ("/run/secrets", str(self.secrets)),
            ("objectstore:8333", self.store),
            ("127.0.0.1:8333", self.store),
            ("127.0.0.1:8400", f"127.0.0.1:{self.api}"),
            ("127.0.0.1:8401", f"127.0.0.1:{self.api + 1}"),
            ("parser:8401", f"127.0.0.1:{self.api + 1}"),
            ("0.0.0.0", "127.0.0.1"),
            ("/models", str(REPOSITORY / "models")),
        ):
            text = text.replace(there, here)
        return text


class Process:
    """One service of ours."""

    def __init__(self, service: Service, network: Network) -> None:
        self.service = service
        self.network = network
        self.home = network.folder / service.name
        self.home.mkdir(mode=0o700)
        self.log = network.folder / f"{service.name}.log"
        self.metrics = free_ports(2) if "MAREY_METRICS_PORT" in service.environment else 0
        self.environment = self._environment()
        self._process: subprocess.Popen[bytes] | None = None

    def _environment(self) -> dict[str, str]:
        kept = {n: v for n, v in os.environ.items() if not n.startswith(("MAREY_", "OTEL_"))}
        given = image_environment(self.service.target) | self.service.environment
        given = {name: self.network.place(value) for name, value in given.items()}
        given["PATH"] = f"{BIN}:{kept['PATH']}"
        given["MAREY_HOME"] = str(self.home)
        given["MAREY_PORT"] = str(self.network.api + (self.service.name == "parser"))
        if self.metrics:
            given["MAREY_METRICS_PORT"] = str(self.metrics)
        if "MAREY_THREADS" in given:
            given |= {"MAREY_THREADS": "1", "OMP_NUM_THREADS": "1"}  # the machine is shared with other tests
        return {**kept, **given}

    def start(self) -> Process:
        """Start its command."""
        with self.log.open("ab") as output:
            self._process = subprocess.Popen(
                [BIN / "marey", *self.service.command],
                env=self.environment,
                cwd=self.home,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        return self

    def run(self, *arguments: str) -> str:
        """Another command beside it, as `docker compose exec`; its output."""
        done = subprocess.run(
            [BIN / "marey", *arguments], env=self.environment, cwd=self.home, capture_output=True, check=False
        )
        assert done.returncode == 0, done.stderr.decode()
        return done.stdout.decode()

    def wait(self) -> int:
        """Its exit code, once it has ended by itself."""
        assert self._process is not None
        return self._process.wait(HEALTHY_SECONDS)

    def healthy(self) -> bool:
        """Its own check, once."""
        assert self.service.check is not None
        kind, *command = self.service.check
        assert kind == "CMD"
        placed = [self.network.place(argument) for argument in command]
        done = subprocess.run(
            placed, executable=shutil.which(placed[0], path=str(BIN)), env=self.environment, cwd=self.home, check=False,
            capture_output=True, timeout=60,
        )  # fmt: skip
        return done.returncode == 0

    def wait_until_healthy(self) -> None:
        """Until its own check passes."""
        deadline = time.monotonic() + HEALTHY_SECONDS
        while not self.healthy():
            assert self._process is not None
            assert self._process.poll() is None, self.log.read_text()
            assert time.monotonic() < deadline, self.log.read_text()
            time.sleep(0.5)

    def stop(self) -> int | None:
        """Send the stop signal; the exit code, None = it would have been killed at the end of its grace period."""
        assert self._process is not None
        self._process.send_signal(signal.Signals[self.service.raw.get("stop_signal", "SIGTERM")])
        try:
            return self._process.wait(self.service.grace)
        except subprocess.TimeoutExpired:
            return None

    def kill(self) -> None:
        """Whatever is left of it."""
        if self._process is not None and self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
            self._process.wait()


def write_secrets(folder: Path, changed: Mapping[str, str]) -> None:
    """Secrets as they are drawn, but for what names a server of this test's own."""
    subprocess.run([REPOSITORY / "deploy" / "make-secrets", folder], check=True)
    for name, value in changed.items():
        (folder / name).write_text(value)


def free_ports(count: int) -> int:
    """The first of so many free ports in a row."""
    while True:
        sockets: list[socket.socket] = []
        try:
            sockets.append(socket.create_server(("127.0.0.1", 0)))
            first = sockets[0].getsockname()[1]
            sockets += [socket.create_server(("127.0.0.1", first + n)) for n in range(1, count)]
        except OSError:
            continue
        finally:
            for opened in sockets:
                opened.close()
        return first
