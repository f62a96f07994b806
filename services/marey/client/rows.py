"""Prompts from the command line and from CSV, JSONL and text files, with the line number of each problem."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal, cast

from marey.client.tables import EXTRA_HINT, ExtraColumns, Lines, Rows, csv_rows, delimiter_of, is_blank
from marey.client.text_files import GZIP_ENDING, UnreadableLine, open_text, where_of
from marey.core.errors import InvalidInput
from marey.items.evaluation_prompts import COLUMNS as EVALUATION_COLUMNS
from marey.items.evaluation_prompts import EvaluationPrompt, PromptCheck, read_prompts
from marey.items.item import (
    CHECKS,
    COLUMNS,
    MAX_BODY_BYTES,
    MAX_PROBLEMS,
    OUTPUT_FPS,
    InvalidItems,
    Item,
    Problem,
    check_count,
    names_model,
    read_json,
    read_setting,
    read_values,
)

Format = Literal["csv", "jsonl", "txt"]
STAND_IN = "a person walks"
"""Prompt of an item whose own cannot be used, where its other fields are checked."""
NO_DEFAULTS: Mapping[str, object] = MappingProxyType({})


class PromptReader:
    """Items of a file or of arguments, read once, with the line of each and with all problems.

    Iterating gives an item for each row, also for rows with problems where their fields can be held against the ranges
    of a model: such an item has only those fields. Look at `total` before using the items.

    Attributes:
        where: what messages call the source.
        lines: of each item that was given.
        total: problems found.
    """

    def __init__(self, raws: Rows, where: str) -> None:
        self.where = where
        self.lines: list[int | None] = []
        self.total = 0
        self._raws = raws
        self._problems: list[Problem] = []

    def __iter__(self) -> Iterator[Item]:
        """The items.

        Raises:
            InvalidInput: there are none.
            InvalidFile, NotFound, TooLarge: as `open_text`; over `MAX_ITEMS` motions.
        """
        count = 0
        try:
            for line, raw in self._raws:
                values, problems = read_values(raw, line)
                self.add(problems)
                count += 1 if problems else values.get("variants", 1)
                check_count(count, line, self.where)
                if problems and not names_model(values, problems):
                    continue
                self.lines.append(line)
                yield _stand_in(values) if problems else Item(**values)
        except UnreadableLine as error:
            if not self.total:
                raise
            self.add([Problem(error.line, None, f"{error.message}; the lines below it were not read. {error.hint}")])
        if not self.lines and not self.total:
            raise InvalidInput("there is no prompt in it", where=self.where, hint="Give at least one prompt.")

    def add(self, problems: Iterable[Problem]) -> None:
        """Add problems of lines of the source."""
        for problem in problems:
            self.total += 1
            if len(self._problems) < MAX_PROBLEMS:
                self._problems.append(problem)

    def located(self, problems: Iterable[Problem]) -> list[Problem]:
        """Problems of the items, which are counted from 1 as they were given, with their lines in the source."""
        return located(problems, self.lines)

    @contextmanager
    def in_source(self) -> Generator[None]:
        """In here a server's `InvalidItems` about the items becomes `error`: with the source and its lines."""
        try:
            yield
        except InvalidItems as error:
            if all(problem.line is None for problem in error.problems):
                raise
            self.add(self.located(error.problems))
            self.total += error.total - len(error.problems)
            raise self.error() from None

    def error(self, *, hint: str | None = None) -> InvalidItems:
        """All problems, by line."""
        found = sorted(self._problems, key=lambda problem: problem.line or 0)
        extra = any("is not a known column" in problem.message for problem in found)
        hints = [EXTRA_HINT if extra else "Correct them and try again.", *([hint] if hint else [])]
        return InvalidItems(found, where=self.where, total=self.total, hint=" ".join(hints))


def located(problems: Iterable[Problem], lines: Sequence[int | None]) -> list[Problem]:
    """Problems whose lines count what was read from a file, with the lines of the file."""

    def place(problem: Problem) -> Problem:
        number = problem.line
        return problem if number is None or number > len(lines) else replace(problem, line=lines[number - 1])

    return [place(problem) for problem in problems]


def _stand_in(values: Mapping[str, Any]) -> Item:
    """An item with the fields that depend on its model."""
    own = {name: values[name] for name in ("model", "seconds", "settings") if name in values}
    return Item(prompt=values.get("prompt", STAND_IN), **own)


