"""Notes in the audit log of what a request did, in the transaction in which it does it."""

from __future__ import annotations

import sqlalchemy as sa

from marey import tenants


def note(conn: sa.Connection, key: tenants.ApiKey, verb: str, target: object, **data: object) -> None:
    """Note that this key did something; see `marey.tenants.audit`."""
    tenants.audit(conn, key.tenant, tenants.Actor(key.name, key.id), verb, target, **data)
