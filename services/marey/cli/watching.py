"""Following a job until it ends."""

from __future__ import annotations

import time
from typing import Any

from marey.cli import console
from marey.client.transport import PATIENCE, Transport
from marey.core.errors import Busy, ItemsFailed, TimedOut, Unreachable

ENDED = frozenset({"succeeded", "partial", "failed", "cancelled"})


def watch_job(client: Transport, job: str, *, timeout: float | None = None, quiet: bool = False) -> dict[str, Any]:
    """Follow the job's events until it has ended; a lost connection is taken up where it broke.

    Args:
        timeout: seconds; None = for ever.
        quiet: without a progress bar.

    Returns:
        The job as it ended.

    Raises:
        TimedOut: `timeout` passed; the job goes on.
        Unreachable: the server was away for longer than `PATIENCE`.
    """
    deadline = None if timeout is None else time.monotonic() + timeout
    with console.goes_on(f"job {job}", _watch_hint(job)), console.bar() as bar:
        bar.disable = quiet
        state = client.get(f"/v1/jobs/{job}")
        task = bar.add_task(_caption(state, state), total=state["total"], completed=_ended(state))
        seen, reachable = 0, time.monotonic()
        while state["state"] not in ENDED:
            try:
                for event in client.events(job, after=seen, patience=_patience(deadline, job)):
                    seen = event["seq"]
                    if event["kind"] != "progress":
                        _tell(bar, event, quiet)
                    reachable = time.monotonic()
                    _patience(deadline, job)
                    bar.update(task, completed=_ended(event["data"]), description=_caption(state, event["data"]))
                state = client.get(f"/v1/jobs/{job}")
                reachable = time.monotonic()
            except Busy as error:  # its key has all the streams it may have: look now and then instead
                time.sleep(min(error.seconds, _patience(deadline, job)))
                state = client.get(f"/v1/jobs/{job}")
                reachable = time.monotonic()
            except Unreachable:
                if time.monotonic() - reachable > PATIENCE:
                    raise
                time.sleep(0.5)
            bar.update(task, completed=_ended(state), description=_caption(state, state))
        return state


def check_ended(job: dict[str, Any]) -> None:
    """Nothing, if all items of the ended job succeeded.

    Raises:
        ItemsFailed: some failed, died or were cancelled.
    """
    if job["state"] == "succeeded":
        return
    counts = [f"{job['counters'][name]} {name}" for name in ("failed", "dead", "cancelled") if job["counters"][name]]
    raise ItemsFailed(
        f"{', '.join(counts)} of {job['total']} items",
        where=f"job {job['id']}",
        hint=f"`marey jobs show {job['id']}` says why; `marey jobs retry {job['id']}` tries them again.",
    )


def _patience(deadline: float | None, job: str) -> float:
    """Seconds an open connection may stay silent: the server pings every 15 s."""
    if deadline is None:
        return 30.0
    left = deadline - time.monotonic()
    if left <= 0:
        raise TimedOut("the time allowed has passed; the job goes on", where=f"job {job}", hint=_watch_hint(job))
    return min(30.0, left)


def _watch_hint(job: str) -> str:
    return f"`marey jobs watch {job}` watches it again; `marey jobs cancel {job}` ends it."


def _ended(now: dict[str, Any]) -> int:
    return sum(now["counters"][name] for name in ("succeeded", "failed", "dead", "cancelled"))


def _caption(job: dict[str, Any], now: dict[str, Any]) -> str:
    bad = sum(now["counters"][name] for name in ("failed", "dead", "cancelled"))
    return f"{job['name'] or job['id']} {now['state']}" + (f", {bad} without result" if bad else "")


def _tell(bar: Any, event: dict[str, Any], quiet: bool) -> None:
    if not quiet and event.get("item") and event.get("reason"):
        bar.console.print(f"item {event['item'][-8:]}: {event['reason']}", markup=False)
