"""HTTP connections to an object store with a deadline for each read and write; silent connections are not reused.

A deadline applies to one operation on the socket, never to a whole object: a slow but steady transfer may take any
time.
"""

# pyright: reportAttributeAccessIssue=false, reportUnknownMemberType=false, reportUnknownVariableType=false
# pyright: reportUnknownArgumentType=false
from __future__ import annotations

import math
import socket
import ssl
import time
from collections.abc import Iterable
from typing import Any

import urllib3
from urllib3.connection import HTTPConnection, HTTPSConnection

# The SDK's own pool waits 300 s and retries 5 times; a worker must know within seconds and release its lease.
CONNECT_SECONDS = 3.0
"""Deadline of a connect, and of each write."""
READ_SECONDS = 6.0
"""Deadline of each read; the first one includes the time until the store has written an object to its disks."""
RETRIES = 2
CONNECTIONS = 16
WRITE_BYTES = 1 << 16
"""Bytes per write: Python's `sendall` has one deadline for all its data."""
UNSENT_BYTES = 1 << 17
"""Bytes that the kernel buffers for sending. Megabytes, the default, would drain while the deadline of the answer
already runs."""


class Silence:
    """Time of the last missed deadline; connections opened earlier are not reused.

    Connections fall silent together (a proxy or a firewall drops all flows of a host). Found one by one, each would
    cost its next user a deadline.
    """

    def __init__(self) -> None:
        self.last = -math.inf

    def note(self, error: BaseException | None) -> None:
        """Record an error, if it is a missed deadline."""
        while error is not None:
            if isinstance(error, TimeoutError | urllib3.exceptions.TimeoutError):
                self.last = time.monotonic()
                return
            error = error.__cause__ or error.__context__


def open_pool(silence: Silence, trust: ssl.SSLContext | None) -> urllib3.PoolManager:
    """Create the connections of one client.

    Args:
        silence: shared by all clients of one store.
        trust: TLS context for https; None = the default of urllib3.
    """
    manager = urllib3.PoolManager(
        maxsize=CONNECTIONS,
        ssl_context=trust,
        timeout=urllib3.Timeout(connect=CONNECT_SECONDS, read=READ_SECONDS),
        retries=_retries(silence),
        socket_options=_socket_options(),
    )
    manager.pool_classes_by_scheme = _pools(silence)
    return manager


def _pools(silence: Silence) -> dict[str, type[urllib3.HTTPConnectionPool]]:
    """Return classes of pools by scheme; urllib3 takes classes, so each `silence` has its own."""

    class Deadlines:
        """Mixin for urllib3's connections."""

        opened = -math.inf
        sock: socket.socket | None

        def connect(self) -> None:
            super().connect()
            self.opened = time.monotonic()

        @property
        def is_connected(self) -> bool:
            """Return False for a stale connection; urllib3's pool asks before reuse."""
            return super().is_connected and self.opened > silence.last

        def send(self, data: Any) -> None:
            """Send in pieces, each with a deadline of its own."""
            pieces: Iterable[Any] = (data,)
            if isinstance(data, bytes | bytearray | memoryview):
                view = memoryview(data)
                pieces = (view[first : first + WRITE_BYTES] for first in range(0, len(view), WRITE_BYTES))
            for piece in pieces:
                super().send(piece)

    class Connection(Deadlines, HTTPConnection):
        pass

    class TlsConnection(Deadlines, HTTPSConnection):
        pass

    class Pool(urllib3.HTTPConnectionPool):
        ConnectionCls = Connection  # pyright: ignore[reportAssignmentType]

    class TlsPool(urllib3.HTTPSConnectionPool):
        ConnectionCls = TlsConnection  # pyright: ignore[reportAssignmentType]

    return {"http": Pool, "https": TlsPool}


def _retries(silence: Silence) -> urllib3.Retry:
    """Return the retries of a request, which record each missed deadline."""

    class Retries(urllib3.Retry):
        def increment(self, *args: Any, **options: Any) -> urllib3.Retry:
            silence.note(options.get("error"))
            return super().increment(*args, **options)

    return Retries(total=RETRIES, backoff_factor=0.2, status_forcelist=(500, 502, 503, 504))


def _socket_options() -> list[tuple[int, int, int]]:
    option = getattr(socket, "TCP_NOTSENT_LOWAT", None)  # only Linux and macOS have it
    little_unsent = [] if option is None else [(socket.IPPROTO_TCP, option, UNSENT_BYTES)]
    return [(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1), *little_unsent]
