"""`marey submit`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from marey.cli import console, options
from marey.cli.exporting import FetchedBody
from marey.cli.poses import StoredMotions
from marey.client import rows
from marey.client.names import check_template
from marey.client.tables import ExtraColumns
from marey.core.errors import InvalidInput, MareyError
from marey.items.problems import InvalidItems
from marey.items.timeline import timeline_gaps
from marey.motion.export_options import ExportOptions

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping
    from typing import Unpack

    from marey.client import CheckedEdit, CheckedJob, Client
    from marey.client.job_requests import Defaults, JobOptions
    from marey.client.lines import Lines
    from marey.items.item import Item

MAX_GAP_NOTES = 3
"""Timelines with gaps that are named one by one."""


def submit(
    prompts: options.Prompts = None,
    timelines: options.Timelines = None,
    constraints: options.Constraints = None,
    file: options.PromptFile = None,
    input_format: options.PromptFormat = None,
    extra_columns: options.Extra = "refuse",
    name: Annotated[str | None, typer.Option("--name", help="A name for the job.")] = None,
    priority: Annotated[int, typer.Option("--priority", help="-1000 to 1000; higher runs first.")] = 0,
    fail_early: Annotated[
        float | None,
        typer.Option("--fail-early", help="Cancel open items once this share (0 to 1) has failed; default: never."),
    ] = None,
    keep_days: Annotated[
        int | None,
        typer.Option("--keep-days", min=1, help="Delete the job with its motions this many days after its end."),
    ] = None,
    model: options.Model = None,
    bundle: options.Bundle = None,
    seconds: options.Seconds = None,
    seed: options.Seed = None,
    variants: options.Variants = None,
    fps: options.Fps = None,
    best_of: options.BestOf = None,
    redraws: options.Redraws = None,
    variety: options.Variety = None,
    tags: options.Tags = None,
    sampling: options.Sampling = None,
    scope: options.Scope = "warn",
    watch: Annotated[bool, typer.Option("--watch", help="Show progress until the job ends.")] = False,
    fetch: Annotated[
        Path | None, typer.Option("--fetch", help="Wait, then fetch the motions into this folder.")
    ] = None,
    formats: options.Formats = None,
    body: FetchedBody = None,
    name_template: options.Template = options.TEMPLATE,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Validate everything without submitting.")] = False,
    timeout: Annotated[
        float | None, typer.Option("--timeout", help="Timeout in seconds; exit 7 when it passes.")
    ] = None,
    as_json: console.Json = False,
) -> None:
    """Put prompts into the queue of a server; prints the job's id."""
    from marey.client import Client
    from marey.client.lines import Lines
    from marey.client.making import check_rig

    check_template(name_template)
    if fetch is None:
        _refuse_of_files(formats, body, name_template)
        if not watch:
            _refuse_timeout(timeout)
    export = _export_of(fetch, formats, body)
    defaults = row_defaults(
        sampling,
        model=model,
        bundle=bundle,
        seconds=seconds,
        seed=seed,
        variants=variants,
        fps=fps,
        best_of=best_of,
        redraws=redraws,
        variety=variety,
        tags=tags,
    )
    motions = StoredMotions()
    if constraints is not None:
        defaults = {**defaults, "constraints": motions.read_file(constraints)}
    reader = read_prompts(prompts, file, input_format, defaults, extra_columns, timelines)
    with Lines(item.as_json() for item in motions.in_items(reader, report_gaps(reader))) as lines:
        if reader.total:
            raise _all_problems(reader, lines)
        with Client() as client:
            check_rig(client.rigs, export)
            wanted: JobOptions = {
                "name": name, "priority": priority, "fail_early": fail_early, "keep_days": keep_days,
                "scope": scope,
            }  # fmt: skip
            if dry_run:
                with reader.in_source():
                    checked = client.jobs.check_lines(lines, **wanted)
                _show_check(checked, as_json=as_json)
                return
            with reader.in_source():
                job = client.jobs.submit_lines(lines, **wanted)
            console.warn_all(job.warnings)
            if as_json and fetch is None:
                console.result_json(job.raw)
            elif not as_json:
                console.result(job.id)
            if watch or fetch is not None:
                _follow(client, job.id, fetch, formats, name_template, timeout, as_json, export)


def _refuse_of_files(formats: list[str] | None, body: str | None, template: str) -> None:
    """Refuse the options of files that are fetched, where none are.

    Raises:
        InvalidInput: one is given.
    """
    given = {
        "--format FORMAT": bool(formats),
        "--body NAME|FILE": body is not None,
        "--name-template TEMPLATE": template != options.TEMPLATE,
    }
    for option, is_given in given.items():
        if is_given:
            raise InvalidInput(
                "acts on files that are fetched, and none are",
                where=option.partition(" ")[0],
                hint=f"Add --fetch FOLDER, or leave it to `marey fetch JOB {option}`.",
            )


def _refuse_timeout(timeout: float | None) -> None:
    """Refuse `--timeout` where nothing is waited for.

    Raises:
        InvalidInput: it is given.
    """
    if timeout is not None:
        raise InvalidInput(
            "limits the time of waiting, and nothing is waited for",
            where="--timeout",
            hint="Add --watch or --fetch FOLDER, or leave it to `marey jobs wait JOB --timeout SECONDS`.",
        )


