"""Results of following and fetching a job: its progress, and its items with their files."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from marey.client.fetching import FetchObserver
from marey.client.types.jobs import Counters, Job, JobEvent, JobItem


@dataclass(frozen=True, kw_only=True)
class Progress:
    """The progress of a job.

    Attributes:
        state: of the job.
        done: number of items that have ended.
        total: number of items.
        counters: number of items in each state.
        event: the event that changed it; None = the server was asked for the job.
        job: the job as the server described it last, which may be older than the event.
    """

    state: str
    done: int
    total: int
    counters: Counters
    event: JobEvent | None = None
    job: Job


@dataclass(frozen=True, kw_only=True)
class FetchedItem:
    """An item of a fetched job.

    Attributes:
        item: with its motion, if it has one.
        files: paths by format; empty where no motion was made.
    """

    item: JobItem
    files: Mapping[str, Path]


OnProgress = Callable[[Progress], None]
OnFetched = Callable[[int, int], None]
"""Called with the numbers of fetched files and of all files."""


class FetchCounter(FetchObserver):
    """An observer that counts fetched files."""

    def __init__(self, on_progress: OnFetched) -> None:
        self._on_progress = on_progress
        self._lock = threading.Lock()
        self._done = self._total = 0

    def planned(self, total: int) -> None:
        self._total = total
        self._on_progress(0, total)

    def fetched(self, path: Path) -> None:
        with self._lock:
            self._done += 1
            self._on_progress(self._done, self._total)


def progress_of(view: Mapping[str, Any], event: Mapping[str, Any] | None) -> Progress:
    """Return the progress that a job, and the event after it, tell."""
    now = view if event is None else event["data"]
    counters = Counters.of(now["counters"])
    done = counters.succeeded + counters.failed + counters.dead + counters.cancelled
    change = None if event is None else JobEvent.of(event)
    return Progress(
        state=now["state"], done=done, total=view["total"], counters=counters, event=change, job=Job.of(view)
    )
