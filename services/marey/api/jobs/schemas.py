"""Bodies and answers of the job routes."""

from __future__ import annotations

from datetime import datetime
from typing import Any, Literal
from uuid import UUID

from pydantic import BaseModel, ConfigDict, Field

from marey.api.jobs.estimates import EstimateView
from marey.api.takes.schemas import MotionView
from marey.http.fields import ITEM_MODEL, ITEM_NAME, PROMPT, SAMPLING, TAGS, TIMELINE
from marey.http.problems import QuotaBody
from marey.http.schemas import Comment, JsonBody, Name, View
from marey.items.item import MAX_ITEMS
from marey.items.timeline import MAX_TIMELINE_SECONDS, MIN_ROW_SECONDS
from marey.items.values import MAX_SECONDS, MAX_SEED, MAX_TAGS, MAX_VARIANTS, MIN_SECONDS
from marey.jobs import (
    MAX_KEEP_DAYS,
    PRIORITY_LIMIT,
    Edits,
    EventRow,
    FailureReason,
    ItemRow,
    ItemStage,
    ItemState,
    JobControl,
    JobKind,
    JobRow,
    JobState,
)
from marey.jobs.quality_counts import QualityCounts
from marey.vocabulary.report import ScopeReport
from marey.vocabulary.scope import ScopePolicy, Verdict

SCOPE = "Prompts with actions that the model does not know: accepted with a warning, refused, or not examined."


class TimelineRowBody(BaseModel):
    """One prompt of a timeline."""

    model_config = ConfigDict(extra="forbid")

    start: float = Field(ge=0, le=MAX_TIMELINE_SECONDS, description="In seconds.")
    end: float = Field(ge=MIN_ROW_SECONDS, le=MAX_TIMELINE_SECONDS, description="In seconds, at least 1 after `start`.")
    prompt: str = Field(description="What the person does between.", json_schema_extra=PROMPT)


class NewItemBody(BaseModel):
    """One prompt. For the documentation: `marey.items.item.read_item` validates it, with more detailed messages."""

    model_config = ConfigDict(extra="forbid")

    prompt: str | None = Field(
        None,
        description="What the person does, in English, at most 200 words; needed unless there is a `timeline`.",
        json_schema_extra=PROMPT,
    )
    name: str | None = Field(
        None,
        description="Name of the motion, in any script; clients derive its file name from it.",
        json_schema_extra=ITEM_NAME,
    )
    seconds: float | None = Field(
        None, ge=MIN_SECONDS, le=MAX_SECONDS, description="None = as the prompt states, else the model decides."
    )
    seed: int | None = Field(None, ge=0, le=MAX_SEED, description="Seed of variant 0; variant k uses seed + k.")
    variants: int | None = Field(
        None, ge=1, le=MAX_VARIANTS, description="Motions of the prompt, each with its own seed; None = 1."
    )
    model: str | None = Field(None, description="Model, bundle or exact bundle.", json_schema_extra=ITEM_MODEL)
    tags: list[str] | None = Field(
        None,
        max_length=MAX_TAGS,
        description="Words or `key=value`, such as `shot=010`, by which motions are found.",
        json_schema_extra=TAGS,
    )
    settings: dict[str, Any] | None = Field(
        None,
        description="Sampling settings of the model, such as `guidance`, and `fps`, `best_of`, `redraws`.",
        json_schema_extra=SAMPLING,
    )
    variety: Literal["low", "normal", "high"] | None = Field(
        None, description="How much motions of the prompt differ; None = `normal`, as the bundle ships."
    )
    timeline: list[TimelineRowBody] | str | None = Field(
        None,
        description="Instead of `prompt`: prompts at stated times, up to 60 s, as rows or as a text such as "
        "`0-3 a person walks forward; 3-5 a person waves`.",
        json_schema_extra=TIMELINE,
    )
    constraints: list[dict[str, Any]] | None = Field(
        None,
        description="What the motion keeps to. A pose keyframe may name a frame of a stored motion, as "
        '`"motion": {"id": "…", "frame": 0}`: its pose is read when the job is submitted.',
    )


class CommonJobFields(BaseModel):
    """Fields that jobs of every kind have."""

    model_config = ConfigDict(extra="forbid")

    name: Name | None = Field(None, description="A name by which the job is found; need not be unique.")
    comment: Comment | None = Field(None, description="A note for people.")
    priority: int = Field(
        0,
        ge=-PRIORITY_LIMIT,
        le=PRIORITY_LIMIT,
        description="Order among the jobs of the tenant: higher runs first.",
    )
    keep_days: int | None = Field(
        None, ge=1, le=MAX_KEEP_DAYS, description="Days after its end when the job is deleted, with motions and files."
    )


