"""Data types of the repositories of evaluations and schedules."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any
from uuid import UUID

from marey.db.ids import new_id
from marey.evaluations.states import EvaluationState
from marey.jobs.lease_types import AssetDigest
from marey.jobs.states import ItemState, JobState
from marey.jobs.types import FailureReason

REPORT_FORMATS = ("html", "json", "md")
TEST_SPLIT, COMPOSITIONAL = "test", "compositional"
"""Splits of an evaluator's bundle: clips outside all training data, and clips whose pairs of action and style are."""
BUNDLE_SOURCES = (TEST_SPLIT, COMPOSITIONAL, f"{TEST_SPLIT}+{COMPOSITIONAL}")
"""Sources of prompts other than custom ones: one of the splits, or both, in this order."""
MAX_MISSING = 0.01
"""Maximum share of missing motions in a report: beyond it, the numbers describe another set."""

Summary = Mapping[str, float | None]
"""Measures by name; None = not measurable."""


@dataclass(frozen=True)
class EvaluationRequest:
    """Subject and parameters of an evaluation.

    Args:
        bundle: the generator: an exact bundle; in a schedule the given name, such as `hgm3-starter` or `hgm3`.
        evaluator: the evaluator's bundle, likewise; None = the only one here.
        model: the model of the generator; None before its bundle is resolved.
        source: source of the prompts: one of `BUNDLE_SOURCES`, or the name of a custom set.
        settings: sampling settings, the same for all motions.
        repeats: motions of each prompt.
        seed: of the first motion; motion k, in input order and repeats within prompt, uses seed + k.
        baseline: an evaluation to compare with, instead of the previous run.
    """

    bundle: str
    evaluator: str | None = None
    model: str | None = None
    source: str = TEST_SPLIT
    settings: Mapping[str, float] = field(default_factory=dict[str, float])
    repeats: int = 1
    seed: int = 0
    baseline: UUID | None = None

    @property
    def splits(self) -> tuple[str, ...]:
        """Splits of the evaluator's bundle that hold the prompts; empty for custom prompts."""
        return tuple(self.source.split("+")) if self.source in BUNDLE_SOURCES else ()

    def as_json(self) -> dict[str, Any]:
        """Return the form that the row stores."""
        values = {name: getattr(self, name) for name in self.__dataclass_fields__}
        return {
            **values,
            "settings": dict(self.settings),
            "baseline": None if self.baseline is None else str(self.baseline),
        }

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> EvaluationRequest:
        """Rebuild from the output of `as_json`."""
        values = dict(row)
        values["baseline"] = None if row["baseline"] is None else UUID(row["baseline"])
        return cls(**values)


@dataclass(frozen=True)
class NewEvaluation:
    """An evaluation to plan.

    Args:
        prompts: digest of stored prompts (`store_prompts`); None = those of the evaluator's bundle, not resolved
            yet.
        due: due time of its schedule.
        reason: why it was created.
        idempotency_key: makes repeated requests create one evaluation.
        body_sha256: digest of the request; goes with `idempotency_key`.
        id: id to use.
    """

    tenant: str
    request: EvaluationRequest
    prompts: str | None = None
    name: str | None = None
    comment: str | None = None
    schedule: UUID | None = None
    due: datetime | None = None
    reason: str = "asked for"
    idempotency_key: str | None = None
    body_sha256: str | None = None
    id: UUID = field(default_factory=new_id)


@dataclass(frozen=True)
class EvaluationJob:
    """A job of an evaluation, with its progress."""

    id: UUID
    state: JobState
    total: int
    succeeded: int
    ended: int
    """Items that succeeded, failed, died or were cancelled."""
    started: datetime | None
    finished: datetime | None


@dataclass(frozen=True)
class ReportFile:
    """One format of a report."""

    format: str
    sha256: str
    size: int
    media_type: str


@dataclass(frozen=True)
class EvaluationEvent:
    """A change of state with its reason."""

    state: EvaluationState
    reason: str
    at: datetime


@dataclass(frozen=True)
class EvaluationRow:
    """An evaluation."""

    id: UUID
    tenant: str
    schedule: UUID | None
    due: datetime | None
    name: str | None
    comment: str | None
    request: EvaluationRequest
    prompts: str | None
    """Digest of its prompts."""
    prompt_count: int | None
    state: EvaluationState
    reason: str
    generation: EvaluationJob | None
    scoring: EvaluationJob | None
    summary: Summary | None
    regressed: bool | None
    reports: tuple[ReportFile, ...]
    created: datetime
    started: datetime | None
    finished: datetime | None

    @property
    def label(self) -> str:
        """Name, or the end of the id: for people."""
        return self.name or str(self.id)[-8:]


# --- scoring ---


@dataclass(frozen=True)
class MadeItem:
    """Result of one item of an evaluation's generation."""

    index: int
    variant: int
    prompt: str
    expected: str | None
    seconds: float | None
    seed: int
    state: ItemState
    problem: FailureReason | None
    frames: int | None
    fps: float | None
    elapsed: float | None
    """Seconds of computation."""
    licence: str | None
    """Licence of the generating weights."""
    npz: AssetDigest | None
    """The motion; None if there is none."""
    constrained: bool = False
    """Constraints were asked for."""


@dataclass(frozen=True)
class EarlierRun:
    """A comparable evaluation: done, of the same prompts, by the same evaluator."""

    id: UUID
    name: str | None
    request: EvaluationRequest
    summary: Summary
    finished: datetime
    report: AssetDigest | None
    """Its report as JSON."""


@dataclass(frozen=True)
class ScoreRows:
    """All stored data of an evaluation to score."""

    evaluation: EvaluationRow
    items: tuple[MadeItem, ...]
    """In input order, variants within prompt."""
    history: tuple[EarlierRun, ...]
    """Last runs of the same model, oldest first."""
    baseline: EarlierRun | None


@dataclass(frozen=True)
class NewScore:
    """The result of a score item; its files lie in the asset store and were announced by `begin_assets`."""

    item: UUID
    files: Mapping[str, AssetDigest]
    """Reports by format."""
    summary: Summary
    regressed: bool | None
    reason: str


# --- schedules ---


@dataclass(frozen=True)
class NewSchedule:
    """A schedule to create; `cron` has five fields, in the time of `time_zone`."""

    tenant: str
    cron: str
    time_zone: str
    request: EvaluationRequest
    prompts: str | None = None
    name: str | None = None


@dataclass(frozen=True)
class ScheduleRow:
    """A schedule."""

    id: UUID
    tenant: str
    name: str | None
    cron: str
    time_zone: str
    request: EvaluationRequest
    prompts: str | None
    prompt_count: int | None
    paused: bool
    next: datetime | None
    """Next due time; None while paused."""
    last: UUID | None
    """Its newest evaluation."""
    last_state: EvaluationState | None
    last_regressed: bool | None
    created: datetime


@dataclass(frozen=True)
class ScheduleChange:
    """Changes to a schedule; None = unchanged.

    Args:
        request: with the digest of its prompts, None for those of the evaluator's bundle.
    """

    name: str | None = None
    cron: str | None = None
    time_zone: str | None = None
    paused: bool | None = None
    request: tuple[EvaluationRequest, str | None] | None = None
