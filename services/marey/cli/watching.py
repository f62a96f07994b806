"""Following a job until it ends, with a progress bar."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from marey.cli import console
from marey.cli.hints import hint_of_timeout, name_operation
from marey.core.errors import ItemsFailed

if TYPE_CHECKING:
    from rich.progress import Progress as Bar

    from marey.client import Client, Job, JobEvent, Progress


def watch_job(client: Client, job: str, *, timeout: float | None = None, quiet: bool = False) -> Job:
    """Follow a job until it has ended, through lost connections, and return it.

    Args:
        timeout: seconds; None = no limit.
        quiet: without a progress bar.

    Raises:
        TimedOut: `timeout` passed; the job continues.
        Unreachable: the server was away for three minutes.
    """
    hint = _watch_hint(job)
    with console.goes_on(f"job {job}", hint), hint_of_timeout(hint), console.bar() as bar:
        bar.disable = quiet
        task = bar.add_task("", total=None)

        def show(now: Progress) -> None:
            if now.event is not None and now.event.kind != "progress" and not quiet:
                _show_event(bar, now.event)
            bar.update(task, total=now.total, completed=now.done, description=_caption(now))

        return client.jobs.wait(job, timeout=timeout, on_progress=show, check=False)


def check_ended(job: Job) -> None:
    """Check that all items of the ended job succeeded.

    Raises:
        ItemsFailed: some failed, died or were cancelled.
    """
    if job.state == "succeeded":
        return
    of_each = job.counters
    counts = {"failed": of_each.failed, "dead": of_each.dead, "cancelled": of_each.cancelled}
    raise ItemsFailed(
        f"{', '.join(f'{count} {state}' for state, count in counts.items() if count)} of {job.total} items",
        where=f"job {job.id}",
        hint=f"`marey jobs show {job.id}` says why; `marey jobs retry {job.id}` tries them again.",
    )


def _watch_hint(job: str) -> str:
    return f"`marey jobs watch {job}` watches it again; `marey jobs cancel {job}` ends it."


def _caption(now: Progress) -> str:
    bad = now.counters.failed + now.counters.dead + now.counters.cancelled
    return f"{now.job.name or now.job.id} {now.state}" + (f", {bad} without result" if bad else "")


def _show_event(bar: Bar, event: JobEvent) -> None:
    if event.item and event.reason:
        problem: Mapping[str, Any] = event.data.get("problem") or {}
        place = f"{name_operation(problem['where'])}: " if problem.get("where") else ""
        bar.console.print(f"item {event.item[-8:]}: {place}{event.reason}", markup=False)
