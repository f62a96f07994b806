"""`marey jobs …`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import islice
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from marey.cli import bulk, console
from marey.cli.hints import name_operation
from marey.cli.references import FORMS, find, of_view
from marey.core.errors import InvalidInput, NotFound

if TYPE_CHECKING:
    from marey.cli.references import Reference
    from marey.client import Client, JobChanges, QualityCounts
    from marey.client import Job as JobResult

app = typer.Typer(help="Jobs on the server.", no_args_is_help=True)

Job = Annotated[str, typer.Argument(metavar="JOB", help=f"The job: {FORMS}.")]
Jobs = Annotated[list[str], typer.Argument(metavar="JOB…", help=f"Jobs: of each {FORMS}.")]
Timeout = Annotated[float | None, typer.Option("--timeout", help="Timeout in seconds; exit 7 when it passes.")]

Reason = Annotated[str | None, typer.Option("--reason", help="Reason, recorded in the job's events.")]

FIELDS = (
    *("id", "name", "comment", "kind", "state", "control", "priority", "fail_early"),
    *("created", "started", "finished", "expires", "erased"),
)
COLUMNS = ("id", "name", "state", "priority", "done", "total", "created")
COUNTERS = ("succeeded", "failed", "dead", "cancelled", "leased", "ready")
State = Annotated[
    Literal["queued", "running", "paused", "succeeded", "partial", "failed", "cancelled"] | None,
    typer.Option("--state", help="Only jobs in this state."),
]


@app.command("list")
def list_jobs(
    state: State = None,
    limit: console.Limit = None,
    full_ids: console.FullIds = False,
    as_json: console.Json = False,
) -> None:
    """List jobs, newest first."""
    from marey.client import Client

    with Client() as client:
        found = client.jobs.list(state=state, page_size=console.page_size(limit))
        console.listing((each.raw for each in found), COLUMNS, _cell, as_json=as_json, limit=limit, full_ids=full_ids)


@app.command()
def show(job: Job, as_json: console.Json = False) -> None:
    """Show a job, and the reasons of failed items."""
    from marey.client import Client

    with Client() as client:
        job = find(client, "job", job).id
        found = client.jobs.get(job).raw
        place = client.jobs.queue(job).raw
        quality = _quality(client, job)
        if as_json:
            console.result_json({**found, "queue": place, "quality": None if quality is None else quality.raw})
            return
        for field in FIELDS:
            if found.get(field) is not None:  # a server of an earlier release has no kind
                console.result(f"{field:<10} {found[field]}")
        counts = ", ".join(f"{found['counters'][name]} {name}" for name in COUNTERS if found["counters"][name])
        console.result(f"{'items':<10} {found['total']}: {counts}")
        if quality is not None and quality.measured:
            console.result(f"{'quality':<10} {_describe(quality)}")
        if found["counters"]["ready"] + found["counters"]["leased"]:
            _show_place(place)
        for state in ("failed", "dead"):
            if found["counters"][state]:
                _show_failures(client, job, state)


def _quality(client: Client, job: str) -> QualityCounts | None:
    """Return how many motions have flags; None from servers of earlier releases."""
    try:
        return client.jobs.quality(job)
    except NotFound:
        return None


def _describe(quality: QualityCounts) -> str:
    """Return one line, as `8 of 10 ok: 2 floating, 1 skating`."""
    flags = ", ".join(f"{count} {flag}" for flag, count in sorted(quality.flags.items()))
    return f"{quality.ok} of {quality.measured} ok{': ' if flags else ''}{flags}"


@app.command()
def watch(job: Job, timeout: Timeout = None, as_json: console.Json = False) -> None:
    """Show a job's progress until it ends; exit 6 if items failed."""
    _wait(job, timeout, as_json, quiet=False)


@app.command()
def wait(job: Job, timeout: Timeout = None, as_json: console.Json = False) -> None:
    """Wait silently until a job ends; exit 6 if items failed."""
    _wait(job, timeout, as_json, quiet=True)


@app.command()
def pause(jobs: Jobs, reason: Reason = None, as_json: console.Json = False) -> None:
    """Stop starting items of jobs; running items are finished."""
    _act(jobs, lambda client, each: client.jobs.pause(each, reason=reason), "paused", as_json=as_json)


@app.command()
def resume(jobs: Jobs, reason: Reason = None, as_json: console.Json = False) -> None:
    """Resume paused jobs."""
    _act(jobs, lambda client, each: client.jobs.resume(each, reason=reason), "resumed", as_json=as_json)


@app.command()
def cancel(jobs: Jobs, reason: Reason = None, as_json: console.Json = False) -> None:
    """Cancel unfinished items; finished ones stay."""
    _act(jobs, lambda client, each: client.jobs.cancel(each, reason=reason), "cancelled", as_json=as_json)


@app.command()
def retry(
    jobs: Jobs,
    failed_only: Annotated[bool, typer.Option("--failed-only", help="Leave cancelled items as they are.")] = False,
    reason: Reason = None,
    as_json: console.Json = False,
) -> None:
    """Retry failed, dead and cancelled items."""
    _act(
        jobs,
        lambda client, each: client.jobs.retry(each, failed_only=failed_only, reason=reason),
        "retried",
        as_json=as_json,
    )


