"""Data types of the repositories of `marey.jobs`: frozen dataclasses without SQL."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any, TypeVar
from uuid import UUID

from marey.core.errors import MareyError
from marey.items.item import ItemSpec
from marey.jobs.states import ItemStage, ItemState, JobControl, JobKind, JobState, Review
from marey.tenants.types import DEFAULT_TENANT
from marey.vocabulary.scope import ScopePolicy

TEXT_QUEUE = "text"
EVALUATOR_QUEUE = "evaluator"
"""The queue of score items."""
EDIT_QUEUE = "edit"
"""The queue of edits of stored motions; also `model` and `bundle` of their items."""
NO_TEXT = ""
"""`text_key` of an item without text features: it starts at `generate`."""
SEED_LIMIT = 2**31
"""Seeds are 0 … 2³¹ − 1."""
PRIORITY_LIMIT = 1000
"""Priorities are −1000 … 1000; higher first."""

MAX_KEEP_DAYS = 36_500

JsonObject = Mapping[str, object]
Row = TypeVar("Row")


@dataclass(frozen=True)
class FailureReason:
    """Reason of an item's failure, for users: the fields of `marey.core.errors.MareyError`."""

    type: str
    message: str
    where: str | None = None
    hint: str | None = None

    @classmethod
    def of(cls, error: MareyError) -> FailureReason:
        """Convert an expected error."""
        return cls(error.problem_type, error.message, error.where, error.hint)


@dataclass(frozen=True)
class Edits:
    """Operations on stored motions.

    Attributes:
        ops: as in JSON (`docs/reference/edits.md`); other motions stand in them by their ids.
        sources: the edited motion, then the others in the order of the operations.
        asked: name of each operation in the request, for errors; empty where all are the same: a split becomes trims.
    """

    ops: tuple[Mapping[str, Any], ...]
    sources: tuple[UUID, ...]
    asked: tuple[str, ...] = ()

    @classmethod
    def of(cls, document: Mapping[str, Any] | None) -> Edits | None:
        """Read the column; None if the item is not an edit.

        Raises:
            KeyError, TypeError, ValueError, AttributeError: it is no such value.
        """
        if document is None:
            return None
        asked = tuple(map(str, document.get("asked", ())))
        if len(asked) not in (0, len(document["ops"])):
            raise ValueError(f"{len(asked)} names for {len(document['ops'])} operations")
        return cls(tuple(document["ops"]), tuple(map(UUID, document["sources"])), asked)

    def as_json(self) -> dict[str, Sequence[object]]:
        """Return the value of the column."""
        asked = {"asked": [*self.asked]} if self.asked else {}
        return {"ops": [dict(op) for op in self.ops], "sources": [str(source) for source in self.sources], **asked}


UNREAD = "a person moves"
"""Prompt that the text stage reads for operations of a model without any, so that all items have text features."""


