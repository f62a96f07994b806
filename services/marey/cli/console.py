"""Output: results on stdout, messages on stderr, and with `--json` one JSON object a line."""

from __future__ import annotations

import json
import os
import re
import sys
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import contextmanager
from itertools import islice
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from marey.core.characters import escape, escape_json, escaping, unescaped
from marey.core.errors import InvalidInput

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress

INTERRUPTED = 130
"""The exit code of a command that the user interrupted."""
Json = Annotated[bool, typer.Option("--json", help="One JSON object a line on stdout.")]
Limit = Annotated[
    int | None, typer.Option("--limit", min=1, help="Show at most this many; none given = all.", show_default=False)
]
Yes = Annotated[bool, typer.Option("--yes", "-y", help="Do not ask.")]
FullIds = Annotated[
    bool, typer.Option("--full-ids", "-l", help="Show whole ids; default: their last 8 digits, which commands accept.")
]
ID_COLUMNS = frozenset({"id", "job", "stream", "event", "item", "motion", "key", "replaced by"})
"""Columns of drawn tables that hold ids: they are short there, and never wrap."""
TARGET_COLUMNS = frozenset({"target"})
"""Columns that hold ids among other things: ids are short there too."""
_WHOLE_ID = re.compile(r"[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}")
TIME_COLUMNS = frozenset({"created", "next", "due", "at", "last used", "expires", "revoked", "started", "finished"})
SHORT = 8
PAGE = 1000
"""Elements of one request of a listing, and rows of one drawn table, so that long ones are not held in memory."""


def stderr() -> Console:
    """Return the console of messages."""
    return drawing(sys.stderr, soft_wrap=True)


def drawing(stream: TextIO, **options: Any) -> Console:
    """Return a console that draws on a stream; control characters in the text are escaped."""
    from rich.console import Console
    from rich.segment import Segment

    class EscapingConsole(Console):
        def render(self, renderable: Any, options: Any = None) -> Iterable[Segment]:
            for segment in super().render(renderable, options):
                yield segment if segment.control else segment._replace(text=escape(segment.text))

    return EscapingConsole(file=unescaped(stream), markup=False, emoji=False, highlight=False, **options)


def escape_output() -> None:
    """Escape control characters in everything that is written to stdout and stderr from now on, by any module: usage
    errors that quote an argument, warnings, tracebacks."""
    sys.stdout, sys.stderr = escaping(sys.stdout), escaping(sys.stderr)


@contextmanager
def escaped_output() -> Generator[None]:
    """Do as `escape_output` until the end of the block."""
    before = sys.stdout, sys.stderr
    escape_output()
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def say(text: str) -> None:
    """Print a message on stderr."""
    print(escape(text), file=sys.stderr, flush=True)  # noqa: T201


def warn_all(warnings: Iterable[str]) -> None:
    """Print warnings on stderr."""
    for warning in warnings:
        say(f"Warning: {warning}")


def result(text: str) -> None:
    """Print a result on stdout."""
    print(escape(text), flush=True)  # noqa: T201


def result_json(value: Any) -> None:
    """Print a result as one line of JSON on stdout; control characters are `\\u` escapes."""
    utf8 = (getattr(sys.stdout, "encoding", None) or "").lower().replace("-", "") == "utf8"
    result(escape_json(json.dumps(value, ensure_ascii=not utf8, separators=(", ", ": "))))


def short_id(identifier: str) -> str:
    """Return the last digits of an id, which are random; the first are a time."""
    return identifier.replace("-", "")[-SHORT:]


def moment(time: str) -> str:
    """Shorten a time of the API to `2026-11-24 08:05`, in UTC."""
    return time[:16].replace("T", " ")


def table(columns: Sequence[str], rows: Iterable[Sequence[object]], *, full_ids: bool = False) -> None:
    """Print results as a table on stdout: drawn for a terminal, tab-separated for a pipe.

    Args:
        full_ids: print whole ids on a terminal too; a pipe always gets whole ids and times.
    """
    if not sys.stdout.isatty():
        for row in rows:
            result("\t".join(_cell(value) for value in row))
        return
    left = iter(rows)
    piece = list(islice(left, PAGE))
    while True:
        _draw(columns, piece, full_ids=full_ids)
        piece = list(islice(left, PAGE))
        if not piece:
            return