@app.command()
def priority(
    job: Job,
    value: Annotated[int, typer.Argument(metavar="PRIORITY", help="-1000 to 1000; higher runs first. `-- -5` is -5.")],
    reason: Reason = None,
    as_json: console.Json = False,
) -> None:
    """Set the priority of a job among yours."""
    _change(job, {"priority": value}, as_json, reason)


@app.command("fail-early")
def fail_early(
    job: Job,
    share: Annotated[str, typer.Argument(metavar="SHARE", help="0 to 1, as `0.1` for one in ten; `none` = never.")],
    reason: Reason = None,
    as_json: console.Json = False,
) -> None:
    """Cancel open items once the failure ratio exceeds a limit; at once, if it already does."""
    _change(job, {"fail_early": _share(share)}, as_json, reason)


@app.command()
def comment(
    job: Job,
    text: Annotated[str, typer.Argument(metavar="TEXT", help="The comment; empty removes it.")],
    as_json: console.Json = False,
) -> None:
    """Set the comment of a job."""
    _change(job, {"comment": text or None}, as_json)


@app.command()
def delete(jobs: Jobs, yes: console.Yes = False) -> None:
    """Delete ended jobs with their motions."""
    bulk.delete_all(
        "job", jobs, lambda client, each: client.jobs.delete(each.id),
        question="Delete {} with all motions?", done="deleted {}", yes=yes,
    )  # fmt: skip


@app.command()
def erase(
    jobs: Jobs,
    yes: console.Yes = False,
    as_json: console.Json = False,
) -> None:
    """Erase the prompts of ended jobs and of every edit of their motions permanently; motions, names and tags stay."""

    def erase_one(client: Client, job: Reference) -> None:
        found = client.jobs.erase(job.id)
        if as_json:
            console.result_json(found.raw)
            return
        left, edits = found.files_left, len(found.edits)
        also = f" and of {edits} jobs of edits" if edits else ""
        more = f"; {left} files are written anew and cannot be fetched before" if left else ""
        console.say(f"erased the prompts of {job}{also}{more}")

    bulk.delete_all("job", jobs, erase_one, question="Erase the prompts of {} permanently?", done=None, yes=yes)


def _wait(job: str, timeout: float | None, as_json: bool, *, quiet: bool) -> None:
    from marey.cli.watching import check_ended, watch_job
    from marey.client import Client

    with Client() as client:
        ended = watch_job(client, find(client, "job", job).id, timeout=timeout, quiet=quiet)
    if as_json:
        console.result_json(ended.raw)
    check_ended(ended)


def _act(jobs: list[str], act: Callable[[Client, str], JobResult], done: str, *, as_json: bool) -> None:
    def describe(job: JobResult) -> str:
        return f"{done} {of_view('job', job.raw)}: {job.state}"

    bulk.change_all("job", jobs, act, describe, as_json=as_json)


def _change(job: str, patch: JobChanges, as_json: bool, reason: str | None = None) -> None:
    from marey.client import Client

    with Client() as client:
        found = client.jobs.update(find(client, "job", job).id, reason=reason, **patch).raw
    if as_json:
        console.result_json(found)
        return
    parts = [f"{found['state']}, priority {found['priority']}"]
    if found["fail_early"] is not None:
        parts.append(f"fails early above {found['fail_early']:g}")
    console.say(f"{of_view('job', found)}: {', '.join([*parts, *filter(None, [found['comment']])])}")


def _share(text: str) -> float | None:
    if text == "none":
        return None
    try:
        share = float(text)
    except ValueError:
        share = -1.0
    if not 0 <= share <= 1:
        raise InvalidInput(f"{text[:40]!r} is not a share", where="SHARE", hint="Write 0.1 for one in ten, or none.")
    return share


def _show_failures(client: Client, job: str, state: str, limit: int = 20) -> None:
    found = client.jobs.items(job, state=state, page_size=limit)
    for item in (each.raw for each in islice(found, limit)):
        error = item["error"] or {"message": item["reason"], "hint": None}
        place = f"{name_operation(error['where'])}: " if error.get("where") else ""
        reference = f"{console.short_id(job)}:{item['index']}.{item['variant']}"
        console.result(f"{state:<10} {reference} {item['prompt'][:60]!r}: {place}{error['message']}")
        if error.get("hint"):
            console.result(f"{'':<10} {error['hint']}")
    if next(found, None) is not None:
        console.result(f"{'':<10} … and more: `marey fetch {job} --json` has a line for each")


def _show_place(place: Mapping[str, Any]) -> None:
    ahead = f"{place['items_ahead']} items of {place['jobs_ahead']} jobs come first"
    turns = f"; {place['tenants'] - 1} other tenants take turns" if place["tenants"] > 1 else ""
    console.result(f"{'queue':<10} {ahead}{turns}")
    if place["seconds"] is not None:
        console.result(f"{'left':<10} about {console.length_of_time(place['seconds'])}")
    console.result(f"{'':<10} {place['estimate']['basis']}")


def _cell(job: Mapping[str, Any], column: str) -> object:
    if column == "done":
        return sum(job["counters"][name] for name in ("succeeded", "failed", "dead", "cancelled"))
    return job[column]
