"""States of items and jobs, and the table of allowed transitions.

The trigger `item_transition` has the same table (a test compares every pair), and a generated column computes a
job's state from its counters with the rule of `job_state`.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Protocol


class ItemState(StrEnum):
    """State of an item. `SUCCEEDED` is final; a re-roll is a new item."""

    READY = "ready"
    LEASED = "leased"
    SUCCEEDED = "succeeded"
    FAILED = "failed"
    """The handler reported that the item cannot work, however often it is retried."""
    DEAD = "dead"
    """The item used up its attempts (retryable errors, or leases lost while it ran alone)."""
    CANCELLED = "cancelled"


class ItemStage(StrEnum):
    """Next processing stage of an item."""

    TEXT = "text"
    GENERATE = "generate"


class JobKind(StrEnum):
    """Work of a job's items."""

    GENERATE = "generate"
    """Motions from prompts, or the score of an evaluation."""
    EDIT = "edit"
    """Motions from stored motions."""


class JobControl(StrEnum):
    """The operator's intent for a job."""

    RUN = "run"
    PAUSED = "paused"
    CANCELLED = "cancelled"


class JobState(StrEnum):
    """State of a job, derived from its control and counters."""

    QUEUED = "queued"
    RUNNING = "running"
    PAUSED = "paused"
    SUCCEEDED = "succeeded"
    PARTIAL = "partial"
    FAILED = "failed"
    CANCELLED = "cancelled"


class Cause(StrEnum):
    """Cause of an item's change of state; stored in its event."""

    CLAIMED = "claimed"
    COMMITTED = "committed"
    TEXT_READY = "text_ready"
    RELEASED = "released"
    LEASE_LOST = "lease_lost"
    ERROR = "error"
    ATTEMPTS_USED_UP = "attempts_used_up"
    OPERATOR = "operator"
    FAIL_EARLY = "fail_early"


TRANSITIONS: dict[tuple[ItemState, ItemState], frozenset[Cause]] = {
    (ItemState.READY, ItemState.LEASED): frozenset({Cause.CLAIMED}),
    (ItemState.LEASED, ItemState.SUCCEEDED): frozenset({Cause.COMMITTED}),
    (ItemState.LEASED, ItemState.READY): frozenset(
        {Cause.TEXT_READY, Cause.RELEASED, Cause.LEASE_LOST, Cause.ERROR}  # ERROR: retryable, after `run_after`
    ),
    (ItemState.LEASED, ItemState.FAILED): frozenset({Cause.ERROR}),
    (ItemState.LEASED, ItemState.DEAD): frozenset({Cause.ATTEMPTS_USED_UP}),
    (ItemState.READY, ItemState.CANCELLED): frozenset({Cause.OPERATOR, Cause.FAIL_EARLY}),
    (ItemState.LEASED, ItemState.CANCELLED): frozenset({Cause.OPERATOR, Cause.FAIL_EARLY}),
    (ItemState.FAILED, ItemState.READY): frozenset({Cause.OPERATOR}),
    (ItemState.DEAD, ItemState.READY): frozenset({Cause.OPERATOR}),
    (ItemState.CANCELLED, ItemState.READY): frozenset({Cause.OPERATOR}),
}
"""Allowed transitions and their causes."""

OPEN = frozenset({ItemState.READY, ItemState.LEASED})
"""States of open items."""

RETRYABLE = frozenset({ItemState.FAILED, ItemState.DEAD, ItemState.CANCELLED})
"""States from which an operator may retry."""

ENDED = frozenset({JobState.SUCCEEDED, JobState.PARTIAL, JobState.FAILED, JobState.CANCELLED})
"""States of ended jobs."""


def allowed(before: ItemState, after: ItemState) -> bool:
    """Return True if an item may go from `before` to `after`."""
    return (before, after) in TRANSITIONS


class Review(StrEnum):
    """Verdict of a reviewer on a motion; any may follow any."""

    KEPT = "kept"
    REJECTED = "rejected"
    REROLLED = "rerolled"
    """A re-roll was requested."""


class Counters(Protocol):
    """Number of a job's items by state; the states add up to `total`."""

    @property
    def total(self) -> int: ...
    @property
    def ready(self) -> int: ...
    @property
    def leased(self) -> int: ...
    @property
    def succeeded(self) -> int: ...
    @property
    def failed(self) -> int: ...
    @property
    def dead(self) -> int: ...
    @property
    def cancelled(self) -> int: ...


def job_state(control: JobControl, counters: Counters, *, started: bool) -> JobState:
    """Return the state of a job, from its control and counters.

    Open items left: paused if the operator says so, running once any item was ever leased, else queued. None left:
    succeeded if all did; cancelled if the operator cancelled it before that; partial if some succeeded; else failed.
    """
    if counters.ready + counters.leased > 0:
        if control is JobControl.PAUSED:
            return JobState.PAUSED
        return JobState.RUNNING if started else JobState.QUEUED
    if counters.total == 0:
        return JobState.QUEUED  # only inside the transaction that submits it
    if counters.succeeded == counters.total:
        return JobState.SUCCEEDED
    if control is JobControl.CANCELLED:
        return JobState.CANCELLED
    return JobState.PARTIAL if counters.succeeded > 0 else JobState.FAILED
