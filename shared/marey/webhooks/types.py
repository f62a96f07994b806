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
    """A live stream is over, or failed."""
    EVALUATION_ENDED = "evaluation.ended"
    """An evaluation is done, failed or cancelled."""
    EVALUATION_REGRESSED = "evaluation.regressed"
    """An evaluation is done, and worse than what it was compared with."""


TEST_KIND = "webhook.test"
"""Kind of the event that somebody asks for to see whether the way is open; nobody subscribes to it."""


class DeliveryState(StrEnum):
    """State of a delivery. Ended ones may be replayed."""

    PENDING = "pending"
    DELIVERED = "delivered"
    """The receiver answered 2xx."""
    FAILED = "failed"
    """Its tries are used up."""


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
    """Deliveries that wait."""
    failed: int
    """Deliveries whose tries are used up."""
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
    """When it is tried; None once it has ended."""
    created: datetime
    ended: datetime | None
    status: int | None
    """Of the last try; None = no answer, or not tried yet."""
    error: str | None
    """Of the last try."""


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
    """Encrypted: the newest first, then the one before it while both work."""
    tries: int


@dataclass(frozen=True)
class Attempt:
    """Result of an attempt."""

    status: int | None
    seconds: float
    error: str | None
    """None = delivered."""
    wait: float = 0.0
    """Seconds that the receiver asked for before the next try."""
