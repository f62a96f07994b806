"""A thread that runs an action periodically, and survives its errors."""

from __future__ import annotations

import threading
from collections.abc import Callable

from marey.core import metrics
from marey.core.errors import Unreachable
from marey.runtime.logs import logger
from marey.scheduler.components import SchedulerComponent

log = logger(__name__)


class Periodic(SchedulerComponent):
    """Calls `action` every `seconds` until `stopping`.

    After an outage, `probe` is called until it does not raise `Unreachable`, then `meanwhile` once; then `grace`
    seconds pass before the next call, since other processes must reconnect first. `outages` counts outages that a
    retry has hidden: with a `grace`, each round probes first, and a higher count is handled like any outage.
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
        outages: Callable[[], int] = lambda: 0,
        meanwhile: Callable[[], object] = lambda: None,
    ) -> None:
        super().__init__(name, pause=seconds, allowance=grace)
        self._action = action
        self._seconds = seconds
        self._probe = probe
        self._grace = grace
        self._outages, self._meanwhile = outages, meanwhile
        self._known_outages = outages()
        self._stopping = stopping
        self.away = False

    def run(self) -> None:
        while not self._stopping.wait(self._seconds):
            self.progressed(in_round=True)
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
            self.progressed()

    def once(self) -> None:
        """Run one round.

        Raises:
            Unreachable: a dependency of the action is down.
        """
        if self.away or self._grace > 0:
            self._probe()
        known, self._known_outages = self._known_outages, self._outages()
        if self.away or self._known_outages != known:
            self.away = True
            self._meanwhile()
            self._stopping.wait(self._grace)
            self.away = False
        if not self._stopping.is_set():
            self._action()
