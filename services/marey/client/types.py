"""Results of the API as frozen dataclasses, with the API's field names.

A client works with servers that are one release older or newer: fields of a newer server stand in `raw` alone, and
fields that an older server does not send have their defaults. States are strings, because a newer server may have more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from marey.client.results import Result

ENDED_JOB = frozenset({"succeeded", "partial", "failed", "cancelled"})
ENDED_STREAM = frozenset({"ended", "failed"})
OPEN_EVALUATION = frozenset({"planned", "generating", "scoring"})


@dataclass(frozen=True, kw_only=True)
class File(Result):
    """A stored file."""

    format: str = ""
    sha256: str = ""
    size: int = 0
    media_type: str = ""


@dataclass(frozen=True, kw_only=True)
class ErrorDetail(Result):
    """The reason why an item has no result."""

    type: str = ""
    message: str = ""
    where: str | None = None
    hint: str | None = None


@dataclass(frozen=True, kw_only=True)
class Review(Result):
    """The verdict on a motion."""

    verdict: str = ""
    at: datetime | None = None
    by: str = ""
    """Name of an API key."""
    comment: str | None = None


@dataclass(frozen=True, kw_only=True)
class Motion(Result):
    """A motion."""

    id: str
    job: str = ""
    item: str = ""
    index: int = 0
    name: str | None = None
    tags: tuple[str, ...] = ()
    prompt: str = ""
    model: str = ""
    bundle: str = ""
    licence: str = ""
    seed: int = 0
    variant: int = 0
    frames: int = 0
    fps: float = 0.0
    elapsed: float = 0.0
    files: tuple[File, ...] = ()
    created: datetime | None = None
    review: Review | None = None
    replaces: str | None = None
    """The motion that it is another take of."""
    replaced_by: str | None = None
    """The item that is another take of it."""

    @property
    def seconds(self) -> float:
        """The length of the motion."""
        return self.frames / self.fps if self.fps else 0.0


@dataclass(frozen=True, kw_only=True)
class MotionDetail(Motion):
    """A motion with what its npz says of it: rewritten prompt, graph, settings, software."""

    metadata: Mapping[str, Any] = field(default_factory=dict[str, Any])


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

    @property
    def has_ended(self) -> bool:
        """True once no item is open any more."""
        return self.state in ENDED_JOB


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
    """Files that are still to be rewritten; they cannot be fetched before."""


@dataclass(frozen=True, kw_only=True)
class Reroll(Result):
    """Another take of a motion: an item of the same job."""

    motion: str = ""
    item: str = ""
    job: str = ""
    seed: int = 0
    state: str = ""
    made: bool = False
    """False = it was asked for before."""


@dataclass(frozen=True, kw_only=True)
class StreamPrompt(Result):
    """A prompt, and since which frame it is in force."""

    number: int = 0
    """As in frames: from 0; each steer counts one on."""
    frame: int = 0
    prompt: str = ""
    rewritten: str | None = None
    """As it was read; None where that is not on record."""
    not_rewritten: str | None = None
    """Why what the rewriter made of it was not used."""


@dataclass(frozen=True, kw_only=True)
class StreamSkeleton(Result):
    """The joints that frames turn."""

    names: tuple[str, ...] = ()
    parents: tuple[int, ...] = ()
    """Index of each joint's parent, which comes before it; -1 for the root."""
    offsets: tuple[tuple[float, ...], ...] = ()
    """The rest pose: metres from the parent, Y up, facing +Z; the root's own from the floor."""


@dataclass(frozen=True, kw_only=True)
class Stream(Result):
    """A live stream."""

    id: str
    name: str | None = None
    prompt: str = ""
    model: str = ""
    bundle: str = ""
    licence: str | None = None
    """Terms of the weights; None when the bundle is no longer here."""
    seed: int = 0
    state: str = ""
    position: int | None = None
    """How many wait before it; None when it does not wait."""
    reason: str | None = None
    """Why it is over."""
    error: ErrorDetail | None = None
    fps: float | None = None
    """Frames a second; None when the bundle is no longer here."""
    frames: int = 0
    """How many are on record: a second less than were shown, at most."""
    max_frames: int = 0
    job: str | None = None
    """The job that makes the clip; None until the stream is over."""
    created: datetime | None = None
    started: datetime | None = None
    ended: datetime | None = None

    @property
    def has_ended(self) -> bool:
        """True once the stream is over."""
        return self.state in ENDED_STREAM


@dataclass(frozen=True, kw_only=True)
class StreamDetail(Stream):
    """A live stream with its prompts on record and its skeleton."""

    prompts: tuple[StreamPrompt, ...] = ()
    skeleton: StreamSkeleton | None = None
    """The skeleton that the frames drive; None when the bundle is no longer here."""


