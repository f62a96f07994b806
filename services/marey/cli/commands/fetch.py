"""`marey fetch`, and the output lines of a job."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marey.cli import console, options
from marey.cli.exporting import FetchedBody, FetchedRig, with_export
from marey.cli.references import FORMS, find_all
from marey.client.names import check_template
from marey.motion.export_options import PLAIN, ExportOptions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from marey.client import Client, FetchedItem


class FetchReviewOption(StrEnum):
    """Reviews of a motion."""

    KEPT = "kept"
    REJECTED = "rejected"
    REROLLED = "rerolled"


@with_export(instead={"rig": FetchedRig, "body": FetchedBody})
def fetch(
    jobs: Annotated[list[str], typer.Argument(metavar="JOB…", help=f"Jobs whose motions to fetch: {FORMS}.")],
    output: options.Folder = Path(),
    formats: options.Formats = None,
    name_template: options.Template = options.TEMPLATE,
    export: ExportOptions = PLAIN,
    reviews: Annotated[
        list[FetchReviewOption] | None,
        typer.Option("--review", help="Only motions with this review; repeated: any of them."),
    ] = None,
    prune: Annotated[
        bool,
        typer.Option("--prune", help="Remove files of earlier fetches that are no longer part of the job's selection."),
    ] = False,
    overwrite: options.Overwrite = False,
    as_json: console.Json = False,
) -> None:
    """Fetch the motions of jobs: eight files at a time, resumed and verified, with a manifest.csv.

    Of several jobs, each has its folder. Files with options, and formats that the server does not have, are
    made here of the npz.
    """
    from marey.client import Client

    check_template(name_template)
    with Client() as client:
        found = find_all(client, "job", jobs)
        for job in found:
            folder = output if len(found) == 1 else output / job.id
            write_job(
                client, job.id, folder, formats,
                template=name_template, reviews=reviews or (), prune=prune, overwrite=overwrite, export=export,
                as_json=as_json,
            )  # fmt: skip


def write_job(
    client: Client,
    job: str,
    folder: Path,
    formats: Sequence[str] | None,
    *,
    template: str = options.TEMPLATE,
    reviews: Sequence[FetchReviewOption] = (),
    prune: bool = False,
    overwrite: bool = False,
    export: ExportOptions = PLAIN,
    as_json: bool = False,
) -> None:
    """Fetch the files that a job has so far and print a line for each of its items, in input order."""
    lines = fetch_job(
        client, job, folder, formats,
        template=template, reviews=reviews, prune=prune, overwrite=overwrite, export=export,
    )  # fmt: skip
    for line in lines:
        if as_json:
            console.result_json(line)
        else:
            for path in line["files"].values():
                console.result(console.home_relative(path))
    waiting = sum(line["state"] in ("ready", "leased") for line in lines)
    if waiting:
        console.say(f"{waiting} items of job {job} are not done yet; fetch again later.")
    if reviews and not lines:
        named = " or ".join(review.value for review in reviews)
        console.say(f"no motion of job {job} is {named}: `marey motions keep ID…` marks motions as kept.")


def fetch_job(
    client: Client,
    job: str,
    folder: Path,
    formats: Sequence[str] | None = None,
    *,
    template: str = options.TEMPLATE,
    reviews: Sequence[FetchReviewOption] = (),
    prune: bool = False,
    overwrite: bool = False,
    export: ExportOptions = PLAIN,
) -> list[dict[str, Any]]:
    """Fetch the files that a job has so far, with a progress bar, and return the output lines of its items.

    Args:
        reviews: items whose motion has one of these; none = all.
        prune: remove files that earlier manifests named for the job and this one does not.
        export: options of the files.
    """
    from marey.cli.fetch_progress import FetchProgress

    with FetchProgress(job, folder) as progress:
        fetched = client.jobs.fetch(
            job, folder,
            formats=formats or None, name_template=template,
            review=[review.value for review in reviews], prune=prune, overwrite=overwrite,
            on_progress=progress, **export.values,
        )  # fmt: skip
    for message in progress.left:
        console.say(message)
    return [output_line(each) for each in fetched]


def output_line(fetched: FetchedItem) -> dict[str, Any]:
    """Return the output line of an item."""
    item = fetched.item.raw
    motion = item["motion"] or {}
    return {
        "job": item["job"],
        "item": item["id"],
        "motion": motion.get("id"),
        "name": item["name"],
        "prompt": item["prompt"],
        "variant": item["variant"],
        "model": item["model"],
        "bundle": item["bundle"],
        "licence": motion.get("licence"),
        "seed": item["seed"],
        "state": item["state"],
        "error": item["error"],
        "frames": motion.get("frames"),
        "fps": motion.get("fps"),
        "elapsed": motion.get("elapsed"),
        "quality": motion.get("quality"),
        "selection": motion.get("selection"),
        "scope": item.get("scope"),
        "files": {file_format: str(path.absolute()) for file_format, path in fetched.files.items()},
    }