def _export_of(folder: Path | None, formats: list[str] | None, body: str | None) -> ExportOptions:
    """Return the options of the files that `--fetch` writes. Before anything is enqueued, the file of a body is read,
    and the folder and the formats that are made here are checked.

    Raises:
        InvalidInput: a file that is none, a format that is not known or cannot be made here, or a folder that cannot be
            written.
        NotFound, InvalidFile: of the file.
    """
    from marey.client.fetching import check_folder
    from marey.client.making import check_body, check_formats
    from marey.exporters import check_known

    export = ExportOptions(body=body)
    check_body(export)
    if folder is not None:
        hint = "One that only the server has: submit without --fetch, then `marey fetch JOB --format FORMAT`."
        check_known(formats or (), hint=hint)
        check_formats(formats, export)
        check_folder(folder, hint="Choose another folder for --fetch.")
    return export


def _all_problems(reader: rows.PromptReader, lines: Lines) -> InvalidItems:
    """List the problems of the rows, with those that only the server can find; submit nothing."""
    from marey.client import Client

    try:
        if len(lines):
            with Client() as client:
                client.jobs.check_lines(lines)
    except InvalidItems as error:
        reader.add(reader.located(error.problems))
        reader.total += error.total - len(error.problems)
    except MareyError as error:
        return reader.error(more=f"Lengths and models were not checked: {error.message}.")
    return reader.error()


def _show_check(checked: CheckedJob, *, as_json: bool) -> None:
    """Say what a check found; as JSON, write the server's answer too."""
    show_capacity(checked)
    _show_scope(checked)
    if as_json:
        console.result_json(checked.raw)


def show_capacity(checked: CheckedJob | CheckedEdit) -> None:
    """Say what a check found: the number of motions, quotas, and the time that it takes."""
    many = "motion" if checked.items == 1 else "motions"
    console.say(f"{checked.items} {many} would be made, with {', '.join(checked.bundles)}; nothing was submitted.")
    for quota in checked.quotas:
        size = console.size if quota.name == "bytes" else str
        of_what = "queued items" if quota.name == "queued" else "stored bytes"
        console.say(
            f"It takes {size(quota.asked)} of the quota of {of_what}: "
            f"{size(quota.used)} of {size(quota.limit)} are used, {size(quota.left)} left."
        )
    estimate = checked.estimate
    if estimate.seconds is not None:
        behind = f", behind {checked.waiting} that wait now" if checked.waiting else ""
        console.say(f"That takes about {console.length_of_time(estimate.seconds)}{behind}.")
    console.say(estimate.basis)


def _show_scope(checked: CheckedJob) -> None:
    report = checked.scope_report
    if report is None:
        return
    if report.unlisted:
        console.say(f"{report.unlisted} prompts have no scope: their bundle lists no actions.")
    how = "words and meaning" if report.by == "encoder" else "words only"
    console.say(
        f"Prompts by {how}: {report.known} known, {report.close} close, {report.tried} tried, {report.unknown} unknown."
    )
    console.warn_all(checked.warnings)


def report_gaps(items: Iterable[Item]) -> Iterator[Item]:
    """Yield items, and say of the first timelines with gaps between rows that the model fills them."""
    found = 0
    for item in items:
        gaps = () if item.timeline is None else timeline_gaps(item.timeline)
        if gaps and (found := found + 1) <= MAX_GAP_NOTES:
            times = ", ".join(f"{start:g}-{end:g}" for start, end in gaps)
            console.say(f"{item.prompt[:60]!r} has no prompt at {times} s: the model fills it without one.")
        yield item
    if found > MAX_GAP_NOTES:
        console.say(f"{found - MAX_GAP_NOTES} more timelines have such gaps.")


def row_defaults(sampling: list[str] | None, **given: Unpack[Defaults]) -> Mapping[str, object]:
    """Return the fields of rows that do not set them, from the options of a command.

    Args:
        sampling: the values of `--set`.

    Raises:
        InvalidInput: an option is out of range, or a `--set` is not NAME=VALUE.
    """
    given["settings"] = options.settings_of(sampling or ())
    return rows.defaults_of(**given)


def read_prompts(
    prompts: list[str] | None,
    file: str | None,
    input_format: rows.Format | None,
    defaults: Mapping[str, object] = rows.NO_DEFAULTS,
    extra_columns: ExtraColumns = "refuse",
    timelines: list[str] | None = None,
) -> rows.PromptReader:
    """The items of PROMPT…, of --timeline or of -f.

    Args:
        defaults: `row_defaults` of the options of the command.
        extra_columns: of a CSV.

    Raises:
        InvalidInput: none or both are given, or what is there cannot be used.
    """
    given = [name for name, value in (("PROMPT", prompts), ("--timeline", timelines), ("-f", file)) if value]
    if len(given) > 1:
        raise InvalidInput(f"both {' and '.join(given[:2])} are given", hint=f"Give either {' or '.join(given)}.")
    if timelines:
        return rows.read_timelines(timelines, defaults)
    if file:
        return rows.read_file(file, input_format, defaults, extra_columns)
    for prompt in prompts or ():
        if prompt.lower().removesuffix(".gz").endswith((".csv", ".jsonl", ".txt")) and " " not in prompt:
            raise InvalidInput("is a file name, not a prompt", where=prompt, hint=f"Give it with -f: `-f {prompt}`.")
    if not prompts:
        raise InvalidInput("no prompt is given", hint="Give one or more in quotes, or a file of them with -f.")
    return rows.read_arguments(prompts, defaults)


def _follow(
    client: Client,
    job: str,
    folder: Path | None,
    formats: list[str] | None,
    template: str,
    timeout: float | None,
    as_json: bool,
    export: ExportOptions,
) -> None:
    from marey.cli.commands.fetch import write_job
    from marey.cli.watching import check_ended, watch_job

    ended = watch_job(client, job, timeout=timeout)
    if folder is not None:
        write_job(client, job, folder, formats, template=template, export=export, as_json=as_json)
    check_ended(ended)