@dataclass(frozen=True, kw_only=True)
class TrainingData(Result):
    """A data set that weights were trained on."""

    name: str = ""
    licence: str = ""
    credit: str = ""


@dataclass(frozen=True, kw_only=True)
class SamplingSetting(Result):
    """A setting of a model's sampling; minimum and maximum are allowed themselves."""

    name: str = ""
    minimum: float = 0.0
    maximum: float = 0.0
    default: float = 0.0
    whole: bool = False
    """Whole numbers only."""
    help: str = ""


@dataclass(frozen=True, kw_only=True)
class Model(Result):
    """A bundle."""

    name: str = ""
    bundle: str = ""
    model: str = ""
    version: str = ""
    config: str = ""
    random: bool = False
    licence: str = ""
    commercial: bool = False
    skeleton: str | None = None
    fps: float | None = None
    min_seconds: float = 0.0
    max_seconds: float = 0.0
    encoder: str = ""
    data: tuple[TrainingData, ...] = ()
    metrics: Mapping[str, float] = field(default_factory=dict[str, float])
    settings: tuple[SamplingSetting, ...] = ()
    about: str = ""
    """A few lines on the abilities and limits of the model; empty where the server does not know it."""


@dataclass(frozen=True, kw_only=True)
class EvaluationRequest(Result):
    """The request of an evaluation."""

    bundle: str = ""
    """Exact since its motions were asked for; in a schedule, the name that was given."""
    model: str | None = None
    evaluator: str | None = None
    source: str = ""
    """A split of the evaluator's bundle, or what its prompts are called."""
    settings: Mapping[str, float] = field(default_factory=dict[str, float])
    repeats: int = 0
    seed: int = 0
    baseline: str | None = None


@dataclass(frozen=True, kw_only=True)
class EvaluationJob(Result):
    """A job of an evaluation."""

    id: str
    state: str = ""
    total: int = 0
    succeeded: int = 0
    ended: int = 0
    """Items that succeeded, failed, died or were cancelled."""
    started: datetime | None = None
    finished: datetime | None = None


@dataclass(frozen=True, kw_only=True)
class EvaluationEvent(Result):
    """A change of state."""

    state: str = ""
    reason: str = ""
    at: datetime | None = None


@dataclass(frozen=True, kw_only=True)
class Evaluation(Result):
    """An evaluation."""

    id: str
    schedule: str | None = None
    due: datetime | None = None
    """The time of its schedule that it stands for; None = it was asked for."""
    name: str | None = None
    comment: str | None = None
    state: str = ""
    reason: str = ""
    """Why it came to this state."""
    request: EvaluationRequest = field(default_factory=EvaluationRequest)
    prompts: int | None = None
    """How many; None while they were not looked up."""
    prompts_sha256: str | None = None
    generation: EvaluationJob | None = None
    scoring: EvaluationJob | None = None
    summary: Mapping[str, float | None] | None = None
    regressed: bool | None = None
    """Worse than what it was compared with; None = nothing to compare with."""
    reports: tuple[File, ...] = ()
    """`Evaluations.report` reads each."""
    created: datetime | None = None
    started: datetime | None = None
    finished: datetime | None = None

    @property
    def has_ended(self) -> bool:
        """True once it is done, failed or cancelled."""
        return self.state not in OPEN_EVALUATION


@dataclass(frozen=True, kw_only=True)
class EvaluationDetail(Evaluation):
    """An evaluation with its history."""

    events: tuple[EvaluationEvent, ...] = ()
    waits_for: str | None = None
    """What it cannot go on without: a queue that no living worker serves."""


@dataclass(frozen=True, kw_only=True)
class ComparedRun(Result):
    """One of two compared evaluations."""

    id: str
    name: str | None = None
    bundle: str = ""
    motions: int = 0
    """With scores."""


@dataclass(frozen=True, kw_only=True)
class MetricChange(Result):
    """The change of a metric that each motion has: in per cent, over the motions that both runs have."""

    metric: str = ""
    before: float = 0.0
    after: float = 0.0
    low: float = 0.0
    """Of the 95 % interval of after - before, by paired bootstrap over the prompts."""
    high: float = 0.0
    prompts: int = 0
    motions: int = 0
    verdict: str = ""


@dataclass(frozen=True, kw_only=True)
class MetricPair(Result):
    """A metric that no motion has by itself: both numbers as the runs reported them, and no verdict."""

    metric: str = ""
    before: float = 0.0
    after: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Comparison(Result):
    """The changes from one evaluation to another."""

    before: ComparedRun
    after: ComparedRun
    regressed: bool | None = None
    """Some metric is worse; None = nothing could be paired."""
    changes: tuple[MetricChange, ...] = ()
    others: tuple[MetricPair, ...] = ()
