"""A stand-in server, and the command as a process."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.support.stream_server import Plan, StreamServer
from tests.support.streaming import Running


@pytest.fixture
def serve(tmp_path: Path) -> Iterator[Callable[..., StreamServer]]:
    """A server with this plan."""
    with contextlib.ExitStack() as stack:
        yield lambda **plan: stack.enter_context(StreamServer(Plan(**plan)))


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Running]]:
    started: list[Running] = []

    def begin(server: StreamServer, *arguments: object, **streams: Any) -> Running:
        started.append(Running.start(server, tmp_path, *arguments, **streams))
        return started[-1]

    yield begin
    for running in started:
        running.process.kill()
        running.process.wait(30)
        for thread in running.threads:
            thread.join(30)
        for pipe in (running.process.stdin, running.process.stdout, running.process.stderr):
            if pipe is not None:
                pipe.close()
