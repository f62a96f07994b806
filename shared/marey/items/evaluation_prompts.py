"""The prompts of an evaluation: allowed values of a line of a file or body, and their only check.

Standard library only: the small client reads files with it, the API bodies, and both report the same problems.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from marey.core.characters import WHITESPACE, check_text
from marey.core.errors import InvalidInput, TooLarge
from marey.items.expected import read_expected
from marey.items.item import CHECKS, Problem, checked, read_fields

COLUMNS = ("prompt", "seconds", "expected")
PromptCheck = Callable[[Mapping[str, Any], int | None], Iterable[Problem]]
MIN_PROMPTS = 2
"""Minimum of prompts: metrics of a set (realism, diversity, retrieval) are undefined for one prompt."""
MAX_PROMPTS = 10_000


@dataclass(frozen=True)
class EvaluationPrompt:
    """One prompt; `expected` is text for `marey.items.expected`, None = nothing is checked."""

    prompt: str
    seconds: float | None = None
    expected: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Return a line of a body, with the given fields only."""
        return {name: value for name in COLUMNS if (value := getattr(self, name)) is not None}


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
    return tuple(EvaluationPrompt(**row) for row in rows)


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


_CHECKS = {"prompt": CHECKS["prompt"], "seconds": CHECKS["seconds"], "expected": _expected}
