"""`manifest.csv` beside fetched clips: a line a motion, for a spreadsheet or a pipeline. Standard library only."""

from __future__ import annotations

import csv
import json
import re
import stat
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from marey.client.csv_cells import join_tags, restore, write_csv
from marey.core.errors import Conflict, InvalidInput
from marey.core.whole_files import whole_file
from marey.exporters import extension_of
from marey.items.timeline import timeline_text

NAME = "manifest.csv"
RECORD = ".manifest-earlier.csv"
"""Lines of earlier manifests of the folder whose files still exist; the file exists only if there are such lines."""
PLAIN = re.compile(r"([^/\\:.\x00-\x1f][^/\\:\x00-\x1f]*/)*[^/\\:.\x00-\x1f][^/\\:\x00-\x1f]*")
"""Paths that stay in their folder, as `names.file_name` makes them: no part begins with a dot."""
RAW_COLUMNS = (
    *("index", "name", "tags", "prompt", "seed", "state", "review", "npz", "bvh", "licence", "variant", "model"),
    *("bundle", "frames", "fps", "error", "comment", "replaces", "motion", "item", "job"),
)
"""Of files of earlier releases, whose cells hold the text as it is."""
COLUMNS = (*RAW_COLUMNS, "seconds", "quality")
"""Of the file, whose cells are those of `csv_cells`. `npz` and `bvh` are paths of files from its folder; `comment` is
the review's; `seconds` is the length that was asked for; `quality` is `ok` or what is wrong with the motion. Other
formats have columns behind these: `OTHER`; then come `OF_ITEMS`."""
NUMBERS = frozenset({"index", "seed", "variant", "frames", "fps", "seconds"})
Row = dict[str, str]
FORMATS = ("npz", "bvh")
"""Formats that always have a column."""
OTHER = re.compile(r"file:([a-z0-9]{1,16})")
"""The column of another format, where there is such a file."""
TIMELINE, CONSTRAINTS = "timeline", "constraints"
OF_ITEMS = (TIMELINE, CONSTRAINTS)
"""Columns of fields that few items have, where there is one: the text form of a timeline, and JSON."""


def check_manifest(folder: Path, *, overwrite: bool) -> None:
    """Check that a manifest may be written to a folder.

    Raises:
        Conflict: it has a `manifest.csv` of another program.
    """
    if not overwrite:
        _read(folder / NAME)


def row_of(item: dict[str, Any], files: dict[str, str]) -> Row:
    """Return the line of an item of the API; `files` are file names by format."""
    motion: Mapping[str, Any] = item["motion"] or {}
    review: Mapping[str, Any] = motion.get("review") or {}
    paths = {format if format in FORMATS else f"file:{format}": name for format, name in files.items()}
    values: dict[str, Any] = {
        **{name: item[name] for name in ("index", "name", "prompt", "seed", "state", "variant", "model", "bundle")},
        "seconds": item.get("seconds"),
        **{name: motion.get(name) for name in ("licence", "frames", "fps")},
        **paths,
        "tags": join_tags(item["tags"]),
        "quality": flags_of(motion),
        "review": review.get("verdict"),
        "comment": review.get("comment"),
        "error": item["error"] and item["error"].get("message"),
        "replaces": item["replaces"],
        "motion": motion.get("id"),
        "item": item["id"],
        "job": item["job"],
    }
    if item.get("timeline"):
        values[TIMELINE] = timeline_text(item["timeline"])
    if item.get("constraints"):
        values[CONSTRAINTS] = json.dumps(item["constraints"], separators=(",", ":"))
    return {name: "" if values.get(name) is None else str(values[name]) for name in (*COLUMNS, *_others(values))}


def flags_of(motion: Mapping[str, Any]) -> str | None:
    """Return the flags of a motion, "ok" where it has none; None if its quality was not measured."""
    quality: Mapping[str, Any] | None = motion.get("quality")
    return None if quality is None else "; ".join(quality["flags"]) or "ok"


def write_manifest(
    folder: Path, job: str, rows: Sequence[Row], *, overwrite: bool = False, whole: bool = True
) -> list[Path]:
    """Write the lines of a job; those of other jobs in the same folder stay.

    Args:
        overwrite: replace a `manifest.csv` of another program.
        whole: the lines are all of the job; False = keep earlier lines of other items too.

    Returns:
        Files in the folder that this or an earlier manifest named for the job and the new one does not.

    Raises:
        Conflict: as `check_manifest`.
        InvalidInput: the folder cannot be written.
    """
    path = folder / NAME
    before = _known(path, overwrite=overwrite)
    if not whole:
        named = {row["item"] for row in rows}
        rows = [*rows, *(row for row in before if row["job"] == job and row["item"] not in named)]
    new = [*(row for row in before if row["job"] != job), *rows]
    left = _record(folder, [*_known(folder / RECORD, overwrite=True), *before], new)
    _write(path, new)  # after the record, so that an interruption loses no name
    return [folder / name for row, name in left if row["job"] == job]


