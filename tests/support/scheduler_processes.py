"""Processes of `marey scheduler` that a test starts and kills."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from pathlib import Path

from tests.support.marey import REPOSITORY

Start = Callable[[], subprocess.Popen[bytes]]


@contextmanager
def scheduler_processes(settings: Mapping[str, str], folder: Path) -> Generator[Start]:
    """Give a function that starts a scheduler; kill all that were started at the end of the block.

    Args:
        settings: variables `MAREY_…`; those of this process are not inherited.
        folder: for the logs, `scheduler<number>.log`.
    """
    started: list[subprocess.Popen[bytes]] = []
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("MAREY_")}

    def run() -> subprocess.Popen[bytes]:
        with (folder / f"scheduler{len(started)}.log").open("wb") as log:
            command = [sys.executable, "-m", "tests.chaos.process", "scheduler"]
            environment = {**inherited, **settings}
            started.append(subprocess.Popen(command, cwd=REPOSITORY, env=environment, stdout=log, stderr=log))
        return started[-1]

    try:
        yield run
    finally:
        for process in started:
            process.kill()
            process.wait()
