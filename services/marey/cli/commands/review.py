"""`marey review`: pages with all motions of a job."""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from marey.cli import console
from marey.cli.commands.takes import ReviewOption
from marey.cli.references import FORMS, find
from marey.core.errors import Conflict, InvalidInput, NotFound

if TYPE_CHECKING:
    from PIL.Image import Image

    from marey.cli.drawing import Drawers
    from marey.client import Client, Motion, Selection
    from marey.viz.gallery import Card, EditNote

ENDINGS = (".html", ".htm", ".png")
PER_PAGE = 400
"""A page of so many players has 20 MB."""
ROWS = 24
"""A sheet of more motions than this shows each as a tile; of these, as a row that takes the whole width."""
MOST = 1000
"""Motions of one call."""
CONTINUED = re.compile(r"-from-\d+$")
"""How a call that goes on is told to name its first page."""


def review(
    jobs: Annotated[
        list[str],
        typer.Argument(
            metavar="JOB…", help=f"The job: {FORMS}. Several are compared: motions of one prompt side by side."
        ),
    ],
    output: Annotated[
        Path,
        typer.Option("-o", "--output", help="A .html (3D players) or .png (contact sheet); several get -1, -2, …"),
    ] = Path("review.html"),
    reviews: Annotated[
        list[ReviewOption] | None, typer.Option("--review", help="Only motions with this review; may be repeated.")
    ] = None,
    tags: Annotated[list[str] | None, typer.Option("--tag", help="Only motions with this tag.")] = None,
    per_page: Annotated[
        int, typer.Option("--per-page", min=1, max=PER_PAGE, help="Most motions on a page.")
    ] = PER_PAGE,
    skip: Annotated[int, typer.Option("--skip", min=0, help="Skip the first so many motions.")] = 0,
    limit: Annotated[int, typer.Option("--limit", min=1, max=MOST, help="Show at most so many motions.")] = MOST,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace existing pages.")] = False,
) -> None:
    """Draw the motions of a job, in input order, on pages to choose from or on contact sheets.

    Several jobs of the same prompts, such as one of each model, stand side by side, prompt by prompt.

    A .png of up to 24 motions shows a row of each; one of more shows tiles.
    """
    from marey.cli.drawing import Drawers
    from marey.client import Client
    from marey.core.extras import extra

    with extra("motion"):
        import marey.viz.gallery  # noqa: F401
    if output.suffix.lower() not in ENDINGS:
        raise InvalidInput("is neither a .png nor a .html", where=str(output), hint="Use the extension .html or .png.")
    with Client() as client:
        ids = list(dict.fromkeys(find(client, "job", job).id for job in jobs))
        found, more = _motions(client, ids, reviews, tags, skip, limit)
        names = {job: client.jobs.get(job).name or f"Job {console.short_id(job)}" for job in ids}
        name = " and ".join(names.values())
        per_page = max(per_page // len(ids), 1) * len(ids)  # a page holds all motions of its last prompt
        pages = [found[first : first + per_page] for first in range(0, len(found), per_page)]
        paths = _paths(output, len(pages))
        sources = {motion.id: motion.prompt for motion in found}
        _check_free(paths, overwrite=overwrite)
        with console.bar() as bar, _together(paths) as drafts, Drawers(len(found)) as drawers:
            task = bar.add_task("drawing", total=len(found))
            book = _Book(client, names, sources, drawers, partial(bar.advance, task))
            beside = [None, *(path.name for path in paths), None]
            for number, page in enumerate(pages):
                first = skip + number * per_page
                count = f"{first + 1} to {first + len(page)} of {skip + len(found)}{' and more' if more else ''}"
                book.draw(page, drafts[number], (name, count), beside[number : number + 3 : 2])
    for path in paths:
        console.result(console.home_relative(path))
    if more:
        _say_more(output, skip + len(found))


@dataclass(frozen=True)
class _Book:
    """Draws pages.

    Attributes:
        names: of the jobs, by their ids.
        sources: prompts of motions, by their ids; see `_edit_note`.
        done: called with the number of motions that have been drawn.
    """

    client: Client
    names: Mapping[str, str]
    sources: dict[str, str]
    drawers: Drawers
    done: Callable[[int], None]

    def draw(
        self, motions: Sequence[Motion], path: Path, heading: tuple[str, str], beside: Sequence[str | None]
    ) -> None:
        """Draw a page, or a sheet where the path is a .png.

        Args:
            heading: title and count.
            beside: names of the page before and of that behind.
        """
        with tempfile.TemporaryDirectory(prefix="marey-review-") as folder:
            files = self.client.motions.fetch_all(motions, folder)
            is_sheet = path.suffix.lower() == ".png"
            facts = _facts(motions, self.names, sheet=is_sheet)
            if is_sheet:
                _sheet(motions, facts, files, path, ": ".join(heading), self.drawers, lambda: self.done(1))
            else:
                cards = _cards(self.client, motions, facts, files, self.sources)
                _page(cards, path, heading, beside, len(self.names))
                self.done(len(motions))


def _say_more(output: Path, shown: int) -> None:
    """Say how to go on after the first `shown` motions."""
    following = output.with_stem(f"{CONTINUED.sub('', output.stem)}-from-{shown + 1}")
    console.say(
        f"There are more: `--skip {shown} -o {console.home_relative(following)}` goes on; "
        "--limit, --review and --tag choose."
    )


def _paths(output: Path, pages: int) -> list[Path]:
    """The page's name; of several pages, numbered ones."""
    if pages == 1:
        return [output]
    return [output.with_stem(f"{output.stem}-{number}") for number in range(1, pages + 1)]


@contextmanager
def _together(paths: Sequence[Path]) -> Iterator[list[Path]]:
    """Where to write pages, so that they appear under their names when all of them are written.

    Raises:
        InvalidInput: the folder is missing or cannot be written to.
    """
    try:
        folder = tempfile.TemporaryDirectory(prefix=".marey-review-", dir=paths[0].parent)
    except OSError as error:
        raise InvalidInput(f"cannot be written: {error.strerror}", where=str(paths[0])) from None
    with folder as name:
        drafts = [Path(name) / path.name for path in paths]
        yield drafts
        for draft, path in zip(drafts, paths, strict=True):
            draft.replace(path)


def _check_free(paths: Sequence[Path], *, overwrite: bool) -> None:
    """Raise unless the pages may be written.

    Raises:
        Conflict: one exists.
    """
    there = [path for path in paths if path.exists()]
    if there and not overwrite:
        more = f", and {len(there) - 1} more of {len(paths)} pages" if len(there) > 1 else ""
        raise Conflict(
            f"already exists{more}",
            where=str(there[0]),
            hint="Name another file with -o, or use --overwrite.",
        )


def _motions(
    client: Client, jobs: Sequence[str], reviews: list[ReviewOption] | None, tags: list[str] | None,
    skip: int, limit: int,
) -> tuple[list[Motion], bool]:  # fmt: skip
    """Return the motions to show, in the order of the items, and True if there are more.

    Raises:
        NotFound: none.
    """
    wanted, of_each = {review.value for review in reviews or ReviewOption}, set(tags or ())

    def chosen(job: str) -> list[Motion]:
        motions = (item.motion for item in client.jobs.items(job, state="succeeded") if item.motion)
        fitting = (motion for motion in motions if of_each <= set(motion.tags) and _verdict(motion) in wanted)
        return list(islice(fitting, skip + limit + 1))

    found = _side_by_side([chosen(job) for job in jobs])[skip : skip + limit + 1]
    if not found:
        raise NotFound(
            "no motion of this job fits" if len(jobs) == 1 else "no motion of these jobs fits",
            where=f"job {', '.join(jobs)}",
            hint=f"`marey motions list --job {jobs[0]}` lists its motions.",
        )
    return found[:limit], len(found) > limit


def _side_by_side(of_jobs: Sequence[Sequence[Motion]]) -> list[Motion]:
    """Put the motions of each prompt together, in the order of the prompts, and edits behind their sources; a prompt
    that a job has several times is paired in order."""
    shown = {motion.id: motion for motions in of_jobs for motion in motions}
    groups: dict[object, list[Motion]] = {}
    of_motion: dict[str, list[Motion]] = {}
    for motions in of_jobs:
        seen = Counter[str]()
        for motion in motions:
            if not _has_source(motion, shown):
                of_motion[motion.id] = groups.setdefault((motion.prompt, seen[motion.prompt]), [])
                of_motion[motion.id].append(motion)
                seen[motion.prompt] += 1
    edits = [motion for motion in shown.values() if _has_source(motion, shown)]
    for motion in sorted(edits, key=lambda each: each.id):  # an edit of an edit comes later
        of_motion[motion.id] = of_motion[motion.edited_from[0]]
        of_motion[motion.id].append(motion)
    return [motion for group in groups.values() for motion in group]


def _has_source(motion: Motion, shown: Mapping[str, Motion]) -> bool:
    return bool(motion.edited_from) and motion.edited_from[0] in shown


def _sheet(
    motions: Sequence[Motion],
    facts: Sequence[str],
    files: Sequence[Path],
    path: Path,
    title: str,
    drawers: Drawers,
    done: Callable[[], None],
) -> None:
    from marey.cli.drawing import THEME, Drawing
    from marey.viz.overview import overview
    from marey.viz.paper import theme_named
    from marey.viz.render import COLUMNS, save_png, stack_rows

    columns = COLUMNS if len(motions) <= ROWS else None
    captions = [_caption(*each) for each in zip(facts, motions, strict=True)]
    drawings = [Drawing(file, caption, columns) for file, caption in zip(files, captions, strict=True)]

    def images() -> Iterator[Image]:
        for image in drawers.draw(drawings):
            yield image
            done()

    if columns is None:
        sheet = overview(images(), len(drawings), title, theme=theme_named(THEME))
    else:
        sheet = stack_rows(list(images()), title, theme=theme_named(THEME))
    save_png(sheet, path)


def _cards(
    client: Client,
    motions: Sequence[Motion],
    facts: Sequence[str],
    files: Sequence[Path],
    sources: dict[str, str],
) -> list[Card]:
    from marey.motion.clip import load_npz
    from marey.viz.gallery import Card

    cards: list[Card] = []
    for motion, file, fact in zip(motions, files, facts, strict=True):
        clip, flags = load_npz(file), motion.quality.flags if motion.quality else ()
        edit = _edit_note(client, motion, clip.manifest, sources)
        cards.append(Card(motion.id, clip, motion.prompt, fact, motion.tags, _review_text(motion), flags, edit))
    return cards


def _edit_note(client: Client, motion: Motion, manifest: Mapping[str, Any], sources: dict[str, str]) -> EditNote | None:
    """Describe an edit; None for a generated motion.

    Args:
        sources: prompts of motions, by id; those that are asked for are added. Empty = deleted.
    """
    from marey.viz.gallery import EditNote

    if not motion.edited_from:
        return None
    source = motion.edited_from[0]
    if source not in sources:
        try:
            sources[source] = client.motions.get(source).prompt
        except NotFound:
            sources[source] = ""
    record = manifest.get("edited_from", {})
    names = {each["sha256"]: each.get("name", each["sha256"]) for each in record.get("sources", ())}
    return EditNote(source, sources[source], ", ".join(_operation_text(op, names) for op in record.get("ops", ())))


def _operation_text(op: Mapping[str, Any], names: Mapping[str, str]) -> str:
    """Describe an operation in a few words, as `trim (from 0.5, to f30)`.

    Args:
        names: ids of joined motions, by the SHA-256 that operations of a manifest name them by.
    """
    values = {name: value for name, value in op.items() if name != "op" and value not in (None, False)}
    if "with" in values:
        values["with"] = console.short_id(names.get(values["with"], values["with"]))
    said = [name if value is True else f"{name} {_value_text(value)}" for name, value in values.items()]
    return f"{op['op']} ({', '.join(said)})" if said else str(op["op"])


def _value_text(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _page(
    cards: Sequence[Card], path: Path, heading: tuple[str, str], beside: Sequence[str | None], columns: int
) -> None:
    from marey.viz.gallery import html_gallery

    (title, count), (earlier, later) = heading, beside
    html_gallery(cards, path, title=title, count=count, earlier=earlier, later=later, columns=columns)


def _facts(motions: Sequence[Motion], jobs: Mapping[str, str], *, sheet: bool) -> list[str]:
    """Describe each motion in a line, with its job and its bundle where they are of several.

    Args:
        jobs: names of all jobs that are drawn, by their ids.
        sheet: without seed, length and bundle, which a contact sheet draws beside the line.
    """
    several = len({motion.bundle for motion in motions}) > 1 and not sheet
    return [
        _fact(
            motion,
            ([jobs[motion.job]] if len(jobs) > 1 else []) + ([motion.bundle.partition("@")[0]] if several else []),
            [] if sheet else [f"seed {motion.seed}", f"{motion.seconds:.1f} s"],
        )
        for motion in motions
    ]


def _fact(motion: Motion, made_by: Sequence[str], drawn: Sequence[str]) -> str:
    take = ["take of another"] if motion.replaces else []
    edit = [f"edit of {console.short_id(motion.edited_from[0])}"] if motion.edited_from else []
    name = [motion.name] if motion.name else []
    match = motion.quality.match if motion.quality else None
    shown = [f"match {match.value:g}"] if match and match.value is not None else []
    of = [_choice(motion.selection)] if motion.selection else []
    place = [f"{motion.index:05}", *name, *made_by, *drawn]
    return "  ·  ".join([*place, *of, *shown, *take, *edit])


def _caption(facts: str, motion: Motion) -> str:
    """Return the line over the poses of a motion on a contact sheet, which has no badges."""
    flags = motion.quality.flags if motion.quality else ()
    return "  ·  ".join([facts, *([", ".join(flags)] if flags else []), motion.prompt])


def _choice(selection: Selection) -> str:
    """Return the place of the chosen candidate, from 1: of those with constraints only the fitted ones are recorded, so
    its index may exceed their number."""
    drawn = [candidate.index for candidate in selection.candidates]
    return f"candidate {drawn.index(selection.chosen) + 1} of {len(drawn)}"


def _verdict(motion: Motion) -> str:
    return motion.review.verdict if motion.review else ReviewOption.NEW.value


def _review_text(motion: Motion) -> str:
    review = motion.review
    if review is None:
        return ""
    return f"{review.verdict} by {review.by}" + (f": {review.comment}" if review.comment else "")
