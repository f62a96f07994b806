"""Results of `client.webhooks`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from typing import Any

from marey.client.results import Result

PENDING = "pending"


@dataclass(frozen=True, kw_only=True)
class Webhook(Result):
    """A webhook: a URL that gets a signed message for each event of the subscribed types."""

    id: str
    name: str | None = None
    url: str = ""
    events: tuple[str, ...] = ()
    """Subscribed event types, such as `job.ended`."""
    paused: bool = False
    """Its messages wait while it is paused."""
    pending: int = 0
    """Deliveries that wait for their next attempt."""
    failed: int = 0
    """Deliveries of the last 30 days without attempts left."""
    created: datetime | None = None


@dataclass(frozen=True, kw_only=True)
class WebhookSecret(Webhook):
    """A webhook with a new signing secret, which the server shows only once."""

    secret: str = field(default="", repr=False)
    """`whsec_…`, for the receiver's library of Standard Webhooks."""


@dataclass(frozen=True, kw_only=True)
class Delivery(Result):
    """The delivery of a message to a webhook.

    `state` is one of pending, delivered, failed.
    """

    webhook: str = ""
    event: str = ""
    """The id of the message, which the receiver finds in the header `webhook-id`."""
    kind: str = ""
    """The event type, such as `job.ended`."""
    data: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """The event: ids, states, counters."""
    state: str = ""
    attempts: int = 0
    next: datetime | None = None
    """The time of the next attempt; None once the delivery has ended."""
    created: datetime | None = None
    ended: datetime | None = None
    status: int | None = None
    """The HTTP status of the last attempt; None = no answer."""
    error: str | None = None
    """The error of the last attempt; None = none."""

    @property
    def has_ended(self) -> bool:
        """True once no attempt follows."""
        return self.state != PENDING


@dataclass(frozen=True, kw_only=True)
class DeliveryAttempt(Result):
    """One attempt of a delivery."""

    number: int = 0
    """From 1."""
    at: datetime | None = None
    status: int | None = None
    """The HTTP status; None = no answer."""
    seconds: float = 0.0
    error: str | None = None
    """None = delivered."""


@dataclass(frozen=True, kw_only=True)
class DeliveryDetail(Delivery):
    """A delivery with its attempts."""

    log: tuple[DeliveryAttempt, ...] = ()
