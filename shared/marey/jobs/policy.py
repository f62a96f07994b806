"""Time limits of the queue; all are compared by the database's clock."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from marey.core.settings import settings


@dataclass(frozen=True)
class Policy:
    """Time limits, in seconds."""

    lease: float = 10.0
    stall: float = 120.0
    """A lease without progress for this long is not renewed."""
    max_attempts: int = 3
    patience: float = 30.0
    """Seconds for which a worker keeps its loaded bundle before it takes the next lane in order."""
    tenant_patience: float = 5.0
    """The same if that lane is of a tenant with less running: loading a bundle does not justify a longer wait."""
    backoff: float = 5.0
    """Delay after the first retryable error; doubles each attempt, up to `backoff_limit`."""
    backoff_limit: float = 300.0
    worker_live: float = 10.0
    """Seconds after its last heartbeat for which a worker counts as live."""
    worker_kept: float = 86_400.0
    idempotency: float = 86_400.0
    asset_grace: float = 3_600.0
    """Seconds after the end of their lease when assets still `writing` are stale."""
    audit_kept: float = 400 * 86_400.0


@lru_cache(maxsize=1)
def policy() -> Policy:
    """Return the policy of this process, from its settings."""
    chosen = settings()
    return Policy(
        lease=chosen.lease_seconds,
        stall=chosen.stall_seconds,
        max_attempts=chosen.max_attempts,
        worker_live=max(4 * chosen.heartbeat_seconds, chosen.lease_seconds),
        audit_kept=chosen.audit_days * 86_400.0,
    )