def remove_left(folder: Path, left: Iterable[Path]) -> None:
    """Remove the files that `write_manifest` returned.

    Raises:
        InvalidInput: a file cannot be removed.
    """
    for path in left:
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise InvalidInput(f"cannot be removed: {error.strerror}", where=str(path)) from error
        with suppress(OSError):  # sub-folders that are not empty stay
            for parent in path.relative_to(folder).parents[:-1]:
                (folder / parent).rmdir()
    _record(folder, _known(folder / RECORD, overwrite=True), _known(folder / NAME, overwrite=True))


def _record(folder: Path, earlier: Iterable[Row], now: Iterable[Row]) -> list[tuple[Row, str]]:
    """Record the earlier lines whose files no current line names; return these files, each with its line."""
    named = {name.casefold() for row in now for name in _files(row)}
    found = {name: row for row in earlier for name in _files(row) if name.casefold() not in named}
    left = [(row, name) for name, row in found.items() if _is_file(folder, name)]
    if left:
        _write(folder / RECORD, list({tuple(_files(row)): row for row, _ in left}.values()))
    else:
        (folder / RECORD).unlink(missing_ok=True)
    return left


def _known(path: Path, *, overwrite: bool) -> list[Row]:
    """Return the lines of a manifest; of another program's file none if it may be overwritten."""
    try:
        return _read(path)
    except Conflict:
        if not overwrite:
            raise
        return []


def _files(row: Row) -> list[str]:
    """Return the names of a line's files; names that are not plain are skipped, because the line may be forged."""
    columns = (*FORMATS, *(name for name in _others(row) if name not in OF_ITEMS))
    names = ((row[column], f".{extension_of(column.removeprefix('file:'))}") for column in columns)
    return [name for name, ending in names if PLAIN.fullmatch(name) and name.endswith(ending)]


def is_column(name: str) -> bool:
    """Return True if a manifest may have this column."""
    return name in (*COLUMNS, *OF_ITEMS) or OTHER.fullmatch(name) is not None


def _others(names: Iterable[str]) -> list[str]:
    """Columns among these of formats other than `FORMATS`, in alphabetical order, and `OF_ITEMS`."""
    found = set(names)
    return [*sorted(name for name in found if OTHER.fullmatch(name)), *(name for name in OF_ITEMS if name in found)]


def _is_file(folder: Path, name: str) -> bool:
    """Return True if this is a file of the folder: no link to one, and not behind a link that leads out of it."""
    path = folder / name
    try:
        inside = path.parent.resolve().is_relative_to(folder.resolve())
        return inside and stat.S_ISREG(path.lstat().st_mode)
    except OSError:
        return False


def _write(path: Path, rows: Iterable[Row]) -> None:
    rows = list(rows)
    others = _others(name for row in rows for name, cell in row.items() if cell)
    content = write_csv((*COLUMNS, *others), ({**dict.fromkeys(others, ""), **row} for row in rows), numbers=NUMBERS)
    if not path.exists() or path.read_bytes() != content:
        _replace(path, content)


def _read(path: Path) -> list[Row]:
    """Return the lines of a manifest; none if there is no file."""
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            reader = csv.DictReader(stream, strict=True)
            columns = tuple(reader.fieldnames or ())
            others = columns[len(COLUMNS) :]
            if columns == RAW_COLUMNS or columns == (*COLUMNS, *_others(others)):
                text = str if columns == RAW_COLUMNS else restore
                return [{name: text(row.get(name) or "") for name in (*COLUMNS, *others)} for row in reader]
    except FileNotFoundError:
        return []
    except (UnicodeDecodeError, csv.Error):
        pass
    except OSError as error:
        raise InvalidInput(f"cannot be read: {error.strerror}", where=str(path)) from error
    raise Conflict(
        "already exists and is not a manifest of fetched motions",
        where=str(path),
        hint="Choose another folder, or pass overwrite=True.",
        argument="overwrite",
    )


def _replace(path: Path, content: bytes) -> None:
    try:
        with whole_file(path, durable=True) as part:
            part.write_bytes(content)
    except OSError as error:
        raise InvalidInput(f"cannot be written: {error.strerror}", where=str(path)) from error
