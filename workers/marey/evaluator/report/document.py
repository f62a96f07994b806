"""The report as JSON: the same numbers for programs, for results in version control, for the next comparison.

    {"schema": "marey.evaluation-report", "version": 1, "title": …, every field of `Report` by its name}

Times are ISO 8601 in UTC; numbers have six significant digits (settings all of theirs); inapplicable values are null.
Clips are not included: an exhibit has its prompt, seed, verdict and score. A field added with a default keeps the
version; a field that is renamed, removed, or changes its meaning raises it.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import cache
from typing import Any

from pydantic import TypeAdapter, ValidationError

from marey.core.documents import parse_json
from marey.core.errors import InvalidFile
from marey.core.validation import first_problem
from marey.evaluator.report.model import Report
from marey.evaluator.report.parts import Exhibit
from marey.measures.scores import SCHEMA, VERSION, check_document

DIGITS = 6  # significant; intervals are a hundred times wider


def to_json(report: Report) -> bytes:
    """Encode the file. Equal reports give equal bytes."""
    # Settings keep all their digits: users type them in again.
    document = {"schema": SCHEMA, "version": VERSION, **_plain(report), "settings": dict(report.settings)}
    scores = [_text(_score(score)) for score in document.pop("scores")]
    text = _text(document, indent=2).removesuffix("\n}")
    # One line per motion: stored results stay readable, and their differences too.
    lines = "".join(f"\n    {score}," for score in scores).removesuffix(",")
    return f'{text},\n  "scores": [{lines}\n  ]\n}}\n'.encode()


def _score(score: dict[str, Any]) -> dict[str, Any]:
    """Return a score as a row: without the field of timelines, unless it is one; earlier releases do not know it."""
    return {name: value for name, value in score.items() if name != "rows_shown" or value is not None}


def from_json(data: bytes, where: str = "report") -> Report:
    """Read a report, without its clips.

    Raises:
        InvalidFile: invalid JSON, another version, or a field that is missing or of the wrong type.
        InvalidInput: the fields contradict each other.
    """
    fields = check_document(parse_json(data, where), where)
    try:
        return _reader().validate_json(json.dumps(fields), strict=True)
    except ValidationError as error:
        raise InvalidFile(first_problem(error), where=where) from None


@cache
def _reader() -> TypeAdapter[Report]:
    return TypeAdapter(Report)


def _text(value: Any, indent: int | None = None) -> str:
    return json.dumps(value, ensure_ascii=False, indent=indent, allow_nan=False)


def _plain(value: Any) -> Any:
    """Convert dataclasses, times and numbers to JSON; a clip is left out."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        names = [f.name for f in dataclasses.fields(value) if not (isinstance(value, Exhibit) and f.name == "clip")]
        return {name: _plain(getattr(value, name)) for name in names}
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, datetime):
        return value.astimezone(UTC).isoformat().replace("+00:00", "Z")
    if isinstance(value, float):
        return float(f"{value:.{DIGITS}g}")
    return value
