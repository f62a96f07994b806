"""Notifications of a service to systemd, by a socket of the test's own."""

from __future__ import annotations

import asyncio
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from marey.runtime.systemd import notified, notify, watchdog_seconds


@pytest.fixture
def manager(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(str(tmp_path / "notify"))
        listening.settimeout(10)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        yield listening


def test_a_loop_that_turns_feeds_the_watchdog_and_one_that_hangs_does_not(
    manager: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WATCHDOG_USEC", "90000")
    monkeypatch.setenv("WATCHDOG_PID", str(os.getpid()))

    async def serve() -> list[bytes]:
        async with notified():
            assert manager.recv(100) == b"READY=1"
            await asyncio.sleep(0.3)
            return drained(manager)

    assert asyncio.run(serve()).count(b"WATCHDOG=1") >= 2
    assert drained(manager) == [b"STOPPING=1"]


def drained(manager: socket.socket) -> list[bytes]:
    found: list[bytes] = []
    manager.setblocking(False)
    try:
        while True:
            found.append(manager.recv(100))
    except BlockingIOError:
        return found
    finally:
        manager.settimeout(10)


def test_a_name_of_the_abstract_kind_is_understood(monkeypatch: pytest.MonkeyPatch) -> None:
    name = f"marey-test-{os.getpid()}"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(f"\0{name}")
        listening.settimeout(10)
        monkeypatch.setenv("NOTIFY_SOCKET", f"@{name}")
        assert notify("READY=1")
        assert listening.recv(100) == b"READY=1"


@pytest.mark.parametrize("address", [None, "", "vsock:2:1", "/nowhere/notify"])
def test_without_a_manager_nothing_is_sent(address: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    if address is None:
        monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    else:
        monkeypatch.setenv("NOTIFY_SOCKET", address)
    assert not notify("READY=1")


@pytest.mark.parametrize(("usec", "pid"), [("", ""), ("0", ""), ("x", ""), ("1000000", "1")])
def test_a_watchdog_of_another_process_or_none_is_not_fed(usec: str, pid: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("WATCHDOG_USEC", usec)
    monkeypatch.setenv("WATCHDOG_PID", pid or str(os.getpid()))
    assert watchdog_seconds() is None
