"""Bodies and answers of the evaluation routes."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, Any, Literal
from uuid import UUID

from pydantic import Field

from marey.api.files import FileView
from marey.api.jobs.schemas import TimelineRowBody
from marey.evaluations import EvaluationEvent, EvaluationJob, EvaluationRequest, EvaluationRow, EvaluationState
from marey.http.fields import EXPECTED, PROMPT, SAMPLING, TIMELINE
from marey.http.schemas import MAX_NAME, Comment, FreeText, JsonBody, Name, View
from marey.items.evaluation_prompts import MAX_PROMPTS, MIN_PROMPTS
from marey.items.values import MAX_SECONDS, MAX_SEED, MAX_VARIANTS, MIN_SECONDS, MODEL_PATTERN
from marey.jobs.states import JobState


class EvaluationPromptBody(JsonBody):
    """One prompt. For the documentation: `marey.items.evaluation_prompts` validates it, with more detailed messages."""

    prompt: str | None = Field(
        None,
        description="What the person does, in English, at most 200 words; needed unless there is a `timeline`.",
        json_schema_extra=PROMPT,
    )
    seconds: float | None = Field(None, ge=MIN_SECONDS, le=MAX_SECONDS, description="None = the model decides.")
    expected: str | None = Field(
        None,
        description='What the motion must show: "walk", "walk straight then wave left"; not with a timeline.',
        json_schema_extra=EXPECTED,
    )
    timeline: list[TimelineRowBody] | str | None = Field(
        None, description="Instead of `prompt`: prompts at stated times, as in items.", json_schema_extra=TIMELINE
    )
    constraints: list[dict[str, Any]] | None = Field(None, description="What the motion keeps to, as in items.")


class EvaluationFields(JsonBody):
    """Subject and parameters of an evaluation."""

    bundle: str = Field(
        pattern=MODEL_PATTERN, max_length=200, description="Model, bundle or exact bundle that generates."
    )
    evaluator: str | None = Field(
        None,
        pattern=MODEL_PATTERN,
        max_length=200,
        description="Bundle that measures; default: the only one on the server.",
    )
    split: Literal["test", "compositional", "test+compositional"] | None = Field(
        None, description="Captions that the evaluator's bundle carries, of a split or of both. Else give `prompts`."
    )
    source: Annotated[str, Field(min_length=1, max_length=MAX_NAME), FreeText()] | None = Field(
        None, description="Name of the prompts in reports."
    )
    settings: dict[str, Any] | None = Field(
        None, description="Sampling settings, such as `guidance`.", json_schema_extra=SAMPLING
    )
    repeats: int = Field(1, ge=1, le=MAX_VARIANTS, description="Motions of each prompt.")
    seed: int = Field(
        0, ge=0, le=MAX_SEED, description="Seed of the first motion; motion k uses seed + k: equal runs are comparable."
    )
    baseline: UUID | None = Field(None, description="An evaluation of the same prompts to compare with.")


class AskedFields(EvaluationFields):
    """Subject and parameters of an evaluation, with its prompts."""

    prompts: list[EvaluationPromptBody] | None = Field(None, min_length=MIN_PROMPTS, max_length=MAX_PROMPTS)


class NewEvaluationBody(AskedFields):
    """An evaluation as JSON."""

    name: Name | None = None
    comment: Comment | None = None


class EvaluationJobView(View):
    """A job of an evaluation."""

    id: UUID
    state: JobState
    total: int
    succeeded: int
    ended: int = Field(description="Items that succeeded, failed, died or were cancelled.")
    started: datetime | None
    finished: datetime | None

    @classmethod
    def of(cls, job: EvaluationJob) -> EvaluationJobView:
        """Convert a row."""
        return cls(**{name: getattr(job, name) for name in cls.model_fields})


class RequestView(View):
    """Subject and parameters of an evaluation."""

    bundle: str = Field(description="Exact since generation started; in a schedule, the given name.")
    model: str | None
    evaluator: str | None
    source: str = Field(description="A split of the evaluator's bundle, or the name of its prompts.")
    settings: dict[str, float]
    repeats: int
    seed: int
    baseline: UUID | None

    @classmethod
    def of(cls, request: EvaluationRequest) -> RequestView:
        """Convert a row."""
        values = {name: getattr(request, name) for name in cls.model_fields}
        return cls(**{**values, "settings": dict(request.settings)})


class EvaluationView(View):
    """An evaluation."""

    id: UUID
    schedule: UUID | None
    due: datetime | None = Field(description="Due time of its schedule; null = requested directly.")
    name: str | None
    comment: str | None
    state: EvaluationState
    reason: str = Field(description="Reason of the current state.")
    request: RequestView
    prompts: int | None = Field(description="Number of prompts; null until they are resolved.")
    prompts_sha256: str | None
    generation: EvaluationJobView | None
    scoring: EvaluationJobView | None
    summary: dict[str, float | None] | None
    regressed: bool | None = Field(description="True if worse than the baseline; null = no baseline.")
    reports: list[FileView] = Field(description="`GET /v1/evaluations/{id}/report/{format}` gives each.")
    created: datetime
    started: datetime | None
    finished: datetime | None

    @classmethod
    def of(cls, row: EvaluationRow) -> EvaluationView:
        """Convert a row."""
        return cls(**_fields(row))


class EvaluationEventView(View):
    """A change of state."""

    state: EvaluationState
    reason: str
    at: datetime


class EvaluationDetailView(EvaluationView):
    """An evaluation with its history."""

    events: list[EvaluationEventView]
    waits_for: str | None = Field(description="The queue that it waits for, because no live worker serves it.")

    @classmethod
    def detail(
        cls, row: EvaluationRow, events: Sequence[EvaluationEvent], waits_for: str | None
    ) -> EvaluationDetailView:
        """Convert a row, its events, and the name of the queue it waits for."""
        changes = [EvaluationEventView(state=event.state, reason=event.reason, at=event.at) for event in events]
        return cls(events=changes, waits_for=waits_for, **_fields(row))


def _fields(row: EvaluationRow) -> dict[str, Any]:
    apart = {"request", "prompts", "prompts_sha256", "generation", "scoring", "reports", "summary"}
    own = {name: getattr(row, name) for name in EvaluationView.model_fields if name not in apart}
    return {
        **own,
        "request": RequestView.of(row.request),
        "prompts": row.prompt_count,
        "prompts_sha256": row.prompts,
        "generation": None if row.generation is None else EvaluationJobView.of(row.generation),
        "scoring": None if row.scoring is None else EvaluationJobView.of(row.scoring),
        "reports": [
            FileView(format=f.format, sha256=f.sha256, size=f.size, media_type=f.media_type) for f in row.reports
        ],
        "summary": None if row.summary is None else dict(row.summary),
    }
