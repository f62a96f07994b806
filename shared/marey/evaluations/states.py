"""States of evaluations, and the table of allowed transitions. A database trigger enforces it too."""

from __future__ import annotations

from enum import StrEnum


class EvaluationState(StrEnum):
    """State of an evaluation. `DONE`, `FAILED` and `CANCELLED` are final; a retry is a new evaluation."""

    PLANNED = "planned"
    GENERATING = "generating"
    """An ordinary background job makes its motions."""
    SCORING = "scoring"
    """A job of one item measures them."""
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"


EVALUATION_TRANSITIONS: dict[EvaluationState, frozenset[EvaluationState]] = {
    EvaluationState.PLANNED: frozenset({EvaluationState.GENERATING, EvaluationState.FAILED, EvaluationState.CANCELLED}),
    EvaluationState.GENERATING: frozenset({EvaluationState.SCORING, EvaluationState.FAILED, EvaluationState.CANCELLED}),
    EvaluationState.SCORING: frozenset({EvaluationState.DONE, EvaluationState.FAILED, EvaluationState.CANCELLED}),
    EvaluationState.DONE: frozenset(),
    EvaluationState.FAILED: frozenset(),
    EvaluationState.CANCELLED: frozenset(),
}
"""Allowed transitions of evaluations; the trigger `evaluation_transition` has the same table."""
OPEN_EVALUATIONS = frozenset({EvaluationState.PLANNED, EvaluationState.GENERATING, EvaluationState.SCORING})
"""States of open evaluations."""
