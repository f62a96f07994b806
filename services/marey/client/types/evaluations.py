"""Results of `client.evaluations`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime

from marey.client.results import Result
from marey.client.types.common import File

OPEN_EVALUATION = frozenset({"planned", "generating", "scoring"})


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
    """The queue that has no live worker, where the evaluation waits for one; None = it does not."""


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
