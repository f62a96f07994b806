"""Timelines: several prompts at stated times that become one motion, as rows and as a text.

The text form is `0-3 a person walks forward; 3-5 a person waves`: a row is START-END in seconds, or as `0:03`, and a
prompt, and `;` separates rows. Standard library only.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, cast

from marey.core.errors import InvalidInput
from marey.core.suggestions import did_you_mean
from marey.items.prompts import check_prompt

MIN_ROW_SECONDS = 1.0
MAX_TIMELINE_SECONDS = 60.0
MAX_ROWS = 60
MAX_TIMELINE_CHARACTERS = 10_000
"""Of the text form."""
SEPARATOR = ";"
TIME_DIGITS = 3
"""Decimal places of times; more are rounded."""
TIMELINE_HINT = "Choose a bundle of the default model, or submit each row as a prompt."
_TIME = r"((?:\d{1,2}:[0-5])?\d+(?:\.\d+)?)(?:\s*s)?"
_ROW = re.compile(rf"\s*{_TIME}\s*[-–]\s*{_TIME}(?![\w.-]|:\d)[\s:,]*(.*)", re.DOTALL)
"""Its time grows with the length of the text, not with its square: no two parts share a stretch of spaces."""
_BETWEEN = " :,"
"""Characters between the times and the prompt, beside other whitespace."""
_UNIT = re.compile(r"s(?![\w.-])")
"""A prompt that would be read as the unit of the time before it."""
_FORM = "write START-END (in seconds, or as m:ss) and a prompt, as 0-3 a person walks; 3-5 a person waves"
_FIELDS = ("start", "end", "prompt")


@dataclass(frozen=True)
class TimelineRow:
    """One prompt of a timeline.

    Attributes:
        start: in seconds, from the beginning of the motion.
        end: in seconds.
        prompt: what the person does between.
    """

    start: float
    end: float
    prompt: str

    def __str__(self) -> str:
        colon = ":" if _UNIT.match(self.prompt) else ""
        return f"{self.times}{colon} {self.prompt}"

    @property
    def times(self) -> str:
        """Return `START-END`."""
        return f"{self.start:g}-{self.end:g}"


def read_timeline(value: object) -> list[dict[str, Any]]:
    """Return the rows of a timeline as JSON objects, in the order of time.

    Args:
        value: the text form, or a list of `{"start": 0, "end": 3, "prompt": "…"}`.

    Raises:
        InvalidInput: another form, an invalid prompt, or rows that overlap, are too short, begin after 0 or end too
            late; the message names the row.
    """
    if isinstance(value, str):
        rows = _rows_of_text(value)
    elif isinstance(value, list | tuple):
        rows = _rows_of_list(cast("Sequence[object]", value))
    else:
        raise InvalidInput(f'is not a timeline: {_FORM}, or a list of {{"start": 0, "end": 3, "prompt": "…"}}')
    _check_times(rows)
    rows.sort(key=lambda row: row[1].start)
    text = text_of([row for _, row in rows])
    if len(text) > MAX_TIMELINE_CHARACTERS:
        raise InvalidInput(f"has {len(text):,} characters; at most {MAX_TIMELINE_CHARACTERS:,} are allowed")
    return [asdict(row) for _, row in rows]


def timeline_rows(value: Sequence[Mapping[str, Any]]) -> list[TimelineRow]:
    """Return the rows of what `read_timeline` returned."""
    return [TimelineRow(float(row["start"]), float(row["end"]), str(row["prompt"])) for row in value]


def text_of(rows: Sequence[TimelineRow]) -> str:
    """Return the text form of rows; `read_timeline` reads the same rows from it."""
    return f"{SEPARATOR} ".join(map(str, rows))


def timeline_text(value: Sequence[Mapping[str, Any]]) -> str:
    """Return the text form of what `read_timeline` returned."""
    return text_of(timeline_rows(value))


def timeline_seconds(value: Sequence[Mapping[str, Any]]) -> float:
    """Return the end of the last row."""
    return max(row.end for row in timeline_rows(value))


def no_timelines(model: str) -> str:
    """Return the message about a model that cannot generate timelines."""
    return f"the model {model!r} cannot generate timelines: it makes no motion between other frames"


def prompts_with_rows(prompt: str, timeline: Sequence[Mapping[str, Any]] | None) -> list[tuple[str | None, str]]:
    """Return each prompt of an item behind the name of its row; without a timeline its only prompt, behind None."""
    if timeline is None:
        return [(None, prompt)]
    return [(f"row {number} ({row.times})", row.prompt) for number, row in enumerate(timeline_rows(timeline), 1)]


def timeline_gaps(timeline: Sequence[Mapping[str, Any]]) -> list[tuple[float, float]]:
    """Return start and end of each gap between rows, in seconds."""
    pairs = itertools.pairwise(timeline_rows(timeline))
    return [(before.end, after.start) for before, after in pairs if before.end < after.start]


_Numbered = list[tuple[int, TimelineRow]]
"""Rows with their numbers in the input, from 1."""


def _rows_of_text(text: str) -> _Numbered:
    if len(text) > 2 * MAX_TIMELINE_CHARACTERS:
        raise InvalidInput(f"has {len(text):,} characters; at most {MAX_TIMELINE_CHARACTERS:,} are allowed")
    parts = text.split(SEPARATOR)
    if not parts[-1].strip():  # after a last separator
        parts.pop()
    if not parts:
        raise InvalidInput(f"is empty: {_FORM}")
    found: _Numbered = []
    for number, part in enumerate(parts, 1):
        match = _ROW.fullmatch(part)
        if match is None:
            raise InvalidInput(f"row {number}, {part.strip()[:60]!r}, has no times: {_FORM}")
        start, end, prompt = match.groups()
        found.append((number, _row(number, _seconds_of(start), _seconds_of(end), prompt)))
    return found


def _seconds_of(time: str) -> float:
    """Return the seconds of `3.5` or, in minutes and seconds, of `0:03.5`."""
    minutes, _, seconds = time.rpartition(":")
    return 60 * int(minutes or 0) + float(seconds)


def _rows_of_list(values: Sequence[object]) -> _Numbered:
    if not values:
        raise InvalidInput("has no rows")
    if len(values) > MAX_ROWS:
        raise InvalidInput(f"has {len(values)} rows; at most {MAX_ROWS} are allowed")
    found: _Numbered = []
    for number, value in enumerate(values, 1):
        if not isinstance(value, Mapping):
            raise InvalidInput(f'row {number} is not an object: write {{"start": 0, "end": 3, "prompt": "…"}}')
        row = cast("Mapping[object, object]", value)
        unknown = [str(name)[:40] for name in row if name not in _FIELDS]
        if unknown:
            meant = did_you_mean(unknown[0], _FIELDS)
            raise InvalidInput(f"row {number}: {unknown[0]!r} is not a known field{meant}; known: {', '.join(_FIELDS)}")
        start, end = (_time(number, name, row.get(name)) for name in ("start", "end"))
        prompt = row.get("prompt")
        if not isinstance(prompt, str):
            raise InvalidInput(f"row {number}: prompt is not a text")
        found.append((number, _row(number, start, end, prompt)))
    return found


def _time(number: int, name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e6:
        raise InvalidInput(f"row {number}: {name} is not a number of seconds")
    return float(value)


def _row(number: int, start: float, end: float, prompt: str) -> TimelineRow:
    if not prompt.strip(_BETWEEN):
        raise InvalidInput(f"row {number} has no prompt: {_FORM}")
    try:
        text = check_prompt(prompt).lstrip(_BETWEEN)
    except InvalidInput as error:
        raise InvalidInput(f"row {number}: {error.message}", hint=error.hint) from error
    if SEPARATOR in text:  # a Greek question mark becomes one
        raise InvalidInput(f"row {number}: the prompt holds {SEPARATOR!r}, which separates rows: use a comma")
    start, end = round(start, TIME_DIGITS), round(end, TIME_DIGITS)
    if not math.isfinite(end):
        raise InvalidInput(f"row {number} ends after {MAX_TIMELINE_SECONDS:g} s, the longest timeline")
    if not math.isfinite(start) or start < 0:
        raise InvalidInput(f"row {number} begins at {start:g}; times count from 0")
    return TimelineRow(start + 0.0, end, text)


def _check_times(rows: _Numbered) -> None:
    """Check the times of rows, which may stand in any order."""
    if len(rows) > MAX_ROWS:
        raise InvalidInput(f"has {len(rows)} rows; at most {MAX_ROWS} are allowed")
    for number, row in rows:
        if row.end <= row.start:
            raise InvalidInput(f"row {number} ({row.times}) ends before it begins")
        if round(row.end - row.start, TIME_DIGITS) < MIN_ROW_SECONDS:
            raise InvalidInput(f"row {number} ({row.times}) is shorter than {MIN_ROW_SECONDS:g} s")
        if row.end > MAX_TIMELINE_SECONDS:
            raise InvalidInput(
                f"row {number} ({row.times}) ends after {MAX_TIMELINE_SECONDS:g} s, the longest timeline"
            )
    in_order = sorted(rows, key=lambda row: row[1].start)
    for (first, before), (second, after) in itertools.pairwise(in_order):
        if after.start < before.end:
            raise InvalidInput(f"row {first} ({before.times}) overlaps row {second} ({after.times})")
    number, first_row = in_order[0]
    if first_row.start > 0:
        raise InvalidInput(
            f"row {number} ({first_row.times}) is the first and begins at {first_row.start:g}; begin at 0"
        )
