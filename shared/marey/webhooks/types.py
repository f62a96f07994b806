"""Data types of webhook repositories: frozen dataclasses without SQL."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from uuid import UUID


class EventKind(StrEnum):
    """Kinds of webhook events."""

    JOB_ENDED = "job.ended"
    """A job has no open items any more; again after each retry."""
    JOB_PAUSED = "job.paused"
    STREAM_ENDED = "stream.ended"
    """A live stream has ended, or failed."""
    EVALUATION_ENDED = "evaluation.ended"
    """An evaluation is done, failed or cancelled."""
    EVALUATION_REGRESSED = "evaluation.regressed"
    """An evaluation is done, and worse than its baseline."""


TEST_KIND = "webhook.test"
"""Kind of the test event that a user requests; no webhook subscribes to it."""


class DeliveryState(StrEnum):
    """State of a delivery. Ended ones may be replayed."""

    PENDING = "pending"
    DELIVERED = "delivered"
    """The receiver answered 2xx."""
    FAILED = "failed"
    """All attempts are used up."""


@dataclass(frozen=True)
class NewWebhook:
    """A webhook to write; `secret` is already encrypted."""

    tenant: str
    url: str
    events: Sequence[EventKind]
    secret: bytes
    name: str | None = None


@dataclass(frozen=True)
class WebhookChange:
    """Changes to a webhook; None = as it was."""

    url: str | None = None
    events: Sequence[EventKind] | None = None
    name: str | None = None
    paused: bool | None = None


@dataclass(frozen=True)
class WebhookRow:
    """A webhook."""

    id: UUID
    tenant: str
    name: str | None
    url: str
    events: tuple[EventKind, ...]
    paused: bool
    pending: int
    """Pending deliveries."""
    failed: int
    """Deliveries without attempts left."""
    created: datetime


@dataclass(frozen=True)
class DeliveryRow:
    """The delivery of an event to a webhook."""

    webhook: UUID
    event: UUID
    kind: str
    data: Mapping[str, object]
    state: DeliveryState
    attempts: int
    next: datetime | None
    """Time of the next attempt; None once it has ended."""
    created: datetime
    ended: datetime | None
    status: int | None
    """Status of the last attempt; None = no answer, or not attempted yet."""
    error: str | None
    """Error of the last attempt."""


@dataclass(frozen=True)
class AttemptRow:
    """One attempt of a delivery."""

    number: int
    at: datetime
    status: int | None
    seconds: float
    error: str | None


@dataclass(frozen=True)
class DueDelivery:
    """A claimed delivery, valid until its claim expires."""

    claim: UUID
    webhook: UUID
    event: UUID
    kind: str
    at: datetime
    data: Mapping[str, object]
    url: str
    secrets: Sequence[bytes]
    """Encrypted: the newest first, then the previous one while both are used."""
    tries: int


@dataclass(frozen=True)
class Attempt:
    """Result of an attempt."""

    status: int | None
    seconds: float
    error: str | None
    """None = delivered."""
    wait: float = 0.0
    """Seconds that the receiver asked for before the next attempt."""
