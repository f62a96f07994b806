"""The scheduler's threads, and detection of stalled ones.

A component makes progress with each answered statement of its thread, and with each end of a round. Rounds may take
hours (retention, garbage); one statement or one object may not. A component without progress for `STALL_SECONDS`
hangs without a deadline: the process then exits, and its supervisor restarts it.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Sequence
from typing import Any, NoReturn

import sqlalchemy as sa
from sqlalchemy import event

from marey.runtime.logs import logger

log = logger(__name__)

STALL_SECONDS = 180.0
"""Three times the limit of a statement at the database, and far beyond the deadlines of calls."""
LOOK_SECONDS = 5.0
LOOKS = 3
"""Consecutive checks that must agree: after SIGSTOP or a suspended machine the first finds every component silent."""
EXIT_STALLED = 70  # EX_SOFTWARE


class SchedulerComponent(threading.Thread):
    """A thread of the scheduler.

    Args:
        name: name in metrics and logs.
        pause: seconds between two rounds.
        allowance: seconds that a round may wait intentionally, in addition to `STALL_SECONDS`.
    """

    def __init__(self, name: str, *, pause: float, allowance: float = 0.0) -> None:
        super().__init__(name=name, daemon=True)
        self._between_rounds = pause
        self._allowed_wait = allowance
        self._ticked = time.monotonic()
        self._in_round = False

    def progressed(self, *, in_round: bool = False) -> None:
        """Record progress; within a round, no pause is expected before the next progress."""
        self._ticked = time.monotonic()
        self._in_round = in_round

    def silence(self) -> float:
        """Return seconds without progress; below 0 between two rounds."""
        return time.monotonic() - self._ticked - (0.0 if self._in_round else self._between_rounds)

    def stalled(self, seconds: float) -> bool:
        """Return True if there was no progress for `seconds`, or the thread has ended."""
        return not self.is_alive() or self.silence() > seconds + self._allowed_wait


def note_progress(engine: sa.Engine) -> None:
    """Count each answered statement of this engine as progress of the component that sent it."""

    @event.listens_for(engine, "after_cursor_execute")
    def _answered(*_: Any) -> None:
        part = threading.current_thread()
        if isinstance(part, SchedulerComponent):
            part.progressed(in_round=True)


def watch(
    parts: Sequence[SchedulerComponent],
    stopping: threading.Event,
    *,
    seconds: float | None = None,
    look: float | None = None,
) -> bool:
    """Wait until `stopping` is set; return True, after a line in the log, when a component has stalled before that."""
    seconds, look = seconds or STALL_SECONDS, look or LOOK_SECONDS
    agreed = 0
    while not stopping.wait(look):
        stalled = [part for part in parts if part.stalled(seconds)]
        agreed = agreed + 1 if stalled else 0
        if agreed == LOOKS:
            for part in stalled:
                log.error("scheduler_stalled", part=part.name, seconds=round(part.silence()), running=part.is_alive())
            return not stopping.is_set()
    return False


def end_stalled() -> NoReturn:
    """End this process without waiting for its threads: one of them hangs."""
    os._exit(EXIT_STALLED)