class JobFields(CommonJobFields):
    """Fields of the job as a whole."""

    fail_early: float | None = Field(
        None, ge=0, le=1, description="Ratio of failed items above which open items are cancelled."
    )
    scope: ScopePolicy = Field("warn", description=SCOPE)


class JsonJobFields(JobFields, JsonBody):
    """Fields of the job as a whole, in a body of JSON."""


class NewJobBody(JsonJobFields):
    """A job as JSON."""

    items: list[NewItemBody] = Field(
        min_length=1, max_length=MAX_ITEMS, description="Prompts; all variants together are at most 100,000 motions."
    )


class JobPatch(JsonBody):
    """Changes to a job; omitted fields stay as they are."""

    priority: int | None = Field(None, ge=-PRIORITY_LIMIT, le=PRIORITY_LIMIT)
    comment: Comment | None = None
    fail_early: float | None = Field(
        None, ge=0, le=1, description="Ratio of failed items above which open items are cancelled; null = off."
    )


class NamedActionView(View):
    """One action that a prompt names."""

    text: str
    """The words for it."""
    verdict: Verdict
    action: str | None = None
    """Id in the vocabulary."""
    read_as: str | None = None
    """Supported action that a `close` one is read as."""


class ScopeView(View):
    """Scope of a prompt: what it names, compared with what the bundle supports."""

    version: int
    by: str
    """`words`: judged by the words of the prompt; `encoder`: by its meaning, where the words leave it undecided."""
    verdict: Verdict
    """The worst of its actions."""
    actions: list[NamedActionView]
    flags: list[str]


class ScopeExampleView(View):
    """One of the first prompts of a verdict or with a flag."""

    kind: str
    """The verdict or the flag."""
    index: int
    """Place of the prompt in the input, from 0."""
    prompt: str
    """Its first characters."""
    actions: list[str]


class ScopeReportView(View):
    """Scopes of the prompts of a submit."""

    by: str
    known: int
    """Prompts of this verdict, as the next three."""
    close: int
    tried: int
    unknown: int
    unlisted: int
    """Prompts for bundles that list no actions."""
    flags: dict[str, int]
    """Prompts with each flag."""
    examples: list[ScopeExampleView]
    actions: dict[str, list[str]]
    """Actions that bundles know to which an `unknown` prompt went."""


class CheckedView(View):
    """The answer to `validate_only`."""

    valid: bool
    items: int
    """Number of motions."""
    bundles: list[str]
    estimate: EstimateView
    quotas: list[QuotaBody] = Field(
        description="The tenant's quotas of queued items and of bytes, with the capacity left."
    )
    waiting: int = Field(description="Items of all tenants that wait for the same models, or to be parsed.")
    scope: ScopePolicy
    scope_report: ScopeReportView | None = Field(description="Null with scope `ignore`.")
    warnings: list[str]


class CountersView(View):
    """Number of items by state."""

    ready: int = Field(description="Items that wait for a worker.")
    leased: int = Field(description="Items that a worker generates now.")
    succeeded: int = Field(description="Items with a motion.")
    failed: int = Field(description="Items that cannot be generated; their `error` says why.")
    dead: int = Field(description="Items whose attempts are used up.")
    cancelled: int


class QualityCountsView(View):
    """Motions of a job by their quality."""

    measured: int = Field(description="Motions with a quality record.")
    ok: int = Field(description="Motions without a flag, of these.")
    flags: dict[str, int] = Field(description="Motions with each flag.")

    @classmethod
    def of(cls, counts: QualityCounts) -> QualityCountsView:
        """Convert counts."""
        return cls(measured=counts.measured, ok=counts.ok, flags=dict(counts.flags))


class JobView(View):
    """A job."""

    id: UUID
    name: str | None
    comment: str | None
    priority: int = Field(description="Higher runs first, among the jobs of the tenant.")
    control: JobControl = Field(description="What was asked for last: to run, to pause or to cancel.")
    state: JobState = Field(
        description="`succeeded`, `partial` (some items have no motion), `failed` and `cancelled` are ends."
    )
    total: int = Field(description="Number of items: prompts times variants.")
    counters: CountersView
    fail_early: float | None = Field(description="Ratio of failed items above which open items are cancelled.")
    event_seq: int = Field(description="Number of the newest event.")
    created: datetime
    started: datetime | None = Field(description="Time of the first claim by a worker; null = not yet.")
    finished: datetime | None = Field(description="Time at which the last item ended; null = some are open.")
    keep_days: int | None = Field(description="Days from its end to its deletion; null = kept.")
    expires: datetime | None = Field(description="Time of deletion; null = never, or not before it ends.")
    erased: datetime | None = Field(description="Time when its prompts were erased.")
    scope: ScopePolicy
    kind: JobKind

    @classmethod
    def of(cls, row: JobRow) -> JobView:
        """Convert a row."""
        counters = CountersView(**{name: getattr(row, name) for name in CountersView.model_fields})
        own = {name: getattr(row, name) for name in cls.model_fields if name != "counters"}
        return cls(counters=counters, **own)