def _draw(columns: Sequence[str], rows: Iterable[Sequence[object]], *, full_ids: bool) -> None:
    from rich.table import Table
    from rich.text import Text

    drawn = Table(box=None, header_style="bold", pad_edge=False)
    for column in columns:
        drawn.add_column(column, overflow="fold", no_wrap=column in ID_COLUMNS)
    for row in rows:
        cells = (_shown(column, _cell(value), full_ids=full_ids) for column, value in zip(columns, row, strict=True))
        drawn.add_row(*map(Text, cells))
    drawing(sys.stdout).print(drawn)


def listing(
    found: Iterable[Mapping[str, Any]],
    columns: Sequence[str],
    cell: Callable[[Any, str], object],
    *,
    as_json: bool,
    limit: int | None = None,
    full_ids: bool = False,
) -> None:
    """Print the elements of a listing as they arrive: a line of JSON each, or a table.

    Args:
        cell: returns the value of a column, from an element's JSON.
        limit: the largest number of elements to print, with a message if there are more; None = all.
    """
    left = iter(found)
    shown = islice(left, limit)
    if as_json:
        for each in shown:
            result_json(each)
    else:
        table(columns, ([cell(each, column) for column in columns] for each in shown), full_ids=full_ids)
    if limit is not None and next(left, None) is not None:
        say(f"Showing the first {limit}; use --limit to see more.")


def page_size(limit: int | None) -> int:
    """Return the number of elements of one request of a listing that shows at most `limit`."""
    return PAGE if limit is None else min(limit, PAGE)


def bar() -> Progress:
    """Return a progress bar on stderr; without a terminal it prints nothing by itself. An error before any progress
    takes the bar away."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    class Bar(Progress):
        def __exit__(
            self, kind: type[BaseException] | None, error: BaseException | None, place: TracebackType | None
        ) -> None:
            if error is None or any(task.completed for task in self.tasks):
                super().__exit__(kind, error, place)
            else:
                self.live.transient = True
                self.live.stop()

    return Bar(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        console=stderr(),
    )


@contextmanager
def goes_on(what: str, hint: str) -> Generator[None]:
    """Report on Ctrl-C in the block that only the command ends.

    Args:
        what: continues on the server.
        hint: commands that watch or end it.
    """
    try:
        yield
    except KeyboardInterrupt:
        say(f"{what} goes on.\n  {hint}")
        raise


def can_ask() -> bool:
    """Return True if there is a terminal to ask a person at."""
    return sys.stdin is not None and sys.stdin.isatty()


def confirm(question: str, *, yes: bool) -> None:
    """Ask a person whether to go on; pass without asking where `yes` is set.

    Raises:
        InvalidInput: there is no terminal to ask at.
        typer.Exit: the person says no.
    """
    if yes:
        return
    if not can_ask():
        raise InvalidInput(f"{question} There is no terminal to ask this at.", hint="-y does it unasked.")
    try:
        agreed = typer.confirm(question, err=True)
    except typer.Abort:
        raise KeyboardInterrupt from None  # Ctrl-C, or the end of the input
    if not agreed:
        say("nothing was done")
        raise typer.Exit(INTERRUPTED)


def home_relative(path: str | os.PathLike[str]) -> str:
    """Return a path relative to the working directory if it is below it, else as it is."""
    text = os.fspath(path)
    try:
        relative = os.path.relpath(text)
    except OSError:  # the working directory was removed
        return text
    return text if relative.startswith("..") else relative


def length_of_time(seconds: float) -> str:
    """Format seconds as `45 s`, `12 min` or `3 h 20 min`."""
    if seconds < 90:
        return f"{max(round(seconds), 1)} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


def size(count: int) -> str:
    """Format bytes as `512 B` or `1.5 GiB`."""
    for place, unit in enumerate("TGMK"):
        of_it = 2 ** (40 - 10 * place)
        if count >= of_it:
            return f"{count / of_it:.3g} {unit}iB"
    return f"{count} B"


def _shown(column: str, cell: str, *, full_ids: bool) -> str:
    """Return the text of a cell of a drawn table."""
    if column in TIME_COLUMNS:
        return moment(cell) if cell[:1].isdigit() else cell
    is_id = column in ID_COLUMNS | TARGET_COLUMNS and _WHOLE_ID.fullmatch(cell)  # the id of a tenant is its name
    return short_id(cell) if is_id and not full_ids else cell


def _cell(value: object) -> str:
    if value is None:
        return ""
    text = f"{value:g}" if isinstance(value, float) else str(value)
    return escape(text.replace("\n", " ").replace("\t", " "))
