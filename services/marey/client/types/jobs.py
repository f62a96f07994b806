"""Results of `client.jobs`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from marey.client.results import Result
from marey.client.types.common import ErrorDetail
from marey.client.types.motions import Motion

ENDED_JOB = frozenset({"succeeded", "partial", "failed", "cancelled"})


@dataclass(frozen=True, kw_only=True)
class Counters(Result):
    """Number of items in each state."""

    ready: int = 0
    leased: int = 0
    succeeded: int = 0
    failed: int = 0
    dead: int = 0
    cancelled: int = 0


@dataclass(frozen=True, kw_only=True)
class NamedAction(Result):
    """One action that a prompt names.

    Attributes:
        text: the words for it.
        verdict: known, close, tried or unknown.
        action: its id in the vocabulary.
        read_as: the supported action that a `close` one is read as.
    """

    text: str = ""
    verdict: str = ""
    action: str | None = None
    read_as: str | None = None


@dataclass(frozen=True, kw_only=True)
class Scope(Result):
    """The scope of a prompt: what it names, compared with what the bundle supports.

    Attributes:
        by: `words`, or `encoder` where the words leave it undecided.
        verdict: the worst of its actions.
        flags: such as negation, objects, counts, other-language.
    """

    version: int = 0
    by: str = ""
    verdict: str = ""
    actions: tuple[NamedAction, ...] = ()
    flags: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ScopeExample(Result):
    """One of the first prompts of a verdict or with a flag.

    Attributes:
        kind: the verdict or the flag.
        index: place of the prompt in the input, from 0.
        prompt: its first characters.
        actions: actions that make it so.
    """

    kind: str = ""
    index: int = 0
    prompt: str = ""
    actions: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ScopeReport(Result):
    """The scopes of the prompts of a submit.

    Attributes:
        known, close, tried, unknown: prompts of each verdict.
        unlisted: prompts for bundles that list no actions.
        flags: prompts with each flag.
        actions: actions of the bundles to which an unknown prompt went.
    """

    by: str = ""
    known: int = 0
    close: int = 0
    tried: int = 0
    unknown: int = 0
    unlisted: int = 0
    flags: Mapping[str, int] = field(default_factory=dict[str, int])
    examples: tuple[ScopeExample, ...] = ()
    actions: Mapping[str, Sequence[str]] = field(default_factory=dict[str, Sequence[str]])


@dataclass(frozen=True, kw_only=True)
class Job(Result):
    """A job.

    `state` is one of queued, running, paused, succeeded, partial, failed, cancelled.
    """

    id: str
    name: str | None = None
    comment: str | None = None
    priority: int = 0
    control: str = ""
    state: str = ""
    total: int = 0
    counters: Counters = field(default_factory=Counters)
    fail_early: float | None = None
    event_seq: int = 0
    created: datetime | None = None
    started: datetime | None = None
    finished: datetime | None = None
    keep_days: int | None = None
    expires: datetime | None = None
    """When it is deleted; None = never, or not before it ends."""
    erased: datetime | None = None
    """When its prompts were erased."""
    scope: str = ""
    """Treatment of prompts with unknown actions: warn, refuse or ignore."""
    kind: str = ""
    """generate, or edit: its items are made from stored motions."""

    @property
    def has_ended(self) -> bool:
        """True once no item is open any more."""
        return self.state in ENDED_JOB


@dataclass(frozen=True, kw_only=True)
class SubmittedJob(Job):
    """A job that was just submitted."""

    scope_report: ScopeReport | None = None
    """None with scope `ignore`."""
    warnings: tuple[str, ...] = ()
    """Sentences on what the model does not know or may not do."""


@dataclass(frozen=True, kw_only=True)
class Edits(Result):
    """Operations on stored motions."""

    ops: tuple[Mapping[str, Any], ...] = ()
    """Of this result: each split stands as one of its two trims."""
    sources: tuple[str, ...] = ()
    """The edited motion, then the others."""


@dataclass(frozen=True, kw_only=True)
class JobItem(Result):
    """An item of a job, with its motion if it has one."""

    id: str
    job: str = ""
    position: int = 0
    index: int = 0
    variant: int = 0
    name: str | None = None
    prompt: str = ""
    model: str = ""
    bundle: str = ""
    seed: int = 0
    seconds: float | None = None
    settings: Mapping[str, Any] = field(default_factory=dict[str, Any])
    tags: tuple[str, ...] = ()
    stage: str = ""
    state: str = ""
    attempts: int = 0
    reason: str | None = None
    error: ErrorDetail | None = None
    created: datetime | None = None
    finished: datetime | None = None
    replaces: str | None = None
    """The motion that it is another take of."""
    scope: Scope | None = None
    """None = not examined, erased, or the bundle lists no actions."""
    edits: Edits | None = None
    """None if the motion is generated."""
    timeline: tuple[Mapping[str, Any], ...] | None = None
    """Prompts at stated times, of which `prompt` is the text form; None if there is one prompt."""
    constraints: tuple[Mapping[str, Any], ...] | None = None
    """Demands on the motion; None = none."""
    motion: Motion | None = None


@dataclass(frozen=True, kw_only=True)
class JobEvent(Result):
    """One event of a job."""

    job: str = ""
    seq: int = 0
    kind: str = ""
    item: str | None = None
    reason: str = ""
    data: Mapping[str, Any] = field(default_factory=dict[str, Any])
    at: datetime | None = None


@dataclass(frozen=True, kw_only=True)
class Speed(Result):
    """The measured speed of a bundle on this platform."""

    bundle: str = ""
    motions: int = 0
    """Motions that it was measured on, of the last 2,000 that were made."""
    seconds: float = 0.0
    """Of a worker for one motion, without reading the prompt and writing the files."""
    since: datetime | None = None
    until: datetime | None = None


@dataclass(frozen=True, kw_only=True)
class Estimate(Result):
    """Time that motions take once it is their turn."""

    items: int = 0
    seconds: float | None = None
    """None = there is no measure of some bundle."""
    workers: Mapping[str, int] = field(default_factory=dict[str, int])
    """Live workers by model; where there is none, the estimate is for one."""
    speeds: tuple[Speed, ...] = ()
    unmeasured: tuple[str, ...] = ()
    """Bundles with which none of the last motions was made."""
    basis: str = ""
    """Where the number comes from, or why there is none, for a person."""


@dataclass(frozen=True, kw_only=True)
class Quota(Result):
    """A quota and what was asked of it; items or bytes."""

    name: str = ""
    limit: int = 0
    used: int = 0
    left: int = 0
    asked: int = 0


@dataclass(frozen=True, kw_only=True)
class CheckedJob(Result):
    """The answer to `validate_only`."""

    valid: bool = False
    items: int = 0
    bundles: tuple[str, ...] = ()
    estimate: Estimate = field(default_factory=Estimate)
    quotas: tuple[Quota, ...] = ()
    """Those the tenant has, of queued items and of bytes; with room for it."""
    waiting: int = 0
    """Items of all tenants that wait for the same models now, or to be read."""
    scope: str = ""
    scope_report: ScopeReport | None = None
    """None with scope `ignore`."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class CheckedEdit(Result):
    """The answer to `validate_only` of an edit."""

    valid: bool = False
    items: int = 0
    """Resulting motions."""
    bundles: tuple[str, ...] = ()
    """The bundle that generates frames; `edit` if no model is needed."""
    prompts: tuple[str, ...] = ()
    """Of the resulting motions, in their order."""
    estimate: Estimate = field(default_factory=Estimate)
    quotas: tuple[Quota, ...] = ()
    waiting: int = 0
    """Items of all tenants that wait for the same workers now."""
    scope_report: ScopeReport | None = None
    """Of prompts that the operations have; None with scope `ignore`, and without a model."""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class QualityCounts(Result):
    """The motions of a job by their quality.

    Attributes:
        measured: motions with a quality record.
        ok: of these, those without a flag.
        flags: motions with each flag.
    """

    measured: int = 0
    ok: int = 0
    flags: Mapping[str, int] = field(default_factory=dict[str, int])


@dataclass(frozen=True, kw_only=True)
class QueuePosition(Result):
    """The place of a job in the queue."""

    state: str = ""
    jobs_ahead: int = 0
    """Of the same tenant, with items that wait: of higher priority, or older."""
    items_ahead: int = 0
    tenants: int = 0
    """Tenants that wait for the same workers, this one too: they take turns."""
    seconds: float | None = None
    """Until it is done; None = ended, paused or not measured."""
    estimate: Estimate = field(default_factory=Estimate)
    """Of its own open items."""


@dataclass(frozen=True, kw_only=True)
class Erasure(Result):
    """A job whose prompts were erased."""

    job: str = ""
    erased: datetime | None = None
    files_left: int = 0
    """Files that are still to be rewritten, of edits too; they cannot be fetched before."""
    edits: tuple[str, ...] = ()
    """Jobs of edits of its motions; their prompts were erased with it."""
