"""Prompts from the command line and from CSV, JSONL and text files, with the line number of each problem."""

from __future__ import annotations

import csv
import io
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

from shared.errors import InvalidFile, InvalidInput, NotFound, TooLarge
from shared.evaluation_prompts import COLUMNS as EVALUATION_COLUMNS
from shared.evaluation_prompts import EvaluationPrompt, read_prompts
from shared.items import COLUMNS, MAX_BODY_BYTES, InvalidItems, Item, Problem, Unreadable, read_items, read_json

Format = Literal["csv", "jsonl", "txt"]
Rows = Iterator[tuple[int | None, object]]

UTF8_BOM = b"\xef\xbb\xbf"
UTF16_BOMS = (b"\xff\xfe", b"\xfe\xff")
TAG_SEPARATOR = ";"


def items_from_prompts(prompts: Sequence[str]) -> list[Item]:
    """Items of prompts given as arguments; a problem names the number of the argument."""
    return read_items([(i, {"prompt": p}) for i, p in enumerate(prompts, 1)], where="PROMPT")


def items_from_file(path: str, file_format: Format | None = None) -> list[Item]:
    """Items of a file, or of stdin for `-`.

    Args:
        path: `.csv` with a header line, `.jsonl` with an object a line, `.txt` with a prompt a line, or `-`.
        file_format: for `-` and other endings; stdin is otherwise guessed from its first line.

    Raises:
        InvalidItems: with every problem of every line.
        InvalidFile: not UTF-8, or not of that format at all.
        NotFound, InvalidInput: no such file, or no way to tell its format.
    """
    return read_items(rows_of_file(path, file_format), where=_where(path))


def evaluation_prompts_from_file(path: str) -> tuple[EvaluationPrompt, ...]:
    """Prompts of an evaluation; columns `prompt`, `seconds` and `expected`. Raises as `items_from_file`."""
    return read_prompts(rows_of_file(path, columns=EVALUATION_COLUMNS), where=_where(path))


def rows_of_file(path: str, file_format: Format | None = None, columns: Sequence[str] = COLUMNS) -> Rows:
    """The lines of a file with their numbers, not checked further than that a table has known columns.

    Raises:
        InvalidItems, InvalidFile, NotFound, InvalidInput: as `items_from_file`.
    """
    text = _decode(_read(path), _where(path))
    chosen = file_format or (_guess(text) if path == "-" else _by_ending(path))
    if chosen == "csv":
        return _csv(text, _where(path), columns)
    return _jsonl(text) if chosen == "jsonl" else _txt(text)


def _where(path: str) -> str:
    return "stdin" if path == "-" else path


def with_defaults(
    items: Sequence[Item], *, model: str | None = None, seconds: float | None = None, seed: int | None = None,
    variants: int | None = None,
    fps: float | None = None,
) -> list[Item]:  # fmt: skip
    """The items with the options of the command where an item itself says nothing; checked anew."""
    changed = [
        replace(
            item,
            model=item.model or model,
            seconds=item.seconds if item.seconds is not None else seconds,
            seed=item.seed if item.seed is not None else seed,
            variants=item.variants if item.variants != 1 else variants or 1,
            settings=item.settings if fps is None else {"fps": fps, **item.settings},
        )
        for item in items
    ]
    return read_items([(None, item.as_json()) for item in changed])


def _read(path: str) -> bytes:
    try:
        content = sys.stdin.buffer.read(MAX_BODY_BYTES + 1) if path == "-" else _read_file(Path(path))
    except FileNotFoundError:
        raise NotFound("there is no such file", where=path, hint="Check the path of -f.") from None
    except OSError as error:
        raise InvalidFile(f"cannot be read: {error.strerror}", where=path) from error
    if len(content) > MAX_BODY_BYTES:
        raise TooLarge(f"is over {MAX_BODY_BYTES // 2**20} MiB", where=path, hint="Submit it in parts.")
    return content


def _read_file(path: Path) -> bytes:
    with path.open("rb") as stream:
        return stream.read(MAX_BODY_BYTES + 1)


def _decode(content: bytes, where: str) -> str:
    if content.startswith(UTF16_BOMS):
        raise InvalidFile("is UTF-16, not UTF-8", where=where, hint="Save it as UTF-8 (in Excel: CSV UTF-8).")
    content = content.removeprefix(UTF8_BOM)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InvalidFile(
            f"is not UTF-8 (byte 0x{content[error.start]:02x})", where=f"{where}: line {line}", hint="Save it as UTF-8."
        ) from error


def _by_ending(path: str) -> Format:
    for ending in ("csv", "jsonl", "txt"):
        if path.lower().endswith(f".{ending}"):
            return ending
    raise InvalidInput(
        "the file's ending does not tell its format", where=path, hint="Use --input-format csv|jsonl|txt."
    )


def _guess(text: str) -> Format:
    first = text.lstrip().partition("\n")[0]
    if first.startswith("{"):
        return "jsonl"
    return "csv" if "prompt" in next(csv.reader([first]), []) else "txt"


def _csv(text: str, where: str, columns: Sequence[str]) -> Rows:
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    header: list[str] | None = None
    line = 1
    while True:
        try:
            cells = next(reader, None)
        except csv.Error as error:
            yield line, Unreadable(f"is not CSV: {error}; the lines below it were not read")
            return
        if cells is None:
            return
        if any(cell.strip() for cell in cells):
            if header is None:
                header = _header([cell.strip() for cell in cells], line, where, columns)
            else:
                yield line, _csv_row(header, cells)
        line = reader.line_num + 1


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


def _jsonl(text: str) -> Rows:
    for line, content in enumerate(text.split("\n"), 1):
        if content.strip():
            yield line, read_json(content)


def _txt(text: str) -> Rows:
    for line, content in enumerate(text.split("\n"), 1):
        if content.strip():
            yield line, {"prompt": content.rstrip("\r")}
