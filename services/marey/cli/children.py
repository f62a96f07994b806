"""Processes of `marey` that another one keeps running."""

from __future__ import annotations

import contextlib
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from marey.cli import console
from marey.core.private_home import open_private

if TYPE_CHECKING:
    from marey.core.settings import Settings

TICK = 0.2
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 30.0
"""Seconds before a child that ended is started again; doubled each time it ends within a minute."""
STEADY = 60.0
TAIL = 2**16
"""Bytes of a log that are searched for the reason why its process ended."""
LONGEST_LINE = 500
ERROR_LINE = re.compile(r'^marey: |\[(error|critical) *\]|"level": "(error|critical)"|^\w+(\.\w+)*(Error|Exception)\b')
"""A command's own words, a log line as text or as JSON, the end of a traceback."""
STOP_SECONDS = 35.0
"""Workers release their leases within 30 s; longer and they are killed."""


@dataclass
class SupervisedProcess:
    """A child process, started again when it ends.

    Attributes:
        log: the file of its output; None = the output of the parent.
        log_from: position in the log where this process begins.
    """

    name: str
    command: Sequence[str]
    environment: dict[str, str]
    log: Path | None = None
    process: subprocess.Popen[bytes] | None = None
    pause: float = FIRST_PAUSE
    began: float = 0.0
    due: float = 0.0
    log_from: int = 0

    def keep(self, now: float) -> None:
        """Start it if it does not run and its pause is over."""
        if self.process is None:
            if now >= self.due:
                self.start(now)
            return
        code = self.process.poll()
        if code is None:
            return
        if now - self.began > STEADY:
            self.pause = FIRST_PAUSE
        where = "" if self.log is None else f" Its log: {self.log}"
        console.say(f"{self.name} ended ({_how(code)}); starting it again in {self.pause:g} s.{where}")
        if code > 0 and (why := self._last_error()) is not None:
            console.say(f"  {why}")
        self.process, self.due = None, now + self.pause
        self.pause = min(self.pause * 2, LONGEST_PAUSE)

    def _last_error(self) -> str | None:
        """Return the last line of its log that reports an error; None if there is none since it was started."""
        if self.log is None:
            return None
        try:
            with self.log.open("rb") as stream:
                stream.seek(max(self.log_from, self.log.stat().st_size - TAIL))
                lines = stream.read().decode(errors="replace").splitlines()
        except OSError:
            return None
        return next((line[:LONGEST_LINE] for line in reversed(lines) if ERROR_LINE.search(line)), None)

    def start(self, now: float) -> None:
        """Start it. It gets SIGTERM when the parent ends, in any way."""
        if self.log is not None:
            self.log_from = self.log.stat().st_size if self.log.exists() else 0
        with contextlib.nullcontext() if self.log is None else open_private(self.log, "ab") as output:
            self.process = subprocess.Popen(
                ends_with_parent(self.command),
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=None if output is None else subprocess.STDOUT,
                start_new_session=True,  # Ctrl-C is for us; we stop the children in order
            )
        self.began = now

    def terminate(self) -> None:
        """Ask it to end."""
        if self.process is not None and self.process.poll() is None:
            self.process.terminate()

    def join(self, seconds: float) -> None:
        """Wait until it has ended, by force after `seconds`."""
        if self.process is None:
            return
        try:
            self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def marey(*arguments: str) -> list[str]:
    """Return the command line of a command of `marey`."""
    return [sys.executable, "-m", "marey.cli", *arguments]


def ends_with_parent(command: Sequence[str]) -> list[str]:
    """Return the command line of a process that gets SIGTERM when its parent ends, in any way; without `setpriv`
    (util-linux) the command alone."""
    setpriv = shutil.which("setpriv")
    return [*([setpriv, "--pdeathsig", "TERM"] if setpriv else []), *command]


def metrics_port(config: Settings, place: int) -> dict[str, str]:
    """Return the environment variable of a child's metrics port; ports count up, one for each child."""
    return {} if config.metrics_port is None else {"MAREY_METRICS_PORT": str(config.metrics_port + place)}


def keep_all(children: Sequence[SupervisedProcess]) -> None:
    """Keep children running until SIGTERM or SIGINT."""
    stopping: list[int] = []
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda number, _: stopping.append(number))
    try:
        while not stopping:
            for child in children:
                child.keep(time.monotonic())
            time.sleep(TICK)
    finally:
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)  # a second Ctrl-C must not leave children behind
        stop_all(children)


def stop_all(children: Sequence[SupervisedProcess]) -> None:
    """Ask all children to end, and wait until they have."""
    for child in children:
        child.terminate()
    for child in children:
        child.join(STOP_SECONDS)


def _how(code: int) -> str:
    return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
