"""Prompts from a program and from CSV, JSONL and text files, with the line number of each problem."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal, cast

from marey.client.poses import RowPoses
from marey.client.ranges import check_ranges
from marey.client.tables import EXTRA_HINT, TEXTS, ExtraColumns, Lines, Rows, csv_rows, delimiter_of, is_blank
from marey.client.text_files import GZIP_ENDING, UnreadableLine, open_text, where_of
from marey.core.errors import InvalidInput
from marey.items.evaluation_prompts import COLUMNS as EVALUATION_COLUMNS
from marey.items.evaluation_prompts import EvaluationPrompt, PromptCheck, read_prompts
from marey.items.item import CHECKS, COLUMNS, MAX_BODY_BYTES, Item, check_count, names_model, read_json, read_values
from marey.items.problems import MAX_PROBLEMS, InvalidItems, OutOfScope, Problem
from marey.items.settings import BEST_OF, OUTPUT_FPS, REDRAWS

Format = Literal["csv", "jsonl", "txt"]
STAND_IN = "a person walks"
"""Prompt of an item whose own prompt is invalid, so that its other fields can be checked."""
NO_DEFAULTS: Mapping[str, object] = MappingProxyType({})


class PromptReader:
    """Items of a file or of arguments, read once, with the line of each and with all problems.

    Iterating gives an item for each row, also for rows with problems if their fields can be checked against the ranges
    of a model: such an item has only those fields. Check `total` before using the items.

    Attributes:
        where: the name of the source in messages.
        unit: the name of a line in messages.
        lines: the line of each item.
        total: number of problems.
    """

    def __init__(self, raws: Rows, where: str, unit: str = "line") -> None:
        self.where = where
        self.unit = unit
        self.lines: list[int | None] = []
        self.total = 0
        self._raws = raws
        self._poses = RowPoses()
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
                values, beyond = check_ranges(values, line)
                values, unread = self._poses.read(values, line)
                problems += [*beyond, *unread]
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
            raise InvalidInput("it contains no prompt", where=self.where, hint="Give at least one prompt.")

    def add(self, problems: Iterable[Problem]) -> None:
        """Add problems of lines of the source."""
        for problem in problems:
            self.total += 1
            if len(self._problems) < MAX_PROBLEMS:
                self._problems.append(problem)

    def located(self, problems: Iterable[Problem]) -> list[Problem]:
        """Return problems of items, which are counted from 1, with their lines in the source."""
        return located(problems, self.lines)

    @contextmanager
    def in_source(self) -> Generator[None]:
        """Let a server's `InvalidItems` in the block name the source and its lines, as `error` does."""
        try:
            yield
        except OutOfScope as error:  # everything else was right
            found = self.located(error.problems)
            hint = error.hint or ""
            raise OutOfScope(found, where=self.where, total=error.total, hint=hint, unit=self.unit) from None
        except InvalidItems as error:
            if all(problem.line is None for problem in error.problems):
                raise
            self.add(self.located(error.problems))
            self.total += error.total - len(error.problems)
            raise self.error() from None

    def error(self, *, more: str | None = None) -> InvalidItems:
        """Return the error with all problems, by line."""
        found = sorted(self._problems, key=lambda problem: problem.line or 0)
        extra = any("is not a known column" in problem.message for problem in found)
        hints = [EXTRA_HINT if extra else "Correct them and try again.", *([more] if more else [])]
        argument = "extra_columns" if extra else None
        hint = " ".join(hints)
        return InvalidItems(found, where=self.where, total=self.total, hint=hint, argument=argument, unit=self.unit)


def located(problems: Iterable[Problem], lines: Sequence[int | None]) -> list[Problem]:
    """Return problems whose lines count the items of a file with the lines of the file."""

    def place(problem: Problem) -> Problem:
        number = problem.line
        return problem if number is None or number > len(lines) else replace(problem, line=lines[number - 1])

    return [place(problem) for problem in problems]