def prompts_of_ops(ops: Iterable[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the prompts that the text stage reads for operations, each once, in their order; `UNREAD` without any."""
    return named_prompts(ops) or (UNREAD,)


def named_prompts(ops: Iterable[Mapping[str, Any]]) -> tuple[str, ...]:
    """Return the prompts of operations, each once, in their order."""
    return tuple(dict.fromkeys(str(op["prompt"]) for op in ops if op.get("prompt")))


# --- submit ---


@dataclass(frozen=True, kw_only=True)
class NewItem(ItemSpec):
    """One motion to generate: a prompt in one variant. The caller expands variants and draws seeds.

    Args:
        index: place of the prompt in the input, from 0; variants share it.
        model: the handler's queue, such as "hgm3".
        bundle: the exact bundle, name and weights hash.
        batch_key: hash of the bundle and the settings that are uniform in a batch.
        text_key: key of the text features (`TextPipeline.key`); `NO_TEXT` = none needed.
        text_batch_key: hash of the text specification; prompts of one claim of the text stage share it.
        seed: 0 … 2³¹ − 1.
        settings: the handler's settings (steps, guidance, fps, formats, …).
        replaces: replaced motion of a re-roll.
        scope: of the prompt, as `marey.vocabulary.scope.Scope.as_json`; None = not examined.
        scope_key: key of the encoder's verdict (`marey.text.keys.scope_key`), which the text stage gives; None = the
            words decide.
        edits: operations on stored motions; None = the motion is generated.
    """

    index: int
    model: str
    bundle: str
    batch_key: str
    text_key: str
    text_batch_key: str
    seed: int
    variant: int = 0
    settings: JsonObject = field(default_factory=dict[str, object])
    replaces: UUID | None = None
    scope: JsonObject | None = None
    scope_key: str | None = None
    edits: Edits | None = None


@dataclass(frozen=True)
class NewJob:
    """A job to submit. `items` is read once, in order, and never held in memory as a whole."""

    items: Iterable[NewItem]
    tenant: str = DEFAULT_TENANT
    name: str | None = None
    comment: str | None = None
    priority: int = 0
    fail_early: float | None = None
    """Ratio of failed and dead items (0 … 1) above which open items are cancelled; None = off."""
    keep_days: int | None = None
    """Days after its end when it is deleted, with motions and files; None = only by hand."""
    count: int | None = None
    """Number of items, if known: a job beyond the quota is refused before it is read."""
    metered: bool = True
    """True if quotas apply. False for work that completes accepted work: a stream's clip, the score of an
    evaluation."""
    idempotency_key: str | None = None
    body_sha256: str | None = None
    """Hex digest of the request's body; goes with `idempotency_key`."""
    traceparent: str | None = None
    """`traceparent` of the request (`marey.core.tracing`)."""
    scope: ScopePolicy = "ignore"
    """Treatment of prompts with unknown actions; the caller has applied it."""
    kind: JobKind = JobKind.GENERATE


@dataclass(frozen=True)
class SubmittedJob:
    """A job in the database; `replayed` if an earlier submit with the same key created it."""

    id: UUID
    replayed: bool
    items: int


# --- rows ---


@dataclass(frozen=True)
class JobRow:
    """A job with its counters."""

    id: UUID
    tenant: str
    name: str | None
    comment: str | None
    priority: int
    control: JobControl
    state: JobState
    total: int
    ready: int
    leased: int
    succeeded: int
    failed: int
    dead: int
    cancelled: int
    fail_early: float | None
    event_seq: int
    created: datetime
    started: datetime | None
    finished: datetime | None
    keep_days: int | None
    expires: datetime | None
    """Time of deletion; None = never, or not before it ends."""
    erased: datetime | None
    """Time when its prompts were erased."""
    scope: ScopePolicy
    kind: JobKind


@dataclass(frozen=True)
class MotionFile:
    """One file of a motion."""

    format: str
    sha256: str
    size: int
    media_type: str


@dataclass(frozen=True)
class MotionRow:
    """A motion with its files, newest first in listings."""

    id: UUID
    tenant: str
    job: UUID
    item: UUID
    name: str | None
    prompt: str
    model: str
    bundle: str
    licence: str
    seed: int
    variant: int
    frames: int
    fps: float
    elapsed: float
    metadata: JsonObject
    files: tuple[MotionFile, ...]
    created: datetime
    index: int
    tags: tuple[str, ...]
    review: Review | None
    reviewed: datetime | None
    reviewed_by: str | None
    """Name of an API key."""
    review_comment: str | None
    replaces: UUID | None
    """Replaced motion of a re-roll."""
    replaced_by: UUID | None
    """Item of its re-roll."""
    edited_from: tuple[UUID, ...]
    """Sources of an edit: the edited motion, then the others; empty if the motion was generated."""

    def file(self, format: str) -> MotionFile | None:
        """Return the stored file of a format; None if there is none."""
        return next((file for file in self.files if file.format == format), None)


@dataclass(frozen=True, kw_only=True)
class ItemRow(ItemSpec):
    """An item with its motion, if it has one."""

    id: UUID
    job: UUID
    position: int
    """Position in the job: input order, variants within prompt."""
    index: int
    variant: int
    model: str
    bundle: str
    seed: int
    settings: JsonObject
    stage: ItemStage
    state: ItemState
    attempts: int
    solo: bool
    run_after: datetime | None
    reason: str | None
    """Reason of the current state."""
    problem: FailureReason | None
    created: datetime
    finished: datetime | None
    replaces: UUID | None
    """Replaced motion of a re-roll."""
    scope: JsonObject | None
    """Scope of the prompt; None = not examined, or erased."""
    edits: Edits | None
    motion: MotionRow | None


@dataclass(frozen=True)
class EventRow:
    """One event of a job; `seq` counts from 1 without gaps, in the order of commits."""

    job: UUID
    seq: int
    kind: str
    item: UUID | None
    reason: str
    data: JsonObject
    at: datetime
