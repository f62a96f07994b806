"""Audit log entries of requests, written in the request's transaction."""

from __future__ import annotations

import sqlalchemy as sa

from marey import tenants


def note(conn: sa.Connection, key: tenants.ApiKey, verb: str, target: object, **data: object) -> None:
    """Record an action of this key; see `marey.tenants.audit`."""
    tenants.audit(conn, key.tenant, tenants.Actor(key.name, key.id), verb, target, **data)