class SubmittedView(JobView):
    """A job that was just submitted."""

    scope_report: ScopeReportView | None = Field(description="Null with scope `ignore`.")
    warnings: list[str]

    @classmethod
    def with_report(cls, row: JobRow, report: ScopeReport | None) -> SubmittedView:
        """Convert a row and the scopes of its prompts."""
        return cls(**JobView.of(row).model_dump(), **report_fields(report))


def report_fields(report: ScopeReport | None) -> dict[str, Any]:
    """Return the fields of an answer that tell the scopes of prompts; None = they were not examined."""
    if report is None:
        return {"scope_report": None, "warnings": []}
    return {"scope_report": report.as_json(), "warnings": report.warnings()}


class ErasureView(View):
    """A job whose prompts were erased."""

    job: UUID
    erased: datetime
    files_left: int = Field(
        description="Files that still wait to be rewritten, of edits too; they are not served before."
    )
    edits: list[UUID] = Field(description="Jobs of edits of its motions; their prompts were erased with it.")


class ErrorView(View):
    """Reason why an item has no result."""

    type: str
    message: str
    where: str | None
    hint: str | None

    @classmethod
    def of(cls, problem: FailureReason) -> ErrorView:
        """Convert a row's problem."""
        return cls(type=problem.type, message=problem.message, where=problem.where, hint=problem.hint)


class EditsView(View):
    """Operations on stored motions."""

    ops: list[dict[str, Any]]
    """Of this result: each split stands as one of its two trims."""
    sources: list[UUID]
    """The edited motion, then the others."""

    @classmethod
    def of(cls, edits: Edits) -> EditsView:
        """Convert the operations of a row."""
        return cls(ops=[dict(op) for op in edits.ops], sources=list(edits.sources))


class ItemView(View):
    """An item, with its motion if it has one."""

    id: UUID
    job: UUID
    position: int
    index: int
    variant: int
    name: str | None
    prompt: str
    model: str
    bundle: str
    seed: int
    seconds: float | None
    settings: dict[str, Any]
    tags: list[str]
    stage: ItemStage
    state: ItemState
    attempts: int
    reason: str | None
    error: ErrorView | None
    created: datetime
    finished: datetime | None
    replaces: UUID | None = Field(description="Replaced motion of a re-roll.")
    scope: ScopeView | None = Field(description="Null: not examined, erased, or the bundle lists no actions.")
    edits: EditsView | None = Field(description="Null if the motion is generated.")
    timeline: list[TimelineRowBody] | None = Field(
        None, description="Prompts at stated times, of which `prompt` is the text form; null if there is one prompt."
    )
    constraints: list[dict[str, Any]] | None = Field(None, description="What the motion keeps to.")
    motion: MotionView | None

    @classmethod
    def of(cls, row: ItemRow) -> ItemView:
        """Convert a row."""
        apart = {"settings", "tags", "error", "scope", "edits", "timeline", "constraints", "motion"}
        return cls(
            scope=None if row.scope is None else ScopeView.model_validate(row.scope),
            settings=dict(row.settings),
            tags=list(row.tags),
            edits=None if row.edits is None else EditsView.of(row.edits),
            timeline=None if row.timeline is None else [TimelineRowBody(**each) for each in row.timeline],
            constraints=None if row.constraints is None else [dict(each) for each in row.constraints],
            error=None if row.problem is None else ErrorView.of(row.problem),
            motion=None if row.motion is None else MotionView.of(row.motion),
            **{name: getattr(row, name) for name in cls.model_fields if name not in apart},
        )


class EventView(View):
    """One event of a job."""

    job: UUID
    seq: int
    kind: str
    item: UUID | None
    reason: str
    data: dict[str, Any]
    at: datetime

    @classmethod
    def of(cls, row: EventRow) -> EventView:
        """Convert a row."""
        return cls(data=dict(row.data), **{n: getattr(row, n) for n in cls.model_fields if n != "data"})


class EventsView(View):
    """Events after a `seq`, in order."""

    items: list[EventView]
    next: int | None = Field(description="`after` of the next page; null when there is no more yet.")
