"""API keys: the database holds a prefix to find them by and a SHA-256 of the secret."""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Collection
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from shared.errors import InvalidInput, NotFound, Unauthenticated
from shared.jobs import schema
from shared.jobs.ids import new_id
from shared.jobs.journal import CLOCK, interval
from shared.jobs.types import DEFAULT_TENANT, ApiKey, NewApiKey

SCOPES = frozenset({"read", "submit", "operate", "admin"})
FORM = re.compile(r"marey_([0-9a-f]{8})_([A-Za-z0-9_-]{43})")
NOTE_USE_EVERY = 60.0  # seconds; a write per request would be a hot row


def create_key(conn: sa.Connection, name: str, scopes: Collection[str], *, tenant: str = DEFAULT_TENANT) -> NewApiKey:
    """Make a key `marey_<prefix>_<secret>`.

    A plain SHA-256 is enough for it: the secret has 256 random bits, nothing to guess from a list.

    Raises:
        InvalidInput: an unknown scope, or none.
        NotFound: no such tenant.
    """
    unknown = set(scopes) - SCOPES
    if unknown or not scopes:
        what = f"unknown scopes: {', '.join(sorted(unknown))}" if unknown else "a key needs a scope"
        raise InvalidInput(what, where="scopes", hint=f"There are {', '.join(sorted(SCOPES))}.")
    known = conn.execute(sa.select(schema.tenant.c.id).where(schema.tenant.c.id == tenant)).one_or_none()
    if known is None:
        raise NotFound("there is no such tenant", where=f"tenant {tenant}")
    prefix, secret = secrets.token_hex(4), secrets.token_urlsafe(32)
    values = {
        "id": new_id(),
        "tenant_id": tenant,
        "name": name,
        "prefix": prefix,
        "secret_sha256": _digest(secret),
        "scopes": sorted(scopes),
    }
    conn.execute(sa.insert(schema.api_key).values(values))
    row = conn.execute(_keys().where(schema.api_key.c.id == values["id"])).mappings().one()
    return NewApiKey(_key(row), f"marey_{prefix}_{secret}")


def authenticate(conn: sa.Connection, secret: str) -> ApiKey:
    """The key this secret belongs to; compared in constant time.

    Raises:
        Unauthenticated: malformed, unknown or revoked.
    """
    form = FORM.fullmatch(secret)
    if form is None:
        raise Unauthenticated("this is no API key", hint="Keys look like marey_<8>_<43>.")
    table = schema.api_key.c
    stored = conn.execute(
        sa.select(table.id, table.secret_sha256).where(table.prefix == form[1], table.revoked_at.is_(None))
    ).one_or_none()
    if stored is None or not hmac.compare_digest(stored.secret_sha256, _digest(form[2])):
        raise Unauthenticated(
            "this API key is unknown or revoked",
            where=f"marey_{form[1]}_…",
            hint="Make one: `marey admin keys create`.",
        )
    unused = table.last_used_at.is_(None) | (table.last_used_at < CLOCK - interval(NOTE_USE_EVERY))
    conn.execute(sa.update(schema.api_key).where(table.id == stored.id, unused).values(last_used_at=CLOCK))
    return _key(conn.execute(_keys().where(table.id == stored.id)).mappings().one())


def list_keys(conn: sa.Connection, tenant: str) -> list[ApiKey]:
    """Keys of a tenant, newest first, revoked ones too."""
    table = schema.api_key.c
    rows = conn.execute(_keys().where(table.tenant_id == tenant).order_by(table.id.desc()))
    return [_key(row) for row in rows.mappings()]


def revoke_key(conn: sa.Connection, tenant: str, key: UUID) -> ApiKey:
    """Make a key invalid from now on. Revoked already: no change.

    Raises:
        NotFound: the tenant has no such key.
    """
    table = schema.api_key.c
    ours = (table.tenant_id == tenant) & (table.id == key)
    conn.execute(sa.update(schema.api_key).where(ours, table.revoked_at.is_(None)).values(revoked_at=CLOCK))
    row = conn.execute(_keys().where(ours)).mappings().one_or_none()
    if row is None:
        raise NotFound("there is no such key", where=f"key {key}", hint="`marey admin keys list` shows them.")
    return _key(row)


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.encode()).digest()


def _keys() -> sa.Select[*tuple[Any, ...]]:
    table = schema.api_key.c
    return sa.select(
        *(table.id, table.tenant_id.label("tenant"), table.name, table.prefix, table.scopes),
        table.created_at.label("created"),
        table.last_used_at.label("last_used"),
        table.revoked_at.label("revoked"),
    )


def _key(row: sa.RowMapping) -> ApiKey:
    values: dict[str, Any] = dict(row)
    values["scopes"] = tuple(row["scopes"])
    return ApiKey(**values)
