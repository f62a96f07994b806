"""`marey review`: all motions of a job on pages to look at."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from services.cli import console
from services.cli.commands.motions import Review, review_of
from shared.errors import Conflict, InvalidInput, NotFound

if TYPE_CHECKING:
    from services.cli.client import Client
    from shared.motion.clip import MotionClip

PER_PAGE = {".html": 48, ".htm": 48, ".png": 24}
MOST_A_PAGE = 100
"""A hundred strips are a picture of 33,000 pixels; a hundred players 5 MB."""
MOST = 1000
"""Motions of one call."""
CONTINUED = re.compile(r"-from-\d+$")
"""How a call that goes on is told to name its first page."""


def review(
    job: Annotated[str, typer.Argument(metavar="JOB", help="The job's id.")],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="A .html (3D players) or .png (contact sheet); then -2, -3, …"),
    ] = Path("review.html"),
    reviews: Annotated[
        list[Review] | None, typer.Option("--review", help="Only motions of which this was said; may be repeated.")
    ] = None,
    tags: Annotated[list[str] | None, typer.Option("--tag", help="Only motions with this tag.")] = None,
    per_page: Annotated[
        int | None, typer.Option("--per-page", min=1, max=MOST_A_PAGE, help="Motions a page: 48, of a .png 24.")
    ] = None,
    skip: Annotated[int, typer.Option("--skip", min=0, help="Leave out so many at the start.")] = 0,
    limit: Annotated[int, typer.Option("--limit", min=1, max=MOST, help="Show at most so many.")] = MOST,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace pages that are there already.")] = False,
) -> None:
    """Draw the motions of a job, in the order they were made, on pages to choose by or on contact sheets."""
    from services.cli.client import Client
    from services.cli.extras import needs_extra

    try:
        import shared.motion.gallery  # noqa: F401
    except ImportError as error:
        raise needs_extra("motion", error) from error
    if output.suffix.lower() not in PER_PAGE:
        raise InvalidInput("is neither a .png nor a .html", where=str(output), hint="The ending says what to draw.")
    size = per_page or PER_PAGE[output.suffix.lower()]
    with Client.here() as client:
        found, more = _motions(client, job, reviews, tags, skip, limit)
        name = client.get(f"/v1/jobs/{job}")["name"] or f"Job {job}"
        pages = [found[first : first + size] for first in range(0, len(found), size)]
        paths = [
            output.with_stem(output.stem + (f"-{number}" if number > 1 else "")) for number in range(1, len(pages) + 1)
        ]
        _check_free(paths, overwrite=overwrite)
        with console.bar() as bar:
            task = bar.add_task("drawing", total=len(found))
            for number, page in enumerate(pages):
                first = skip + number * size
                told = f"{first + 1} to {first + len(page)} of {skip + len(found)}{' and more' if more else ''}"
                clips = list(_clips(client, page))
                if paths[number].suffix.lower() == ".png":
                    _sheet(page, clips, paths[number], f"{name}: {told}")
                else:
                    beside = [None, *(path.name for path in paths), None]
                    _page(page, clips, paths[number], name, told, beside[number], beside[number + 2])
                bar.advance(task, len(page))
    for path in paths:
        console.result(console.home_relative(path))
    if more:
        skipped = skip + len(found)
        following = output.with_stem(f"{CONTINUED.sub('', output.stem)}-from-{skipped + 1}")
        console.say(
            f"There are more: `--skip {skipped} -o {console.home_relative(following)}` goes on; "
            "--limit, --review and --tag choose."
        )


def _check_free(paths: Sequence[Path], *, overwrite: bool) -> None:
    """Nothing, if the pages may be written.

    Raises:
        Conflict: one is there already.
    """
    there = [path for path in paths if path.exists()]
    if there and not overwrite:
        more = f", and {len(there) - 1} more of {len(paths)} pages" if len(there) > 1 else ""
        raise Conflict(
            f"is there already{more}",
            where=str(there[0]),
            hint="Name another file with -o, or --overwrite.",
        )


def _motions(
    client: Client, job: str, reviews: list[Review] | None, tags: list[str] | None, skip: int, limit: int
) -> tuple[list[dict[str, Any]], bool]:
    """The motions to show, and whether there are more.

    Raises:
        NotFound: none.
    """
    params = {"review": [review.value for review in reviews] if reviews else None, "tag": tags, "limit": 1000}
    listed = islice(client.pages(f"/v1/jobs/{job}/motions", **params), skip, skip + limit + 1)
    found = list(listed)
    if not found:
        raise NotFound(
            "no motion of this job fits",
            where=f"job {job}",
            hint=f"`marey motions list --job {job}` shows what is there.",
        )
    return found[:limit], len(found) > limit


def _sheet(motions: Sequence[dict[str, Any]], clips: list[MotionClip], path: Path, title: str) -> None:
    from shared.motion.render import contact_sheet

    captions = [f"{_facts(motion)}  ·  {motion['prompt']}" for motion in motions]
    contact_sheet(clips, path, captions=captions, title=title)


def _page(
    motions: Sequence[dict[str, Any]],
    clips: list[MotionClip],
    path: Path,
    title: str,
    count: str,
    earlier: str | None,
    later: str | None,
) -> None:
    from shared.motion.gallery import Card, html_gallery

    cards = [
        Card(motion["id"], clip, motion["prompt"], _facts(motion), motion["tags"], _said(motion))
        for motion, clip in zip(motions, clips, strict=True)
    ]
    html_gallery(cards, path, title=title, count=count, earlier=earlier, later=later)


def _clips(client: Client, motions: Sequence[dict[str, Any]]) -> Iterator[MotionClip]:
    """The motions' npz, fetched eight at a time into a folder that goes again."""
    from services.cli.fetching import Download, download_all
    from shared.motion.clip import load_npz

    with tempfile.TemporaryDirectory(prefix="marey-review-") as folder:
        downloads = [_download(motion, Path(folder), Download) for motion in motions]
        download_all(client, downloads, overwrite=False, done=lambda _: None)
        for download in downloads:
            yield load_npz(download.path)


def _download(motion: dict[str, Any], folder: Path, kind: Any) -> Any:
    file = next((file for file in motion["files"] if file["format"] == "npz"), None)
    if file is None:
        raise NotFound(
            "has no npz to draw", where=f"motion {motion['id']}", hint="If it is being erased, wait a moment."
        )
    url = f"/v1/motions/{motion['id']}/files/npz"
    return kind(url, file["sha256"], file["size"], folder / f"{motion['id']}.npz")


def _facts(motion: dict[str, Any]) -> str:
    take = ["take of another"] if motion["replaces"] else []
    name = [motion["name"]] if motion["name"] else []
    length = f"{motion['frames'] / motion['fps']:.1f} s"
    return "  ·  ".join([f"{motion['index']:05}", *name, f"seed {motion['seed']}", length, *take])


def _said(motion: dict[str, Any]) -> str:
    verdict = review_of(motion)
    if verdict is None:
        return ""
    comment = motion["review"]["comment"]
    return f"{verdict} by {motion['review']['by']}" + (f": {comment}" if comment else "")
