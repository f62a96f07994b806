"""Ports for private servers."""

from __future__ import annotations

import secrets
import socket
from contextlib import suppress
from pathlib import Path

_LEAST = 15_000
"""Ports below are those of known services."""
_RANGE = Path("/proc/sys/net/ipv4/ip_local_port_range")


def free_ports(count: int) -> list[int]:
    """So many ports of loopback that are free now, below those that the system gives to outgoing connections: one of
    these may be taken again before a server listens."""
    most = int(_RANGE.read_text().split()[0]) if _RANGE.exists() else 32_768
    if most <= _LEAST + 1000:
        most = 65_536
    sockets = list[socket.socket]()
    while len(sockets) < count:
        with suppress(OSError):
            sockets.append(socket.create_server(("127.0.0.1", _LEAST + secrets.randbelow(most - _LEAST))))
    ports = [opened.getsockname()[1] for opened in sockets]
    for opened in sockets:
        opened.close()
    return ports
