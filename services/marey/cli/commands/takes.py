"""`marey motions …`: find and review motions."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from marey.cli import console, options
from marey.cli.exporting import ServerBody, ServerRig, with_export
from marey.cli.operations import OperationsCommand, Ops, given_operations, naming_operations, with_operations
from marey.cli.references import FORMS, MOTION_FORMS, find, find_all
from marey.core.errors import InvalidInput, NotFound
from marey.motion.edits.steps import read_steps
from marey.motion.export_options import PLAIN, RIG_NAME, ExportOptions

if TYPE_CHECKING:
    from marey.client import Client

app = typer.Typer(
    help="Motions on the server: find, keep, reject, edit and re-roll them, get files.", no_args_is_help=True
)

MOST = 1000
"""Motions of one request."""
COLUMNS = ("id", "index", "name", "tags", "seed", "review", "seconds", "prompt")

Motions = Annotated[list[str], typer.Argument(metavar="ID…", help=f"Motions: of each {MOTION_FORMS}; - reads stdin.")]
Comment = Annotated[str | None, typer.Option("--comment", help="A comment on the review.")]


class ReviewOption(StrEnum):
    """Reviews of motions; new = not reviewed."""

    NEW = "new"
    KEPT = "kept"
    REJECTED = "rejected"
    REROLLED = "rerolled"


@app.command("list")
def list_motions(
    tags: Annotated[
        list[str] | None,
        typer.Option("--tag", help="Only motions with this tag, such as shot=010; repeated: with all of them."),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="Only motions whose name begins like this.")] = None,
    text: Annotated[
        str | None, typer.Option("--text", help='Words of the prompt in any form; "a phrase", or, -not.')
    ] = None,
    reviews: Annotated[
        list[ReviewOption] | None,
        typer.Option("--review", help="Only motions with this review; repeated: any of them."),
    ] = None,
    job: Annotated[str | None, typer.Option("--job", help=f"Of a job ({FORMS}), in the order they were made.")] = None,
    limit: console.Limit = None,
    full_ids: console.FullIds = False,
    as_json: console.Json = False,
) -> None:
    """List motions that match all filters, newest first."""
    from marey.client import Client

    with Client() as client:
        found = client.motions.list(
            job=None if job is None else find(client, "job", job).id,
            tags=tags,
            name=name,
            text=text,
            reviews=[review.value for review in reviews] if reviews else None,
            page_size=console.page_size(limit),
        )
        console.listing((each.raw for each in found), COLUMNS, _cell, as_json=as_json, limit=limit, full_ids=full_ids)


@app.command()
def keep(motions: Motions, comment: Comment = None, as_json: console.Json = False) -> None:
    """Mark motions as kept: `marey fetch --review kept` fetches them."""
    _review(motions, "kept", comment, as_json)


@app.command()
def reject(motions: Motions, comment: Comment = None, as_json: console.Json = False) -> None:
    """Mark motions as rejected; nothing is deleted."""
    _review(motions, "rejected", comment, as_json)


@app.command()
def clear(motions: Motions, as_json: console.Json = False) -> None:
    """Remove the reviews of motions."""
    _review(motions, None, None, as_json)


@app.command()
def reroll(motions: Motions, comment: Comment = None, as_json: console.Json = False) -> None:
    """Generate motions again with the next seed, otherwise unchanged: a new item in the same job, linked to the old.

    A repeated command has no further effect; to continue, re-roll the new motion.
    """
    from marey.client import Client

    with Client() as client:
        for some in _ids(client, motions):
            for take in client.motions.reroll(some, comment=comment):
                if as_json:
                    console.result_json(take.raw)
                else:
                    when = "" if take.made else f" (asked for before; it is {take.state})"
                    console.result(f"{take.motion} item {take.item} seed {take.seed} job {take.job}{when}")


@app.command("edit", cls=OperationsCommand)
@with_operations
def edit(
    context: typer.Context,
    motion: Annotated[str, typer.Argument(metavar="ID", help=f"The motion: {MOTION_FORMS}.")],
    ops: Ops = None,
    model: options.Model = None,
    bundle: options.Bundle = None,
    sampling: options.Sampling = None,
    scope: options.Scope = "warn",
    name: Annotated[str | None, typer.Option("--name", help="A name for the job.")] = None,
    priority: Annotated[int, typer.Option("--priority", help="-1000 to 1000; higher runs first.")] = 0,
    keep_days: Annotated[
        int | None,
        typer.Option("--keep-days", min=1, help="Delete the job with its motions this many days after its end."),
    ] = None,
    wait: Annotated[
        bool, typer.Option("--wait/--no-wait", help="Wait for the motions; without it, print the job's id.")
    ] = True,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check everything without submitting.")] = False,
    timeout: Annotated[
        float | None, typer.Option("--timeout", help="Timeout in seconds; exit 7 when it passes.")
    ] = None,
    as_json: console.Json = False,
    **operations: Any,
) -> None:
    """Edit a motion on the server: cut, join, loop, mirror, retime or smooth it, or let a model generate frames of it;
    prints the ids of the new motions.

    The motion itself does not change. Operations apply in the order in which they are given; others to join are motions
    of the server.
    """
    from marey.cli.commands.submit import show_capacity
    from marey.cli.watching import check_ended, watch_job
    from marey.client import Client

    del operations  # `given_operations` has them in their order
    listed = given_operations(context, ops)
    with naming_operations(context, ops), Client() as client:
        given = read_steps(listed)
        steps = [_with_id(client, step.as_json()) for step in given]
        found = find(client, "motion", motion).id
        settings = options.settings_of(sampling or ()) or None
        if dry_run:
            checked = client.check_edit(found, steps, model=bundle or model, settings=settings, scope=scope)
            show_capacity(checked)
            console.warn_all(checked.warnings)
            if as_json:
                console.result_json(checked.raw)
            return
        job = client.edit(
            found, steps,
            model=bundle or model, settings=settings, name=name, priority=priority, keep_days=keep_days,
            scope=scope,
        )  # fmt: skip
        console.warn_all(job.warnings)
        if not wait:
            _show(job.raw, as_json)
            return
        ended = watch_job(client, job.id, timeout=timeout)
        for made in client.motions.list(job=job):
            _show(made.raw, as_json)
    check_ended(ended)


@app.command()
def revert(motions: Motions, as_json: console.Json = False) -> None:
    """Go back from edits to the motions that they were made from; prints the ids of those. Nothing is deleted.

    The edit becomes rejected; its source becomes kept if the edit was, and is no longer rejected.
    """
    from marey.client import Client

    with Client() as client:
        for some in _ids(client, motions):
            for motion in some:
                _show(client.motions.revert(motion).raw, as_json)


@app.command("file")
@with_export(without=("rig_map", "names"), instead={"rig": ServerRig, "body": ServerBody})
def make_file(
    motion: Annotated[str, typer.Argument(metavar="ID", help=f"The motion: {MOTION_FORMS}.")],
    file_format: Annotated[str, typer.Argument(metavar="FORMAT", help="Format of the file, such as glb or mp4.")],
    output: Annotated[Path, typer.Option("-o", "--output", help="File to write.")],
    fps: options.Fps = None,
    export: ExportOptions = PLAIN,
    overwrite: options.Overwrite = False,
) -> None:
    """Have the server make a file of a motion, and fetch it; nothing is computed on this machine."""
    from marey.client import Client

    for option, named in (("--rig", export.rig), ("--body", export.body)):
        _check_rig_name(option, named)
    with Client() as client:
        found = find(client, "motion", motion)
        path = client.motions.make_file(
            found.id, output, file_format=file_format, fps=fps, overwrite=overwrite, **export.values
        )
    console.result(console.home_relative(path))


def _check_rig_name(option: str, named: str | None) -> None:
    """Check that a rig of the server is named, not a file.

    Raises:
        NotFound: it is a file that does not exist.
        InvalidInput: it is a file.
    """
    if named is None or re.fullmatch(RIG_NAME, named):
        return
    if not Path(named).is_file():
        hint = "`marey rigs list` shows the rigs of the server, which have no ending."
        raise NotFound(f"is neither a file here nor the name of a rig: {named[:80]!r}", where=option, hint=hint)
    hint = f"`marey rigs add {named}` adds it to the server; `marey fetch JOB {option} {named}` makes the files here."
    raise InvalidInput(f"is a file here, not a rig of the server: {named[:80]!r}", where=option, hint=hint)


def _with_id(client: Client, step: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return an operation with the id of the motion that it refers to."""
    return {name: find(client, "motion", value).id if name == "with" else value for name, value in step.items()}


