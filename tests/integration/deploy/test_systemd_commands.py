"""The units of `deploy/systemd` as processes: their commands, variables, credentials, notifications and stop signal.

On Debian's Postgres and Redis where they are installed, the oldest that Marey runs on.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import pytest
from cryptography.fernet import Fernet

from marey.embedded import EmbeddedServer
from marey.registry import model_names
from tests.servers.debian import INSTALLED, debian_postgres, debian_redis
from tests.servers.ports import free_ports
from tests.support.marey import REPOSITORY, Marey
from tests.support.units import INSTANCES, Unit, read_unit

pytestmark = pytest.mark.slow

BIN = Path(sys.executable).parent
READY_SECONDS = 180.0
LASTING = (
    "marey-api.service",
    "marey-scheduler.service",
    "marey-text.service",
    *INSTANCES,
)


class Running:
    """One unit as a process."""

    def __init__(self, unit: Unit, folder: Path, changes: dict[str, str], places: dict[str, str]) -> None:
        self.unit = unit
        self.log = folder / f"{unit.name}.log"
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("MAREY_", "OTEL_"))}
        own = {**unit.environment(folder / "secrets"), **changes}
        self.environment = {**kept, **{name: _placed(value, places) for name, value in own.items()}}
        self.manager = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.manager.bind(str(folder / f"{unit.name}.sock"))
        self.manager.settimeout(READY_SECONDS)
        if unit.one("Type") == "notify":
            seconds = float(unit.one("WatchdogSec") or 0)
            self.environment |= {
                "NOTIFY_SOCKET": str(folder / f"{unit.name}.sock"),
                "WATCHDOG_USEC": str(int(seconds * 1e6) // 60),  # as if it were a second
            }
        self._command = [str(BIN / "marey"), *(_placed(argument, places) for argument in unit.command)]
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it, and wait as long as systemd would."""
        with self.log.open("ab") as output:
            self.process = subprocess.Popen(
                self._command,
                env=self.environment,
                cwd=self.environment["MAREY_HOME"],
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                start_new_session=True,
            )
        if self.unit.one("Type") == "notify":
            assert self.manager.recv(100) == b"READY=1", self.log.read_text()
        if self.unit.one("Type") == "oneshot":
            assert self.process.wait(READY_SECONDS) == 0, self.log.read_text()

    def stop(self) -> int | None:
        """Stop it as systemd does; None = it had to be killed."""
        assert self.process is not None
        assert self.process.poll() is None, self.log.read_text()
        self.process.send_signal(signal.SIGTERM)
        try:
            return self.process.wait(float(self.unit.one("TimeoutStopSec") or 90))
        except subprocess.TimeoutExpired:
            return None

    def kill(self) -> None:
        """Whatever is left of it."""
        self.manager.close()
        if self.process is not None and self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()


@dataclass(frozen=True)
class Machine:
    """All units, and a client."""

    units: dict[str, Running]
    client: Marey


@pytest.fixture(scope="module")
def machine(valkey: EmbeddedServer, module_database_url: str, short_folder: Path) -> Iterator[Machine]:
    folder = short_folder
    (folder / "home").mkdir(mode=0o700)
    (port,) = free_ports(1)
    places = {
        "/opt/marey/models": str(REPOSITORY / "models"),
        "/var/lib/marey": str(folder / "home"),
        "/run/marey-text": str(folder),
    }
    with ExitStack() as stack:
        database = stack.enter_context(debian_postgres()) if INSTALLED else module_database_url
        queue = stack.enter_context(debian_redis()) if INSTALLED else valkey.url
        secrets = {"database_url": database, "queue_url": queue, "text_key": "t" * 48}
        secrets["webhook_key"] = Fernet.generate_key().decode()
        (folder / "secrets").mkdir()
        for name, value in secrets.items():
            (folder / "secrets" / name).write_text(value)
        changes = {"MAREY_PORT": str(port), "MAREY_THREADS": "1", "OMP_NUM_THREADS": "1"}
        units = {
            name: Running(read_unit(name), folder, changes, places) for name in ("marey-migrate.service", *LASTING)
        }
        for running in units.values():
            stack.callback(running.kill)
        for running in units.values():
            running.start()
        key = subprocess.run(
            [BIN / "marey", "admin", "keys", "create", "studio", "--scope", "submit", "--scope", "read"],
            env=units["marey-api.service"].environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout.split()[-1]
        server = {"MAREY_SERVER": f"http://127.0.0.1:{port}", "MAREY_KEY": key}
        yield Machine(units, Marey(folder / "elsewhere", folder / "none", server))


@pytest.fixture(scope="module")
def short_folder(servers_home: Path) -> Path:
    """A folder with a path short enough for sockets."""
    folder = servers_home / "units"
    folder.mkdir()
    return folder


def test_prompts_become_motions_of_every_model(machine: Machine, tmp_path: Path) -> None:
    for model in model_names():
        out = tmp_path / model
        machine.client("submit", "a person walks", "--model", model, "--seconds", 2, "--fetch", out, timeout=300).ok()
        assert {path.suffix for path in out.iterdir()} >= {".bvh", ".npz"}


def test_a_live_stream_is_shown(machine: Machine, tmp_path: Path) -> None:
    path = tmp_path / "live.bvh"
    machine.client("stream", "a person walks", "--seconds", 2, "-o", path, timeout=120).ok()
    assert path.read_text().startswith("HIERARCHY")


def test_a_process_that_hangs_feeds_its_watchdog_no_more(machine: Machine) -> None:
    for name in ("marey-api.service", "marey-text.service"):
        running = machine.units[name]
        assert running.process is not None
        assert running.manager.recv(100) == b"WATCHDOG=1"
        running.process.send_signal(signal.SIGSTOP)
        try:
            running.manager.settimeout(3)
            with pytest.raises(TimeoutError):
                _drain(running.manager)
        finally:
            running.process.send_signal(signal.SIGCONT)
            running.manager.settimeout(READY_SECONDS)
        assert running.manager.recv(100) == b"WATCHDOG=1"


def test_everything_ends_well_within_its_time(machine: Machine) -> None:
    lasting = {name: running for name, running in machine.units.items() if name in LASTING}
    with ThreadPoolExecutor(len(lasting)) as pool:
        codes = dict(zip(lasting, pool.map(Running.stop, lasting.values()), strict=True))
    assert codes == dict.fromkeys(lasting, 0)


def _drain(manager: socket.socket) -> None:
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        manager.recv(100)


def _placed(text: str, places: dict[str, str]) -> str:
    for there, here in places.items():
        text = text.replace(there, here)
    return text