def _stand_in(values: Mapping[str, Any]) -> Item:
    """An item with the fields that depend on its model."""
    own = {name: values[name] for name in ("model", "seconds", "settings", "variety", "timeline") if name in values}
    return Item(prompt=values.get("prompt", STAND_IN), **own)


def defaults_of(
    *,
    model: str | None = None,
    bundle: str | None = None,
    seconds: float | None = None,
    seed: int | None = None,
    variants: int | None = None,
    fps: float | None = None,
    best_of: int | None = None,
    redraws: int | None = None,
    variety: str | None = None,
    tags: Sequence[str] | None = None,
    settings: Mapping[str, float] | None = None,
) -> Mapping[str, object]:
    """Return the checked fields of rows that do not set them; tags are added to a row's own.

    Args:
        bundle: names the model more exactly.
        fps: of the files; like `best_of` and `redraws` one of the settings.

    Raises:
        InvalidInput: a field is out of range; the error names its argument.
    """
    platform = {OUTPUT_FPS: fps, BEST_OF: best_of, REDRAWS: redraws}
    named = {name: value for name, value in platform.items() if value is not None}
    given = (
        ("model", "model", model),
        ("bundle", "model", bundle),
        ("seconds", "seconds", seconds),
        ("seed", "seed", seed),
        ("variants", "variants", variants),
        ("variety", "variety", variety),
        ("settings", "settings", {**(settings or {}), **named} or None),
        ("tags", "tags", tags or None),
    )
    found: dict[str, object] = {}
    for argument, field, value in given:
        if value is None:
            continue
        try:
            found[field] = CHECKS[field](value)
        except InvalidInput as error:
            name, _, fault = error.message.partition(": ")  # a setting is named by its message
            at, message = (name, fault) if field == "settings" and name in named else (argument, error.message)
            raise InvalidInput(message, where=at, hint=error.hint, argument=at) from None
    return found


def read_arguments(prompts: Sequence[str], defaults: Mapping[str, object] = NO_DEFAULTS) -> PromptReader:
    """Read prompts given as arguments; a problem names the number of the argument."""
    return PromptReader(((i, {"prompt": p, **defaults}) for i, p in enumerate(prompts, 1)), "PROMPT", "argument")


def read_timelines(timelines: Sequence[str], defaults: Mapping[str, object] = NO_DEFAULTS) -> PromptReader:
    """Read timelines given as arguments; a problem names the number of the argument."""
    return PromptReader(((i, {"timeline": t, **defaults}) for i, t in enumerate(timelines, 1)), "timelines", "argument")


def read_rows(raws: Iterable[object], defaults: Mapping[str, object] = NO_DEFAULTS) -> PromptReader:
    """Read the rows of a program; a problem names the number of the row, from 1."""
    return PromptReader(((number, _completed(raw, defaults)) for number, raw in enumerate(raws, 1)), "rows", "row")


def read_file(
    path: str,
    file_format: Format | None = None,
    defaults: Mapping[str, object] = NO_DEFAULTS,
    extra_columns: ExtraColumns = "refuse",
) -> PromptReader:
    """Read the items of a file, or of stdin for `-`.

    Args:
        path: `.csv` with a header line, `.jsonl` with an object a line, `.txt` with a prompt a line, each also packed
            as `.gz`, or `-`.
        file_format: for `-` and other endings; stdin is otherwise guessed from its first line.
        defaults: fields of lines that do not set them.
        extra_columns: treatment of unknown columns of a table.

    Raises:
        InvalidFile, TooLarge, NotFound, InvalidInput: as `rows_of_file`, while the items are read.
    """
    lines = rows_of_file(path, file_format, extra_columns=extra_columns)
    return PromptReader(((number, _completed(raw, defaults)) for number, raw in lines), where_of(path))


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


