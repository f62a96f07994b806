"""Data types of tenants, keys, quotas and the audit log."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from uuid import UUID

DEFAULT_TENANT = "default"


@dataclass(frozen=True)
class Quotas:
    """Quotas of a tenant; None = unlimited."""

    queued: int | None = None
    """Items that are not done yet: waiting or being made."""
    running: int | None = None
    """Items being made."""
    bytes: int | None = None
    """Of its files in the asset store, with those that are expected of its queued items."""
    streams: int | None = None
    """Open live streams of one key; None = `MAREY_STREAMS_PER_KEY`."""


@dataclass(frozen=True)
class Usage:
    """Current use of a tenant's quotas."""

    queued: int
    running: int
    bytes: int
    """Stored."""
    expected: int
    """Bytes that its queued items will likely leave."""
    streams: int
    """Open ones, of all its keys."""


@dataclass(frozen=True)
class QuotaHeadroom:
    """Demand of a request on a quota, in items or bytes."""

    quota: str
    """`queued` or `bytes`."""
    limit: int
    stands: int
    """Queued, or stored."""
    expected: int
    """Bytes that the queued items will likely leave."""
    asked: int

    @property
    def used(self) -> int:
        """Stored and expected amount."""
        return self.stands + self.expected

    @property
    def left(self) -> int:
        """Remaining amount before the request."""
        return max(self.limit - self.used, 0)


@dataclass(frozen=True)
class TenantRow:
    """A tenant."""

    id: str
    created: datetime
    suspended: datetime | None
    quotas: Quotas


@dataclass(frozen=True)
class ApiKey:
    """An API key without its secret."""

    id: UUID
    tenant: str
    name: str
    prefix: str
    scopes: tuple[str, ...]
    created: datetime
    last_used: datetime | None
    """Within a minute."""
    expires: datetime | None
    revoked: datetime | None
    replaced_by: UUID | None
    """The key it was rotated to."""
    rates: Mapping[str, str]
    """Rate limits of its own, by class of request: {"submit": "60/minute"}."""


@dataclass(frozen=True)
class NewApiKey:
    """A new key; `secret` is shown once and stored nowhere."""

    key: ApiKey
    secret: str


@dataclass(frozen=True)
class Actor:
    """The originator of an action."""

    name: str
    """Of the API key, or of the person at the command line."""
    key: UUID | None = None


@dataclass(frozen=True)
class AuditRow:
    """A recorded action."""

    id: UUID
    at: datetime
    tenant: str
    key: UUID | None
    actor: str
    verb: str
    """Noun and verb: "job.cancel"."""
    target: str
    """What it was done to: the identifier of a job, a key, a tenant."""
    data: Mapping[str, object]
