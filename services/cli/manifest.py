"""`manifest.csv` beside fetched clips: a line a motion, for a spreadsheet or a pipeline. Standard library only."""

from __future__ import annotations

import csv
import io
import os
import secrets
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from services.cli.rows import TAG_SEPARATOR
from shared.errors import Conflict, InvalidInput

NAME = "manifest.csv"
COLUMNS = (
    *("index", "name", "tags", "prompt", "seed", "state", "review", "npz", "bvh", "licence", "variant", "model"),
    *("bundle", "frames", "fps", "error", "comment", "replaces", "motion", "item", "job"),
)
"""Of the file. `npz` and `bvh` are names of files beside it; `comment` is the review's."""
Row = dict[str, str]


def check_manifest(folder: Path, *, overwrite: bool) -> None:
    """Nothing, if a manifest may be written here.

    Raises:
        Conflict: there is a `manifest.csv` that we did not write.
    """
    if not overwrite:
        _read(folder / NAME)


def row_of(item: dict[str, Any], files: dict[str, str]) -> Row:
    """The line of one item of the API; `files` are file names by format."""
    motion = item["motion"] or {}
    review = motion.get("review") or {}
    values = {
        **{name: item[name] for name in ("index", "name", "prompt", "seed", "state", "variant", "model", "bundle")},
        **{name: motion.get(name) for name in ("licence", "frames", "fps")},
        **files,
        "tags": f"{TAG_SEPARATOR} ".join(item["tags"]),
        "review": review.get("verdict"),
        "comment": review.get("comment"),
        "error": (item["error"] or {}).get("message"),
        "replaces": item["replaces"],
        "motion": motion.get("id"),
        "item": item["id"],
        "job": item["job"],
    }
    return {name: "" if values.get(name) is None else str(values[name]) for name in COLUMNS}


def write_manifest(folder: Path, job: str, rows: Sequence[Row], *, overwrite: bool = False) -> Path:
    """Write the lines of a job; those of other jobs, whose clips lie in the same folder, stay.

    Raises:
        Conflict: as `check_manifest`.
        InvalidInput: the folder cannot be written.
    """
    path = folder / NAME
    try:
        others = [row for row in _read(path) if row["job"] != job]
    except Conflict:
        if not overwrite:
            raise
        others = []
    content = _format((*others, *rows))
    if not path.exists() or path.read_bytes() != content:
        _replace(path, content)
    return path


def _format(rows: Iterable[Row]) -> bytes:
    buffer = io.StringIO(newline="")
    writer = csv.DictWriter(buffer, COLUMNS)
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue().encode()


def _read(path: Path) -> list[Row]:
    """The lines of a manifest of ours; none where there is no file."""
    try:
        with path.open(newline="", encoding="utf-8") as stream:
            reader = csv.DictReader(stream, strict=True)
            if tuple(reader.fieldnames or ()) == COLUMNS:
                return [{name: row[name] or "" for name in COLUMNS} for row in reader]
    except FileNotFoundError:
        return []
    except (UnicodeDecodeError, csv.Error):
        pass
    except OSError as error:
        raise InvalidInput(f"cannot be read: {error.strerror}", where=str(path)) from error
    raise Conflict(
        "is there already and is no manifest of fetched motions",
        where=str(path),
        hint="Choose another folder, or --overwrite.",
    )


def _replace(path: Path, content: bytes) -> None:
    part = path.with_name(f".{NAME}.{secrets.token_hex(4)}.part")
    try:
        with part.open("xb") as stream:
            stream.write(content)
            stream.flush()
            os.fsync(stream.fileno())
        part.replace(path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InvalidInput(f"cannot be written: {error.strerror}", where=str(path)) from error
