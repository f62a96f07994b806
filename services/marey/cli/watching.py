"""Following a job until it ends, with a progress bar."""

from __future__ import annotations

from typing import Any

from marey.cli import console
from marey.client.transport import Transport
from marey.client.watching import ended_items, follow_job, items_without_result
from marey.core.errors import ItemsFailed


def watch_job(transport: Transport, job: str, *, timeout: float | None = None, quiet: bool = False) -> dict[str, Any]:
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
    hint = _watch_hint(job)
    with console.goes_on(f"job {job}", hint), console.bar() as bar:
        bar.disable = quiet
        task = None
        following = follow_job(transport, job, timeout=timeout, hint=hint)
        while True:
            try:
                state, event = next(following)
            except StopIteration as ended:
                return ended.value
            if task is None:
                task = bar.add_task("", total=state["total"])
            now = state
            if event is not None:
                now = event["data"]
                if event["kind"] != "progress":
                    _tell(bar, event, quiet)
            bar.update(task, completed=ended_items(now), description=_caption(state, now))


def check_ended(job: dict[str, Any]) -> None:
    """Check that all items of the ended job succeeded.

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


def _watch_hint(job: str) -> str:
    return f"`marey jobs watch {job}` watches it again; `marey jobs cancel {job}` ends it."


def _caption(job: dict[str, Any], now: dict[str, Any]) -> str:
    bad = items_without_result(now)
    return f"{job['name'] or job['id']} {now['state']}" + (f", {bad} without result" if bad else "")


def _tell(bar: Any, event: dict[str, Any], quiet: bool) -> None:
    if not quiet and event.get("item") and event.get("reason"):
        bar.console.print(f"item {event['item'][-8:]}: {event['reason']}", markup=False)
