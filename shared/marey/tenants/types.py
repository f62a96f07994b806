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
    """Open items: queued or running."""
    running: int | None = None
    """Running items."""
    bytes: int | None = None
    """Bytes of its files in the asset store, including the expected files of queued items."""
    streams: int | None = None
    """Open live streams of one key; None = `MAREY_STREAMS_PER_KEY`."""


@dataclass(frozen=True)
class Usage:
    """Current use of a tenant's quotas."""

    queued: int
    running: int
    bytes: int
    """Stored bytes."""
    expected: int
    """Expected bytes of queued items."""
    streams: int
    """Open streams of all its keys."""


@dataclass(frozen=True)
class QuotaHeadroom:
    """Demand of a request on a quota, in items or bytes."""

    quota: str
    """`queued` or `bytes`."""
    limit: int
    stands: int
    """Queued items, or stored bytes."""
    expected: int
    """Expected bytes of queued items."""
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
    """Precise to a minute."""
    expires: datetime | None
    revoked: datetime | None
    replaced_by: UUID | None
    """The key that replaced it."""
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
    """Name of the API key, or of the user at the command line."""
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
    """Identifier of the changed object: a job, a key, a tenant."""
    data: Mapping[str, object]
