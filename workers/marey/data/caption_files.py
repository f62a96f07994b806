"""`captions-AUTHOR.csv` beside an index: captions of its clips by one author.

The columns are `id`, the id of a clip in the index, and `captions`, joined by ` | `.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile
from marey.data.csv_table import CsvTable
from marey.data.index import MAX_BYTES, SEPARATOR, Row

PATTERN = "captions-*.csv"
COLUMNS = ("id", "captions")


@dataclass(frozen=True)
class CaptionFile:
    """Captions by one author.

    Attributes:
        name: name of the file.
        sha256: hash of its content.
        captions: captions by id of the clip.
    """

    name: str
    sha256: str
    captions: Mapping[str, tuple[str, ...]]


def read_caption_files(folder: Path, rows: Sequence[Row]) -> tuple[CaptionFile, ...]:
    """Read all caption files of a folder, in the order of their names.

    Args:
        folder: folder of the index.
        rows: rows of the index; unused rows may have captions too.

    Raises:
        InvalidFile: not UTF-8, wrong columns, a line without captions, or an unknown or repeated id, with file and
            line.
    """
    ids = {row.id for row in rows}
    return tuple(_read(path, ids) for path in sorted(folder.glob(PATTERN)))


def _read(path: Path, ids: set[str]) -> CaptionFile:
    data, where = read_bytes(path, limit=MAX_BYTES), str(path)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidFile(f"is not UTF-8: {error.reason}", where=where) from None
    table = CsvTable.of(text, where)
    if table.header != COLUMNS:
        raise InvalidFile(f"its header is not {','.join(COLUMNS)}", where=where, hint=table.hint_of_delimiter())
    captions = dict[str, tuple[str, ...]]()
    for place, cells in table.rows():
        name, said = cells["id"].strip(), tuple(s for part in cells["captions"].split(SEPARATOR) if (s := part.strip()))
        if name not in ids:
            raise InvalidFile(
                f"the index has no clip {name!r}", where=place, hint="Use its id as written in the index."
            )
        if name in captions:
            raise InvalidFile(f"{name!r} has a line already", where=place)
        if not said:
            raise InvalidFile(f"has no captions for {name!r}", where=place)
        captions[name] = said
    return CaptionFile(path.name, hashlib.sha256(data).hexdigest(), captions)
