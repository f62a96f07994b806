"""`index.csv`: one line per clip, or per segment of a long clip."""

from __future__ import annotations

import string
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from marey.core.documents import read_bytes
from marey.core.errors import InvalidFile
from marey.core.validation import first_problem
from marey.data.csv_table import CsvTable
from marey.data.dataset import Dataset
from marey.data.licences import Tier

MAX_BYTES = 64 * 2**20
SEPARATOR = "|"
"""Separator of captions in one cell."""
UNUSED = "none"
"""Action of an unused row: a T-pose, or a broken or duplicate take."""


class Row(BaseModel):
    """One line.

    Attributes:
        file: name of the file, with or without folder and extension.
        id: name of the clip; default: the file's, with `@start` for a segment, and the end if two share a start.
        action: the action, an id of the vocabulary if it has one; several joined by `; `; `none`: omit the clip.
        style: style of the action.
        captions: true sentences about it.
        source: the independent capture it comes from; clips of one source are never in two splits.
        licence, credit, tier: its terms if they differ from those of the set.
        in_place: a gait on the spot; its travel is computed from the standing foot, or its captions say "in place".
        side: left, right, both or empty.
        split: split given by the set; empty: assigned by source.
        start, end: first frame (inclusive) and last (exclusive) at `Dataset.index_fps`; None: those of the file.
        error_cm: error of the file's joints against the capture, if its author measured it.
        facts: description of the motion, for authors of captions.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    file: str = Field(min_length=1)
    id: str = ""
    action: str = ""
    style: str = ""
    captions: tuple[str, ...] = ()
    source: str = ""
    licence: str = ""
    credit: str = ""
    tier: Tier | None = None
    in_place: bool = False
    side: Literal["", "left", "right", "both"] = ""
    split: Literal["", "train", "val", "test", "compositional"] = ""
    start: float | None = Field(default=None, ge=0)
    end: float | None = Field(default=None, gt=0)
    error_cm: float = 0.0
    facts: str = ""

    @field_validator("captions", mode="before")
    @classmethod
    def _several(cls, value: object) -> object:
        return tuple(v for part in value.split(SEPARATOR) if (v := part.strip())) if isinstance(value, str) else value

    @field_validator("in_place", "error_cm", mode="before")
    @classmethod
    def _no(cls, value: object) -> object:
        return 0 if value == "" else value

    @field_validator("start", "end", "tier", mode="before")
    @classmethod
    def _none(cls, value: object) -> object:
        return None if value == "" else value

    @property
    def stem(self) -> str:
        """Name of the file without folder and extension."""
        return stem_of(self.file)


def stem_of(name: str) -> str:
    """Name of a file without folder and extension (only `.bvh`: names of clips may have dots)."""
    name = name.replace("\\", "/").rsplit("/", 1)[-1]
    return name[:-4] if name.lower().endswith(".bvh") else name


def read_index(path: Path, dataset: Dataset) -> tuple[Row, ...]:
    """Read an index by the columns of its set.

    Raises:
        NotFound: no such file.
        InvalidFile: not a CSV file with a header, a template with an unknown column, or an invalid cell, with its line.
    """
    where = str(path)
    try:
        text = read_bytes(path, limit=MAX_BYTES).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InvalidFile(f"is not UTF-8: {error.reason}", where=where) from None
    return parse_index(text, dataset.columns, where)


def parse_index(text: str, columns: Mapping[str, str], where: str) -> tuple[Row, ...]:
    """Parse the text of an index; `columns` as in `Dataset.columns`."""
    table = CsvTable.of(text, where)
    header = table.header
    templates = {name: f"{{{name}}}" for name in Row.model_fields if name in header}
    templates.update(columns)
    if "file" not in templates:
        hint = table.hint_of_delimiter() or "Name it under [columns] of dataset.toml."
        raise InvalidFile("has no column `file`", where=where, hint=hint)
    for ours, template in templates.items():
        for field in _fields(ours, template, where):
            if field not in header:
                raise InvalidFile(f"has no column {field!r}, which `{ours}` needs", where=where)
    rows, seen = [], set[str]()
    for place, cells in table.rows():
        made = {ours: template.format_map(cells).strip() for ours, template in templates.items()}
        try:
            row = Row.model_validate(made)
        except ValidationError as error:
            raise InvalidFile(first_problem(error), where=place) from None
        row = _named(row, seen)
        if row.start is not None and row.end is not None and row.end <= row.start:
            raise InvalidFile("ends before it starts", where=place)
        if row.id in seen:
            raise InvalidFile(f"there are two clips {row.id!r}", where=place)
        seen.add(row.id)
        rows.append(row)
    return tuple(rows)


def _fields(ours: str, template: str, where: str) -> list[str]:
    """Return the columns of a template."""
    try:
        parts = [*string.Formatter().parse(template)]
    except ValueError as error:
        raise InvalidFile(
            f"the template of `{ours}`, {template[:80]!r}, cannot be read: {error}", where=where
        ) from None
    if any(form or conversion for _, _, form, conversion in parts):
        raise InvalidFile(
            f"the template of `{ours}`, {template[:80]!r}, has more than names of columns in braces", where=where
        )
    return [field for _, field, _, _ in parts if field is not None]


def _named(row: Row, taken: Container[str]) -> Row:
    """Fill a missing id and source of a row. Segments with the same start also get their end in the id."""
    name = row.id or row.stem
    if not row.id and not (row.start is None and row.end is None):
        name += f"@{row.start or 0:g}"
        if name in taken and row.end is not None:
            name += f"-{row.end:g}"
    return row.model_copy(update={"id": name, "source": row.source or row.stem})
