"""`captions-AUTHOR.csv` beside an index: what each author says about its clips.

The columns are `id`, of a clip of the index, and `captions`, several of them joined by ` | `.
"""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile
from marey.data.index import MAX_BYTES, SEPARATOR, Row

PATTERN = "captions-*.csv"
COLUMNS = ("id", "captions")


@dataclass(frozen=True)
class CaptionFile:
    """Captions by one author.

    Attributes:
        name: of the file.
        sha256: of its content.
        captions: by id of the clip.
    """

    name: str
    sha256: str
    captions: Mapping[str, tuple[str, ...]]


def read_caption_files(folder: Path, rows: Sequence[Row]) -> tuple[CaptionFile, ...]:
    """Read all caption files of a folder, in the order of their names.

    Args:
        folder: that of the index.
        rows: of the index; rows that are not to be used may have captions too.

    Raises:
        InvalidFile: not UTF-8, other columns, a line without captions, or an id that no row or an earlier line has,
            with file and line.
    """
    ids = {row.id for row in rows}
    return tuple(_read(path, ids) for path in sorted(folder.glob(PATTERN)))


def _read(path: Path, ids: set[str]) -> CaptionFile:
    data, where = read_bytes(path, limit=MAX_BYTES), str(path)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidFile(f"is not UTF-8: {error.reason}", where=where) from None
    reader = csv.DictReader(io.StringIO(text, newline=""))
    if tuple(reader.fieldnames or ()) != COLUMNS:
        raise InvalidFile(f"its header is not {','.join(COLUMNS)}", where=where)
    captions = dict[str, tuple[str, ...]]()
    for cells in reader:
        place = f"{where}, line {reader.line_num}"
        if None in cells or None in cells.values():
            raise InvalidFile("has not as many cells as the header", where=place, hint="Quote cells that hold commas.")
        name, said = cells["id"].strip(), tuple(s for part in cells["captions"].split(SEPARATOR) if (s := part.strip()))
        if name not in ids:
            raise InvalidFile(
                f"the index has no clip {name!r}", where=place, hint="Write its id as the index gives it."
            )
        if name in captions:
            raise InvalidFile(f"{name!r} has a line already", where=place)
        if not said:
            raise InvalidFile(f"says nothing about {name!r}", where=place)
        captions[name] = said
    return CaptionFile(path.name, hashlib.sha256(data).hexdigest(), captions)
