"""Networks that fall silent: connections stay open, bytes are acknowledged, no answer comes. What finds it, and when.

Two faults of each server: "connections silent", where every open connection stalls and new ones work, and "silent",
where new ones stall too, for a while. Those that stalled never go on: a firewall does not remember them either.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any
from uuid import UUID

import httpx2

from tests.chaos.studios import ask, client_of
from tests.servers.stalling_proxy import StallingProxy

OPEN_SILENT, ALL_SILENT = "connections silent", "silent"
UNDER_WAY = 0.5
"""Seconds after a stall for which servers still work on what had reached them: that is no recovery."""
READ_SECONDS = 60.0
AGAIN_SECONDS = 0.5

BARS: Mapping[str, float] = {
    "API answers": 15.0,
    "relay at work": 15.0,
    "next motion stored": 15.0,
    "next claim": 15.0,
    "event delivered": 20.0,
}
"""Seconds on a quiet machine: from the start of "connections silent", from the end of "silent"."""


def bar_of(kind: str, until: str) -> float | None:
    """Return within how many seconds that must be so after a fault of this kind; None = no bar is set."""
    return BARS.get(until) if kind.endswith(ALL_SILENT) else None


def missed(samples: list[dict[str, Any]]) -> list[str]:
    """Say of each sample above its bar which, and whether another fault fell into it."""
    return [
        f"{sample['fault']}: {sample['until']} after {sample['seconds']:.1f} s, bar {bar:g} s"
        + ("" if sample["alone"] else " (another fault fell into it)")
        for sample in samples
        if (bar := bar_of(sample["fault"], sample["until"])) is not None and sample["seconds"] > bar
    ]


def stall(proxy: StallingProxy, *, new: bool) -> None:
    """Let a network fall silent. What an earlier fault left is closed first, as a firewall does in time."""
    proxy.cut(silent=True)
    proxy.stall(new=new)


class EventProbe(threading.Thread):
    """Follows the events of one job as a client does that comes back when its stream ends.

    Args:
        job: one that stays open; `touch` gives it an event.

    Attributes:
        last: number of the newest event that came.
    """

    def __init__(self, url: str, key: str, job: UUID) -> None:
        super().__init__(name="event probe", daemon=True)
        self._url, self._key, self._job = url, key, job
        self._done = threading.Event()
        self.last = 0

    def run(self) -> None:
        headers = {"Accept": "text/event-stream"}
        while not self._done.is_set():
            try:
                with (
                    client_of(self._url, self._key) as http,
                    http.stream(
                        "GET",
                        f"/v1/jobs/{self._job}/events",
                        headers={**headers, "Last-Event-ID": str(self.last)},
                        timeout=READ_SECONDS,
                    ) as answer,
                ):
                    for line in answer.iter_lines():
                        if line.startswith("id:"):
                            self.last = int(line.removeprefix("id:"))
                        if self._done.is_set():
                            return
            except httpx2.HTTPError:
                pass
            self._done.wait(AGAIN_SECONDS)

    def delivers(self) -> bool:
        """Make an event, and wait until it comes; for one thread at a time."""
        before = self.last
        with client_of(self._url, self._key) as http:
            answer = ask(http, "PATCH", f"/v1/jobs/{self._job}", json={"comment": f"after {before}"})
        if answer is None or answer.status_code != httpx2.codes.OK:
            return False
        until = time.monotonic() + READ_SECONDS
        while self.last <= before:
            if time.monotonic() > until:
                return False
            time.sleep(0.02)
        return True

    def close(self) -> None:
        """Follow no more; what the thread waits for is not waited for."""
        self._done.set()