def _show(found: Mapping[str, Any], as_json: bool) -> None:
    if as_json:
        console.result_json(found)
    else:
        console.result(str(found["id"]))


def _review(
    motions: list[str], verdict: Literal["kept", "rejected"] | None, comment: str | None, as_json: bool
) -> None:
    from marey.client import Client

    with Client() as client:
        for some in _ids(client, motions):
            for motion in client.motions.review(some, verdict, comment=comment):
                if as_json:
                    console.result_json(motion.raw)
                else:
                    console.say(f"{motion.id} {motion.review.verdict if motion.review else ReviewOption.NEW.value}")


def _ids(client: Client, motions: list[str]) -> Iterator[list[str]]:
    """Yield the ids, each once, in lists of the size of one request.

    Raises:
        InvalidInput: there is no id, or one is ambiguous.
        NotFound: there is no such motion.
    """
    given = _lines(sys.stdin.read()) if motions == ["-"] else motions
    ids = [each.id for each in find_all(client, "motion", dict.fromkeys(given))]
    if not ids:
        raise InvalidInput("no motion id is given", hint="`marey motions list` shows them.")
    for first in range(0, len(ids), MOST):
        yield ids[first : first + MOST]


def _lines(text: str) -> list[str]:
    """Return the references in a text: whole lines where names contain blanks, else words."""
    return [word for line in text.splitlines() for word in ([line.strip()] if ":" in line else line.split()) if word]


def _cell(motion: Mapping[str, Any], column: str) -> object:
    if column == "tags":
        return "; ".join(motion["tags"])
    if column == "seconds":
        return round(motion["frames"] / motion["fps"], 2)
    return review_of(motion) if column == "review" else motion[column]


def review_of(motion: Mapping[str, Any]) -> str | None:
    """Return the review of a motion of the API; None if it has none."""
    return motion["review"] and motion["review"]["verdict"]
