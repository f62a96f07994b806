"""Deadlines of calls to Postgres, by kind of call.

Each kind has two limits. The server ends a statement that runs for longer than `statement`; such a statement fails with
a clean error and its connection stays usable. The client waits a little longer, `answer` seconds without a byte from
the server, and then treats the connection as silent: it closes it, and every other connection of the process that is
silent too (`marey.db.connections`). Waiting for a lock counts as running.

`transaction(engine, KIND)` chooses the kind. A process with long calls has short ones too (the heartbeat of a
worker, the LISTEN connections of API and scheduler), and detects a silent server within seconds by those.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Deadline:
    """Limits of the calls of one transaction, in seconds."""

    name: str
    statement: float
    """The server cancels a statement after this long (`statement_timeout`)."""
    idle: float
    """Seconds until the server ends a session with an idle open transaction (`idle_in_transaction_session_timeout`):
    the longest time that a lost connection keeps its locks."""
    margin: float = 2.0

    @property
    def answer(self) -> float:
        """Seconds of silence after which the client gives up the connection."""
        return self.statement + self.margin


CONNECT_SECONDS = 4
"""Per address of the server, from the first packet to the end of the log-in; whole seconds, libpq's minimum is 2."""
PING_SECONDS = 3.0
"""Pre-use check of a pooled connection, and probe of a LISTEN connection: no lock, no table."""
ROLLBACK_SECONDS = 3.0
"""A rollback writes nothing and waits for no lock."""
SHORT_SECONDS = 4.0
"""Round trips with at most this limit have answers of a few bytes: the limit applies to the whole answer."""
SLOWNESS = 3
"""Other round trips may take this many times their limit while data arrives: a large answer on a slow line is no
fault, a connection that transfers a byte now and then is one."""
PROBE_EVERY = 3.0
"""Seconds without a notification after which a LISTEN connection is probed."""

HEARTBEAT = Deadline("heartbeat", statement=3.0, idle=3.0, margin=1.0)
"""Renewals of leases: several must fit into a lease of 10 s, and a lost one must not block the next."""
ORDINARY = Deadline("ordinary", statement=10.0, idle=8.0)
"""All calls without another kind: milliseconds, or the wait for the lock of a job that another transaction changes."""
SEARCH = Deadline("search", statement=30.0, idle=8.0)
"""Listings, searches, aggregates: they read many rows, and hold no locks that block others."""
BULK = Deadline("bulk", statement=60.0, idle=30.0)
"""Up to 100,000 items in one transaction: submit, cancel, retry, erase, delete, restore. A COPY is fed meanwhile."""
MAINTENANCE = Deadline("maintenance", statement=60.0, idle=60.0)
"""Garbage collection and retention: they lock an asset's row while the object store deletes it."""
BACKUP = Deadline("backup", statement=300.0, idle=120.0)
"""Export and import of a tenant: whole jobs are read in one snapshot and checked in between."""
MIGRATION = Deadline("migration", statement=3600.0, idle=600.0)
"""Indexes over all items. Waits for tables have a limit of their own (`marey.db.migrate`)."""


def in_all(limit: float) -> float:
    """Return the limit of one round trip in total, for a connection that may be silent for `limit` seconds."""
    return limit if limit <= SHORT_SECONDS else limit * SLOWNESS


KINDS = (HEARTBEAT, ORDINARY, SEARCH, BULK, MAINTENANCE, BACKUP, MIGRATION)
