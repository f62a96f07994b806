"""The checks of `/readyz`: they run in the background, each in a thread of its own.

A hanging check blocks nothing else: its last result grows old, and an old result counts as a failure. The checks
themselves are in `marey.api.health.checks`.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import structlog

from marey.core.errors import MareyError

INTERVAL_SECONDS = 2.0
"""Seconds between the end of one run of a check and the next."""
DEADLINE_SECONDS = 5.0
"""Seconds after which a running check counts as failed."""
STALE_SECONDS = INTERVAL_SECONDS + DEADLINE_SECONDS

log = structlog.get_logger(__name__)


@dataclass(frozen=True)
class CheckResult:
    """Result of a check.

    Attributes:
        message: public: names what is down, never where or how.
        required: True if requests cannot be answered without it.
    """

    ok: bool
    message: str | None = None
    required: bool = True


@dataclass(frozen=True)
class DependencyCheck:
    """A dependency that must work.

    Attributes:
        run: raises MareyError on failure.
        message: public message of a failure; the log has the error itself.
        required: True if requests cannot be answered without it; else it is reported, and the API stays ready.
    """

    run: Callable[[], object]
    message: str
    required: bool = True


UNCHECKED = CheckResult(False, "not checked yet")


class Readiness:
    """Runs checks periodically, and stores the last result of each."""

    def __init__(self, checks: Mapping[str, DependencyCheck], *, interval: float = INTERVAL_SECONDS) -> None:
        self._checks, self._interval = checks, interval
        self._results: dict[str, tuple[float, CheckResult]] = {}
        self._stopping = threading.Event()

    def start(self) -> None:
        """Start the first round."""
        for name, check in self._checks.items():
            threading.Thread(target=self._repeat, args=(name, check), name=f"check-{name}", daemon=True).start()

    def stop(self) -> None:
        """Start no other round. A hanging check is left alone: its thread ends with the process."""
        self._stopping.set()

    def results(self) -> dict[str, CheckResult]:
        """Return the current result of each check. Never waits."""
        oldest = time.monotonic() - STALE_SECONDS
        found: dict[str, CheckResult] = {}
        for name, check in self._checks.items():
            at, result = self._results.get(name, (float("inf"), UNCHECKED))
            current = CheckResult(False, check.message) if at < oldest else result
            found[name] = replace(current, required=check.required)
        return found

    def _repeat(self, name: str, check: DependencyCheck) -> None:
        while not self._stopping.is_set():
            result, error = self._run(check)
            before = self._results.get(name, (0.0, UNCHECKED))[1]
            self._results[name] = (time.monotonic(), result)
            if error is not None and before != result:
                bug = None if isinstance(error, MareyError) else error
                log.warning("not_ready", check=name, error=str(error), exc_info=bug)
            elif before.ok != result.ok:
                log.info("ready", check=name)
            self._stopping.wait(self._interval)

    def _run(self, check: DependencyCheck) -> tuple[CheckResult, Exception | None]:
        try:
            check.run()
        except Exception as error:
            return CheckResult(False, check.message), error
        return CheckResult(True), None
