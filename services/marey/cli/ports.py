"""Checks of the ports of servers."""

from __future__ import annotations

import socket

from marey.core.errors import Conflict

HINT = "Choose another with --port (0 = any) or MAREY_PORT."


def try_port(host: str, port: int) -> int:
    """Return the port if it is free now, or any free port for 0.

    Raises:
        Conflict: another process listens there, or this machine has no such address.
    """
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except (OSError, UnicodeError) as error:  # a name that no resolver would take
            reason = error.strerror if isinstance(error, OSError) else "it is no name of a host"
            raise Conflict(f"port {port} of {host} cannot be used: {reason}", hint=HINT) from error
        return probe.getsockname()[1]