def read_evaluation_prompts(
    path: str, *, extra_columns: ExtraColumns = "refuse", check: PromptCheck | None = None
) -> tuple[tuple[EvaluationPrompt, ...], list[int | None]]:
    """Read the prompts of an evaluation, and the line of each.

    Columns are `prompt` or `timeline`, `seconds`, `expected` and, in JSONL, `constraints`.

    Args:
        check: returns further problems of a row that can be used.

    Raises:
        InvalidItems: with every problem of every line.
        InvalidFile, TooLarge, NotFound, InvalidInput: as `rows_of_file`.
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
    """Iterate over the lines of a file with their numbers; only the columns of a table are checked.

    Raises:
        InvalidFile: not UTF-8, or not of that format at all.
        TooLarge: over `MAX_BODY_BYTES` of text; it is not read further.
        NotFound, InvalidInput: no such file, or no way to tell its format.
    """
    with open_text(path, limit=MAX_BODY_BYTES) as text:
        lines = enumerate(text, 1)
        if file_format is None and path == "-":
            chosen, first = _guess(lines)
        else:
            chosen, first = file_format or _by_ending(path, selectable=columns is COLUMNS), []
        lines = itertools.chain(first, lines)
        if chosen == "csv":
            yield from csv_rows(lines, columns, extra_columns)
        else:
            yield from _jsonl(lines) if chosen == "jsonl" else _txt(lines)


def _completed(raw: object, defaults: Mapping[str, object]) -> object:
    """Return a row with the defaults for fields that it does not set; settings and tags are merged."""
    if not defaults or not isinstance(raw, Mapping):
        return raw
    row = cast("Mapping[object, object]", raw)
    whole = {**defaults, **{name: value for name, value in row.items() if value is not None}}
    if row.get("timeline") is not None and row.get("seconds") is None:
        whole.pop("seconds", None)  # a timeline has a length of its own
    ours, theirs = defaults.get("settings"), row.get("settings")
    if isinstance(ours, Mapping) and isinstance(theirs, Mapping):
        whole["settings"] = {**ours, **theirs}
    more, own = defaults.get("tags"), row.get("tags")
    if isinstance(more, tuple) and isinstance(own, list):
        its = cast("list[object]", own)
        whole["tags"] = [*its, *(tag for tag in cast("tuple[object, ...]", more) if tag not in its)]
    return whole


def _by_ending(path: str, *, selectable: bool) -> Format:
    """Return the format that a file's ending names.

    Args:
        selectable: the caller may choose a format for other endings.

    Raises:
        InvalidInput: another ending.
    """
    name = path.lower().removesuffix(GZIP_ENDING)
    for ending in ("csv", "jsonl", "txt"):
        if name.endswith(f".{ending}"):
            return ending
    hint = "Name it .csv, .jsonl or .txt (.gz too)"
    raise InvalidInput(
        "the file's ending does not name its format",
        where=path,
        hint=f"{hint}, or choose file_format." if selectable else f"{hint}.",
        argument="file_format" if selectable else None,
    )


def _guess(lines: Lines) -> tuple[Format, list[tuple[int, str]]]:
    """Return the format that the first line suggests that is not blank, and the lines that were read."""
    read: list[tuple[int, str]] = []
    for number, line in lines:
        if not is_blank(line):
            read.append((number, line))
            break
    first = read[0][1].strip()[:1000] if read else ""  # a header, or it is none
    if first.startswith("{"):
        return "jsonl", read
    names = next(csv.reader([first], delimiter=delimiter_of(first, COLUMNS)), list[str]())
    return ("csv" if TEXTS.intersection(name.strip().lower() for name in names) else "txt"), read


def _jsonl(lines: Lines) -> Rows:
    for number, line in lines:
        if not is_blank(line):
            yield number, read_json(line)


def _txt(lines: Lines) -> Rows:
    for number, line in lines:
        if not is_blank(line):
            yield number, {"prompt": line.rstrip("\r\n")}
