"""The notification protocol of systemd: readiness and watchdog messages of a service.

`Type=notify` and `WatchdogSec=` of a unit set `NOTIFY_SOCKET` and `WATCHDOG_USEC`; without them nothing is sent.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import AsyncGenerator

READY = "READY=1"
STOPPING = "STOPPING=1"
ALIVE = "WATCHDOG=1"


def notify(message: str) -> bool:
    """Send a message to the service manager; return False where none listens."""
    address = os.environ.get("NOTIFY_SOCKET", "")
    if not address.startswith(("/", "@")):
        return False
    if address.startswith("@"):
        address = "\0" + address[1:]
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC) as client:
            client.settimeout(1.0)
            client.sendto(message.encode(), address)
    except OSError:
        return False
    return True


def watchdog_seconds() -> float | None:
    """Return the seconds of silence after which the manager ends this process; None = never."""
    given = os.environ.get("WATCHDOG_USEC", "")
    for_us = os.environ.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
    return int(given) / 1e6 if given.isdecimal() and int(given) > 0 and for_us else None


@contextlib.asynccontextmanager
async def notified() -> AsyncGenerator[None]:
    """Notify the manager that this event loop is ready, and then that it is alive, until the end of the block."""
    notify(READY)
    seconds = watchdog_seconds()
    task = None if seconds is None else asyncio.create_task(_feed(seconds / 3), name="watchdog")
    try:
        yield
    finally:
        notify(STOPPING)
        if task is not None:
            task.cancel()


async def _feed(seconds: float) -> None:
    while True:
        notify(ALIVE)
        await asyncio.sleep(seconds)