def defaults_of(
    *,
    model: str | None = None,
    bundle: str | None = None,
    seconds: float | None = None,
    seed: int | None = None,
    variants: int | None = None,
    fps: float | None = None,
    tags: Sequence[str] | None = None,
    settings: Sequence[str] | None = None,
) -> Mapping[str, object]:
    """The fields of a row where it says nothing itself, from the options of the command; tags come beside its own.

    Raises:
        InvalidInput: one cannot be; by the name of its option.
    """
    sampling = _sampling_of(settings or (), fps)
    given = (
        ("--model", "model", model),
        ("--bundle", "model", bundle),  # names it more exactly
        ("--seconds", "seconds", seconds),
        ("--seed", "seed", seed),
        ("--variants", "variants", variants),
        ("--set" if settings else "--fps", "settings", sampling or None),
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


def _sampling_of(given: Sequence[str], fps: float | None) -> dict[str, float]:
    """Settings of `--set` and `--fps` together."""
    found: dict[str, float] = {}
    try:
        for text in given:
            name, value = read_setting(text)
            found[name] = value
    except InvalidInput as error:
        raise InvalidInput(error.message, where="--set", hint=error.hint) from None
    return found if fps is None else {**found, OUTPUT_FPS: fps}


def read_arguments(prompts: Sequence[str], defaults: Mapping[str, object] = NO_DEFAULTS) -> PromptReader:
    """Items of prompts given as arguments; a problem names the number of the argument."""
    return PromptReader(((i, {"prompt": p, **defaults}) for i, p in enumerate(prompts, 1)), "PROMPT")


def read_rows(raws: Iterable[object], defaults: Mapping[str, object] = NO_DEFAULTS) -> PromptReader:
    """Items of the rows of a program; a problem names the number of the row, from 1."""
    return PromptReader(((number, _completed(raw, defaults)) for number, raw in enumerate(raws, 1)), "rows")


def read_file(
    path: str,
    file_format: Format | None = None,
    defaults: Mapping[str, object] = NO_DEFAULTS,
    extra_columns: ExtraColumns = "refuse",
) -> PromptReader:
    """Items of a file, or of stdin for `-`.

    Args:
        path: `.csv` with a header line, `.jsonl` with an object a line, `.txt` with a prompt a line, each also packed
            as `.gz`, or `-`.
        file_format: for `-` and other endings; stdin is otherwise guessed from its first line.
        defaults: fields of a line where it says nothing itself.
        extra_columns: what happens to columns of a table that are not known.
    """
    lines = rows_of_file(path, file_format, extra_columns=extra_columns)
    return PromptReader(((number, _completed(raw, defaults)) for number, raw in lines), where_of(path))


def items_from_prompts(prompts: Sequence[str], defaults: Mapping[str, object] = NO_DEFAULTS) -> Iterator[Item]:
    """Items of `read_arguments`, which count only once all are read."""
    return right_items(read_arguments(prompts, defaults))


def items_from_file(
    path: str, file_format: Format | None = None, defaults: Mapping[str, object] = NO_DEFAULTS
) -> Iterator[Item]:
    """Items of a file (`read_file`), which count only once all are read.

    Raises:
        InvalidItems: after the last one, with every problem of every line.
        InvalidFile: not UTF-8, or not of that format at all.
        TooLarge: over `MAX_BODY_BYTES` of text, or over `MAX_ITEMS` motions; it is not read further.
        NotFound, InvalidInput: no such file, or no way to tell its format.
    """
    return right_items(read_file(path, file_format, defaults))


def right_items(reader: PromptReader) -> Iterator[Item]:
    """The items of a reader, which count only once all are read.

    Raises:
        InvalidItems: after the last one, with every problem of every line.
    """
    for item in reader:
        if not reader.total:
            yield item
    if reader.total:
        raise reader.error()


def evaluation_prompts_from_file(path: str) -> tuple[EvaluationPrompt, ...]:
    """Prompts of an evaluation; see `read_evaluation_prompts`."""
    return read_evaluation_prompts(path)[0]


def read_evaluation_prompts(
    path: str, *, extra_columns: ExtraColumns = "refuse", check: PromptCheck | None = None
) -> tuple[tuple[EvaluationPrompt, ...], list[int | None]]:
    """Prompts of an evaluation, and the line of each; columns `prompt`, `seconds` and `expected`.

    Args:
        check: gives what else is wrong with the fields of a row that can be used.

    Raises:
        InvalidItems, InvalidFile, TooLarge, NotFound, InvalidInput: as `items_from_file`.
    """
    lines: list[int | None] = []

    def counted() -> Rows:
        for line, raw in rows_of_file(path, columns=EVALUATION_COLUMNS, extra_columns=extra_columns):
            lines.append(line)
            yield line, raw

    return read_prompts(counted(), where=where_of(path), check=check), lines


def rows_of_file(
    path: str,
    file_format: Format | None = None,
    columns: Sequence[str] = COLUMNS,
    extra_columns: ExtraColumns = "refuse",
) -> Rows:
    """The lines of a file with their numbers, as they are read; only that a table has known columns is checked.

    Raises:
        InvalidItems, InvalidFile, NotFound, TooLarge, InvalidInput: as `items_from_file`.
    """
    with open_text(path, limit=MAX_BODY_BYTES) as text:
        lines = enumerate(text, 1)
        chosen, first = (file_format or _by_ending(path), []) if file_format or path != "-" else _guess(lines)
        lines = itertools.chain(first, lines)
        if chosen == "csv":
            yield from csv_rows(lines, columns, extra_columns)
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
        if not is_blank(line):
            read.append((number, line))
            break
    first = read[0][1].strip()[:1000] if read else ""  # a header, or it is none
    if first.startswith("{"):
        return "jsonl", read
    names = next(csv.reader([first], delimiter=delimiter_of(first, COLUMNS)), list[str]())
    return ("csv" if "prompt" in [name.strip() for name in names] else "txt"), read


def _jsonl(lines: Lines) -> Rows:
    for number, line in lines:
        if not is_blank(line):
            yield number, read_json(line)


def _txt(lines: Lines) -> Rows:
    for number, line in lines:
        if not is_blank(line):
            yield number, {"prompt": line.rstrip("\r\n")}
