"""A thread that does one thing every so often, and outlives whatever that does."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

from shared import metrics
from shared.errors import Unreachable
from shared.runtime.logs import logger

log = logger(__name__)


class Periodic(threading.Thread):
    """Calls `action` every `seconds` until `stopping`.

    After an outage, `probe` is asked until it does not raise `Unreachable`; then `grace` seconds pass before the next
    call, for others must first find the database again.
    """

    def __init__(
        self,
        name: str,
        action: Callable[[], None],
        *,
        seconds: float,
        stopping: threading.Event,
        probe: Callable[[], None] = lambda: None,
        grace: float = 0.0,
    ) -> None:
        super().__init__(name=name, daemon=True)
        self._action = action
        self._seconds = seconds
        self._probe = probe
        self._grace = grace
        self._stopping = stopping
        self.away = False
        self._ticked = time.monotonic()

    def silence(self) -> float:
        """Seconds for which a round is under way, or overdue; below 0 between two rounds."""
        return time.monotonic() - self._ticked - self._seconds

    def run(self) -> None:
        while not self._stopping.wait(self._seconds):
            self._ticked = time.monotonic()
            try:
                self.once()
                outcome = "done"
            except Unreachable as error:
                outcome = "waiting"
                if not self.away:
                    log.warning(f"{self.name}_waits", error=error.message)
                self.away = True
            except Exception:
                outcome = "failed"
                log.exception(f"{self.name}_failed")
            metrics.ROUNDS.labels(self.name, outcome).inc()
            self._ticked = time.monotonic()

    def once(self) -> None:
        """One round.

        Raises:
            Unreachable: what the action needs is away.
        """
        if self.away:
            self._probe()
            self._stopping.wait(self._grace)
            self.away = False
        if not self._stopping.is_set():
            self._action()
