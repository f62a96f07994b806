"""The prompts of an evaluation: allowed values of a line of a file or body, and their only check.

Standard library only: the small client reads files with it, the API bodies, and both report the same problems.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from marey.core.characters import WHITESPACE, check_text
from marey.core.errors import InvalidInput, TooLarge
from marey.items.constraints import named_motions, read_constraints
from marey.items.expected import read_expected
from marey.items.item import CHECKS, Rows, checked, complete_timeline, read_fields
from marey.items.problems import Problem
from marey.items.timeline import timeline_text

COLUMNS = ("prompt", "seconds", "expected", "timeline")
"""Of tables; a cell holds no constraints."""
PromptCheck = Callable[[Mapping[str, Any], int | None], Iterable[Problem]]
MIN_PROMPTS = 2
"""Minimum of prompts: metrics of a set (realism, diversity, retrieval) are undefined for one prompt."""
MAX_PROMPTS = 10_000


@dataclass(frozen=True)
class EvaluationPrompt:
    """One prompt, or a timeline.

    Attributes:
        prompt: the text; of a timeline its text form.
        seconds: requested length; None = the model's estimate.
        expected: text for `marey.items.expected`; None = nothing is checked.
        timeline: prompts at stated times (`marey.items.timeline`); None = the prompt alone.
        constraints: what the motion keeps to (`marey.items.constraints`); None = nothing.
    """

    prompt: str
    seconds: float | None = None
    expected: str | None = None
    timeline: Rows | None = field(default=None, kw_only=True)
    constraints: Rows | None = field(default=None, kw_only=True)

    def as_json(self) -> dict[str, Any]:
        """Return a line of a body, with the given fields only."""
        given = {name: value for name in _CHECKS if (value := getattr(self, name)) is not None}
        if self.timeline is not None:
            del given["prompt"]
        return given


def read_prompts(
    raws: Iterable[tuple[int | None, object]], *, where: str | None = None, check: PromptCheck | None = None
) -> tuple[EvaluationPrompt, ...]:
    """Return all prompts, or raise one error with all problems.

    Args:
        check: yields other problems of a prompt's usable fields.

    Raises:
        InvalidItems: at least one prompt is invalid.
        InvalidInput: fewer than `MIN_PROMPTS`.
        TooLarge: more than `MAX_PROMPTS`.
    """

    def read(raw: object, line: int | None) -> tuple[EvaluationPrompt | None, list[Problem]]:
        values, problems = read_fields(raw, _CHECKS, line)
        if "timeline" in values:
            problems += complete_timeline(values, line)
            if "expected" in values:
                message = "stands beside a timeline, whose rows are judged by their prompts: leave it out"
                problems.append(Problem(line, "expected", message))
        if check is not None:
            problems += check(values, line)
        return (None, problems) if problems else (EvaluationPrompt(**values), [])

    prompts = tuple(checked(_counted(raws, where), read, where=where))
    if len(prompts) < MIN_PROMPTS:
        raise InvalidInput(
            "an evaluation needs more than one prompt",
            where=where,
            hint=f"Give at least {MIN_PROMPTS}; a few hundred give reliable numbers.",
        )
    return prompts


def prompts_of(rows: Iterable[Mapping[str, Any]]) -> tuple[EvaluationPrompt, ...]:
    """Rebuild prompts from the output of `as_json`."""
    return tuple(
        EvaluationPrompt(**row) if "timeline" not in row else EvaluationPrompt(timeline_text(row["timeline"]), **row)
        for row in rows
    )


def prompts_sha256(prompts: Sequence[EvaluationPrompt]) -> str:
    """Return one digest of prompts, lengths, expectations and their order: equal digests are comparable."""
    rows = json.dumps([prompt.as_json() for prompt in prompts], ensure_ascii=False, sort_keys=True)
    return hashlib.sha256(rows.encode()).hexdigest()


def _counted(raws: Iterable[tuple[int | None, object]], where: str | None) -> Iterator[tuple[int | None, object]]:
    """Stop reading once a list is over its limit."""
    for number, row in enumerate(raws):
        if number == MAX_PROMPTS:
            raise TooLarge(f"more than {MAX_PROMPTS:,} prompts, the limit of an evaluation", where=where)
        yield row


def _expected(value: object) -> str:
    if not isinstance(value, str):
        raise InvalidInput('is not a text: write "walk then wave left"')
    read_expected(check_text(value, allowed=WHITESPACE))
    return " ".join(value.lower().split())


def _constraints(value: object) -> list[dict[str, Any]]:
    found = read_constraints(value)
    for where, _ in named_motions(found):
        raise InvalidInput("evaluations read no motions for poses: give `joint_rotations`", where=where)
    return found


_CHECKS: Mapping[str, Callable[[object], object]] = {
    "prompt": CHECKS["prompt"],
    "seconds": CHECKS["seconds"],
    "expected": _expected,
    "timeline": CHECKS["timeline"],
    "constraints": _constraints,
}
