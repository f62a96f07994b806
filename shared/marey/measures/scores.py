"""Scores of each motion of an evaluation: the part of a report that later runs are paired with.

Standard library only. The rest of a report is the evaluator's own (`marey.evaluator.report`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, cast

from marey.core.documents import parse_json
from marey.core.errors import InvalidFile, InvalidInput

SCHEMA, VERSION = "marey.evaluation-report", 1


@dataclass(frozen=True)
class MotionScore:
    """Scores of one motion; None if not measured.

    Attributes:
        index: index of the prompt.
        variant: number among the prompt's motions.
        obeyed: 1 if the motion passed its prompt check, else 0.
        retrieved: same-label R-precision of this motion, the share of its pools in which a motion of its prompt's label
            was among the nearest, 0 to 1.
        rows_shown: share of the judged rows of a timeline that show their prompts, 0 to 1; None for other motions.
    """

    index: int
    variant: int
    obeyed: float | None
    retrieved: float | None
    rows_shown: float | None = None

    def __post_init__(self) -> None:
        for score in (self.obeyed, self.retrieved, self.rows_shown):
            if score is not None and not 0 <= score <= 1:
                raise InvalidInput(f"a score of {score}", where=f"prompt {self.index}, variant {self.variant}")


def check_document(document: object, where: str) -> dict[str, Any]:
    """Return the fields of a report that was parsed from JSON.

    Raises:
        InvalidFile: not a report, or of another version.
    """
    if not isinstance(document, dict) or cast("dict[str, Any]", document).get("schema") != SCHEMA:
        raise InvalidFile("is not a report of an evaluation", where=where, hint=f'`schema` must be "{SCHEMA}".')
    fields = dict(cast("dict[str, Any]", document))
    if fields.get("version") != VERSION:
        raise InvalidFile(f"has version {fields.get('version')}; this Marey reads version {VERSION}", where=where)
    return {name: value for name, value in fields.items() if name not in ("schema", "version")}


def read_scores(data: bytes, where: str) -> tuple[MotionScore, ...]:
    """Return the scores of a JSON report; the rest is ignored.

    Raises:
        InvalidFile: not a report, of another version, or with invalid scores.
    """
    document = parse_json(data, where)
    rows: Any = check_document(document, where).get("scores")
    try:
        return tuple(MotionScore(**_numbers(row)) for row in rows)
    except (TypeError, InvalidInput) as error:
        raise InvalidFile(f"`scores`: {error}", where=where) from None


def _numbers(row: dict[str, Any]) -> dict[str, Any]:
    for name, value in row.items():
        kinds = int if name in ("index", "variant") else int | float | None
        if not isinstance(value, kinds) or isinstance(value, bool):
            raise TypeError(f"{name} is {value!r}")
    return row
