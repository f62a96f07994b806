"""Prompts from the command line and from CSV, JSONL and text files, with the line number of each problem."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Literal, cast

from services.cli.text_files import GZIP_ENDING, open_text, where_of
from shared.errors import InvalidInput
from shared.evaluation_prompts import COLUMNS as EVALUATION_COLUMNS
from shared.evaluation_prompts import EvaluationPrompt, read_prompts
from shared.items import (
    CHECKS,
    COLUMNS,
    MAX_BODY_BYTES,
    OUTPUT_FPS,
    InvalidItems,
    Item,
    Problem,
    Unreadable,
    read_items,
    read_json,
)

Format = Literal["csv", "jsonl", "txt"]
Rows = Iterator[tuple[int | None, object]]
Lines = Iterator[tuple[int, str]]
"""With their numbers, from 1."""

TAG_SEPARATOR = ";"


NO_DEFAULTS: Mapping[str, object] = MappingProxyType({})


def defaults_of(
    *,
    model: str | None = None,
    bundle: str | None = None,
    seconds: float | None = None,
    seed: int | None = None,
    variants: int | None = None,
    fps: float | None = None,
    tags: Sequence[str] | None = None,
) -> Mapping[str, object]:
    """The fields of a row where it says nothing itself, from the options of the command; tags come beside its own.

    Raises:
        InvalidInput: one cannot be; by the name of its option.
    """
    given = (
        ("--model", "model", model),
        ("--bundle", "model", bundle),  # names it more exactly
        ("--seconds", "seconds", seconds),
        ("--seed", "seed", seed),
        ("--variants", "variants", variants),
        ("--fps", "settings", None if fps is None else {OUTPUT_FPS: fps}),
        ("--tag", "tags", tags or None),
    )
    found: dict[str, object] = {}
    for option, field, value in given:
        if value is None:
            continue
        try:
            found[field] = CHECKS[field](value)
        except InvalidInput as error:
            raise InvalidInput(error.message, where=option, hint=error.hint) from None
    return found


def items_from_prompts(prompts: Sequence[str], defaults: Mapping[str, object] = NO_DEFAULTS) -> Iterator[Item]:
    """Items of prompts given as arguments; a problem names the number of the argument."""
    return read_items(((i, {"prompt": p, **defaults}) for i, p in enumerate(prompts, 1)), where="PROMPT")


def items_from_file(
    path: str, file_format: Format | None = None, defaults: Mapping[str, object] = NO_DEFAULTS
) -> Iterator[Item]:
    """Items of a file, or of stdin for `-`, as they are read; they count only once all are (`shared.items.checked`).

    Args:
        path: `.csv` with a header line, `.jsonl` with an object a line, `.txt` with a prompt a line, each also packed
            as `.gz`, or `-`.
        file_format: for `-` and other endings; stdin is otherwise guessed from its first line.
        defaults: fields of a line where it says nothing itself.

    Raises:
        InvalidItems: with every problem of every line.
        InvalidFile: not UTF-8, or not of that format at all.
        TooLarge: over `MAX_BODY_BYTES` of text, or over `MAX_ITEMS` motions; it is not read further.
        NotFound, InvalidInput: no such file, or no way to tell its format.
    """
    lines = rows_of_file(path, file_format)
    return read_items(((number, _completed(raw, defaults)) for number, raw in lines), where=where_of(path))


def evaluation_prompts_from_file(path: str) -> tuple[EvaluationPrompt, ...]:
    """Prompts of an evaluation; columns `prompt`, `seconds` and `expected`. Raises as `items_from_file`."""
    return read_prompts(rows_of_file(path, columns=EVALUATION_COLUMNS), where=where_of(path))


def rows_of_file(path: str, file_format: Format | None = None, columns: Sequence[str] = COLUMNS) -> Rows:
    """The lines of a file with their numbers, as they are read; only that a table has known columns is checked.

    Raises:
        InvalidItems, InvalidFile, NotFound, TooLarge, InvalidInput: as `items_from_file`.
    """
    with open_text(path, limit=MAX_BODY_BYTES) as text:
        lines = enumerate(text, 1)
        chosen, first = (file_format or _by_ending(path), []) if file_format or path != "-" else _guess(lines)
        lines = itertools.chain(first, lines)
        if chosen == "csv":
            yield from _csv(lines, where_of(path), columns)
        else:
            yield from _jsonl(lines) if chosen == "jsonl" else _txt(lines)


def _completed(raw: object, defaults: Mapping[str, object]) -> object:
    """A row with the defaults for what it does not say; settings are told one by one, tags put together."""
    if not defaults or not isinstance(raw, Mapping):
        return raw
    row = cast("Mapping[object, object]", raw)
    whole = {**defaults, **{name: value for name, value in row.items() if value is not None}}
    ours, theirs = defaults.get("settings"), row.get("settings")
    if isinstance(ours, Mapping) and isinstance(theirs, Mapping):
        whole["settings"] = {**ours, **theirs}
    more, own = defaults.get("tags"), row.get("tags")
    if isinstance(more, tuple) and isinstance(own, list):
        its = cast("list[object]", own)
        whole["tags"] = [*its, *(tag for tag in cast("tuple[object, ...]", more) if tag not in its)]
    return whole


def _by_ending(path: str) -> Format:
    name = path.lower().removesuffix(GZIP_ENDING)
    for ending in ("csv", "jsonl", "txt"):
        if name.endswith(f".{ending}"):
            return ending
    raise InvalidInput(
        "the file's ending does not tell its format",
        where=path,
        hint="Name it .csv, .jsonl or .txt (.gz too); where the command has --input-format, that will do.",
    )


def _guess(lines: Lines) -> tuple[Format, list[tuple[int, str]]]:
    """The format, by the first line that is not blank, and what was read to see it."""
    read: list[tuple[int, str]] = []
    for number, line in lines:
        if line.strip():
            read.append((number, line))
            break
    first = read[0][1].strip()[:1000] if read else ""  # a header, or it is none
    if first.startswith("{"):
        return "jsonl", read
    return ("csv" if "prompt" in next(csv.reader([first]), []) else "txt"), read


def _csv(lines: Lines, where: str, columns: Sequence[str]) -> Rows:
    at = 0

    def counted() -> Iterator[str]:
        nonlocal at
        for at, line in lines:  # noqa: B007 (the reader has no number for the line that a guess has skipped)
            yield line

    reader = csv.reader(counted(), strict=True)
    header: list[str] | None = None
    while True:
        line = at + 1
        try:
            cells = next(reader, None)
        except csv.Error as error:
            yield line, Unreadable(f"is not CSV: {_csv_error(error)}; the lines below it were not read")
            return
        if cells is None:
            return
        if any(cell.strip() for cell in cells):
            if header is None:
                header = _header([cell.strip() for cell in cells], line, where, columns)
            else:
                yield line, _csv_row(header, cells)


def _csv_error(error: csv.Error) -> str:
    if "field limit" in str(error):
        return f"a cell of over {csv.field_size_limit():,} characters, as where a quote is never closed"
    return "a quote is never closed" if "end of data" in str(error) else str(error)


def _header(names: list[str], line: int, where: str, columns: Sequence[str]) -> list[str]:
    known = f"known columns are {', '.join(columns)}"
    problems = [
        Problem(line, None, f"{name!r} is not a known column; {known}") for name in names if name not in columns
    ]
    problems += [Problem(line, name, "stands twice") for name in sorted({n for n in names if names.count(n) > 1})]
    if "prompt" not in names:
        problems.append(Problem(line, "prompt", f"is not among the columns of the first line; {known}"))
    if problems:
        raise InvalidItems(problems, where=where)
    return names


def _csv_row(header: list[str], cells: list[str]) -> object:
    if len(cells) > len(header):
        return Unreadable(
            f"has {len(cells)} cells, the first line {len(header)}: put a text that holds commas into double quotes"
        )
    return {
        name: _csv_value(name, cell)
        for name, cell in zip(header, cells, strict=False)
        if cell.strip() or name == "prompt"
    }


def _csv_value(name: str, cell: str) -> object:
    """A number where the column wants one and the cell holds one; else the text, for the check to complain about."""
    if name == "tags":
        return [tag.strip() for tag in cell.split(TAG_SEPARATOR) if tag.strip()]
    try:
        if name in ("seed", "variants"):
            return int(cell)
        if name == "seconds":
            return float(cell)
    except ValueError:
        pass
    return cell if name == "prompt" else cell.strip()


def _jsonl(lines: Lines) -> Rows:
    for number, line in lines:
        if line.strip():
            yield number, read_json(line)


def _txt(lines: Lines) -> Rows:
    for number, line in lines:
        if line.strip():
            yield number, {"prompt": line.rstrip("\r\n")}
