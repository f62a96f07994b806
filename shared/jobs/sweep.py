"""The sweeper: what time alone changes."""

from __future__ import annotations

import sqlalchemy as sa

from shared.jobs.policy import Policy
from shared.jobs.types import SweepReport


def sweep(engine: sa.Engine, *, rules: Policy | None = None) -> SweepReport:
    """Take back expired leases, make due items ready, forget old idempotency rows and workers.

    An item of a lost lease is marked `solo`: it is claimed alone next time, and only the loss of a lease it was alone in
    counts as an attempt. Safe to run in several processes at once; each job is a transaction of its own.
    """
    raise NotImplementedError
