"""Bodies and answers of the webhook routes."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any
from uuid import UUID

from pydantic import BaseModel, ConfigDict, Field

from marey.http.schemas import FreeText, Name, View
from marey.webhooks import AttemptRow, DeliveryRow, DeliveryState, EventKind, WebhookRow
from marey.webhooks.addresses import MAX_URL

URL = "Where messages are sent: https, at an address that MAREY_WEBHOOK_ALLOW permits."
PAUSED = "Its messages wait while it is paused."
Url = Annotated[str, Field(min_length=1, max_length=MAX_URL), FreeText()]


class NewWebhookBody(BaseModel):
    """A webhook to create."""

    model_config = ConfigDict(extra="forbid")

    url: Url = Field(description=URL)
    events: list[EventKind] = Field(
        default_factory=lambda: list(EventKind), min_length=1, description="Subscribed events; default: all."
    )
    name: Name | None = None


class WebhookPatch(BaseModel):
    """Changes to a webhook; omitted fields stay as they are."""

    model_config = ConfigDict(extra="forbid")

    url: Url | None = Field(None, description=URL)
    events: list[EventKind] | None = Field(None, min_length=1)
    name: Name | None = None
    paused: bool | None = Field(None, description=PAUSED)


class WebhookView(View):
    """A webhook."""

    id: UUID
    name: str | None
    url: str
    events: list[EventKind]
    paused: bool = Field(description=PAUSED)
    pending: int = Field(description="Deliveries that wait for their next attempt.")
    failed: int = Field(description="Deliveries of the last 30 days without attempts left.")
    created: datetime

    @classmethod
    def of(cls, row: WebhookRow) -> WebhookView:
        """Convert a row."""
        return cls(**_fields(row, WebhookView))


class MadeWebhookView(WebhookView):
    """A new webhook, with its signing secret: it is shown only now."""

    secret: str = Field(description="`whsec_…`, for the library of Standard Webhooks on the receiver's side.")

    @classmethod
    def made(cls, row: WebhookRow, secret: str) -> MadeWebhookView:
        """Convert a row and its secret."""
        return cls(secret=secret, **_fields(row, WebhookView))


class DeliveryView(View):
    """The delivery of a message to a webhook."""

    webhook: UUID
    event: UUID = Field(description="The message's id, which the receiver finds in `webhook-id`.")
    kind: str = Field(description="Of the event, as `job.ended`.")
    data: dict[str, Any] = Field(description="Of the event: ids, states, counters.")
    state: DeliveryState
    attempts: int
    next: datetime | None = Field(description="Time of the next attempt; null once it has ended.")
    created: datetime
    ended: datetime | None
    status: int | None = Field(description="Status of the last attempt; null = no answer.")
    error: str | None = Field(description="Error of the last attempt; null = none.")

    @classmethod
    def of(cls, row: DeliveryRow) -> DeliveryView:
        """Convert a row."""
        return cls(**_fields(row, DeliveryView))


class AttemptView(View):
    """One attempt."""

    number: int
    at: datetime
    status: int | None
    seconds: float
    error: str | None = Field(description="Null = delivered.")

    @classmethod
    def of(cls, row: AttemptRow) -> AttemptView:
        """Convert a row."""
        return cls(**_fields(row, AttemptView))


class DeliveryDetailView(DeliveryView):
    """A delivery with its attempts."""

    log: list[AttemptView]

    @classmethod
    def detail(cls, row: DeliveryRow, log: list[AttemptRow]) -> DeliveryDetailView:
        """Convert rows."""
        return cls(log=[AttemptView.of(each) for each in log], **_fields(row, DeliveryView))


def _fields(row: object, view: type[View]) -> dict[str, Any]:
    return {name: getattr(row, name) for name in view.model_fields}
