"""Tables of prompts: their delimiter, columns and rows, each with the line where it begins."""

from __future__ import annotations

import csv
import itertools
import json
import unicodedata
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from marey.client import manifest
from marey.client.csv_cells import TAG_SEPARATOR, restore, split_tags
from marey.core.characters import find_forbidden
from marey.core.documents import unique_object
from marey.core.errors import InvalidInput
from marey.core.suggestions import did_you_mean, nearest
from marey.items.item import Unreadable
from marey.items.settings import read_settings

Rows = Iterator[tuple[int | None, object]]
Lines = Iterator[tuple[int, str]]
"""With their numbers, from 1."""
ExtraColumns = Literal["refuse", "tag", "ignore"]

DELIMITERS = (",", ";", "\t")
BLANK = " \t\r\n\ufeff\xa0"
"""White space trimmed from cells; control characters are not, so that the check of the field refuses them."""
TEXTS = frozenset({"prompt", "timeline"})
"""Columns of which a table has at least one."""
EXTRA_HINT = "Rename or remove the columns, or choose extra_columns tag or ignore."


@dataclass(frozen=True)
class Column:
    """The interpretation of a column.

    Attributes:
        field: of the row; None = the cell is not read.
        tag: the cell becomes the tag `tag=cell`.
    """

    field: str | None
    tag: str | None = None


@dataclass(frozen=True)
class Header:
    """The interpretation of a table's cells."""

    columns: Sequence[Column]
    text: Callable[[str], str] = str
    tags: Callable[[str], list[str]] = lambda cell: [tag.strip() for tag in cell.split(TAG_SEPARATOR)]


def csv_rows(lines: Lines, columns: Sequence[str], extra: ExtraColumns = "refuse") -> Rows:
    """Iterate over the rows below the header, each with the line where it begins; an invalid row or column is
    `Unreadable`.

    Args:
        columns: known ones. A table that has all columns of `manifest.csv` may have those too.
        extra: treatment of other columns.
    """
    at = 0

    def counted() -> Iterator[str]:
        nonlocal at
        for at, line in lines:  # noqa: B007 (the reader has no number for the line that a guess has skipped)
            yield line

    texts = counted()
    first = next((line for line in texts if not is_blank(line)), "")
    texts = itertools.chain([first], texts)
    reader = csv.reader(texts, strict=True, delimiter=delimiter_of(first, columns))
    header: Header | None = None
    is_first = True
    while True:
        line = at if is_first else at + 1
        is_first = False
        try:
            cells = next(reader, None)
        except csv.Error as error:
            yield line, Unreadable(f"is not CSV: {_csv_error(error)}; the lines below it were not read")
            return
        if cells is None:
            return
        if all(is_blank(cell) for cell in cells):
            continue
        if header is None:
            header, problems = _read_header([cell.strip(BLANK) for cell in cells], columns, extra)
            yield from ((line, problem) for problem in problems)
            if all(column.field not in TEXTS for column in header.columns):
                return
        else:
            yield line, _row(header, cells)


def delimiter_of(header: str, columns: Sequence[str]) -> str:
    """Return the delimiter that gives most of the known columns, in any case, in the header line; by default the
    comma."""

    def known(delimiter: str) -> int:
        try:
            names = next(csv.reader([header], delimiter=delimiter), list[str]())
        except csv.Error:
            return 0
        return sum(name.strip(BLANK).lower() in columns for name in names)

    return max(DELIMITERS, key=known)


def is_blank(text: str) -> bool:
    """Return True if the text is blank; control characters that Python treats as spaces are not blank."""
    return not text.strip() and find_forbidden(text, "\t\r\n") is None


def _csv_error(error: csv.Error) -> str:
    if "field limit" in str(error):
        return f"a cell of over {csv.field_size_limit():,} characters, as where a quote is never closed"
    return "a quote is never closed" if "end of data" in str(error) else str(error)


def _read_header(names: list[str], columns: Sequence[str], extra: ExtraColumns) -> tuple[Header, list[Unreadable]]:
    known = f"known columns are {', '.join(columns)}"
    ours = set(names) >= set(manifest.RAW_COLUMNS)
    found: list[Column] = []
    problems: list[Unreadable] = []
    for index, name in enumerate(names):
        earlier = names[:index].count(name)
        is_tag = extra == "tag" and name not in columns and not (ours and manifest.is_column(name))
        found.append(
            Column(
                field=name if name in columns and not earlier else None,
                tag=unicodedata.normalize("NFC", name) if is_tag else None,
            )
        )
        if is_tag and (not name or "=" in name):
            problems.append(Unreadable(f"{name!r} cannot be the key of a tag: give the column a name without ="))
        elif extra == "refuse" and name not in columns and not (ours and manifest.is_column(name)):
            problems.append(Unreadable(f"{name!r} is not a known column{did_you_mean(name, columns)}; {known}"))
        elif earlier == 1 and (is_tag or name in columns):
            problems.append(Unreadable("appears twice", name))
    if not TEXTS.intersection(names) & {"prompt", *columns}:
        near = nearest("prompt", names)
        meant = "" if near is None or extra == "refuse" else f" (is {near!r} meant?)"
        problems.append(Unreadable(f"is not among the columns of the first line{meant}; {known}", "prompt"))
    if ours and "seconds" in names:
        return Header(found, restore, split_tags), problems
    return Header(found), problems


def _row(header: Header, cells: list[str]) -> object:
    if len(cells) > len(header.columns):
        return Unreadable(
            f"has {len(cells)} cells, the first line {len(header.columns)}: put a text that holds the delimiter into "
            "double quotes"
        )
    row: dict[str, object] = {}
    tags: list[str] = []
    for column, cell in zip(header.columns, cells, strict=False):
        if column.tag is not None and not is_blank(cell):
            tags.append(f"{column.tag}={cell.strip(BLANK)}")
        elif column.field == "tags":
            tags = [*(tag for tag in header.tags(header.text(cell)) if tag), *tags]
        elif column.field is not None and (column.field == "prompt" or not is_blank(cell)):
            row[column.field] = _value(column.field, header.text(cell))
    if "timeline" in row and (is_blank(str(row.get("prompt", ""))) or row.get("prompt") == row["timeline"]):
        row.pop("prompt", None)  # a manifest of fetched motions has the text form as the prompt, too
    return {**row, "tags": tags} if tags else row


def _value(name: str, cell: str) -> object:
    """Convert a cell to the type of its column; an invalid cell stays text, which the check of the field refuses."""
    try:
        if name in ("seed", "variants"):
            return int(cell)
        if name == "seconds":
            return float(cell)
        if name == "settings":
            return read_settings(cell)
        if name == "constraints":
            return json.loads(cell, object_pairs_hook=unique_object)
    except (ValueError, RecursionError, InvalidInput):
        pass
    return cell if name == "prompt" else cell.strip(BLANK)
