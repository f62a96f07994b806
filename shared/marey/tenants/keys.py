"""API keys: the database holds a prefix to find them by and a SHA-256 of the secret."""

from __future__ import annotations

import hashlib
import hmac
import re
import secrets
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.core.characters import check_text
from marey.core.errors import Conflict, InvalidInput, NotFound, Refused, Unauthenticated
from marey.core.rates import check_rates
from marey.db.ids import new_id
from marey.db.sql import CLOCK, interval, need_row
from marey.tenants import tables
from marey.tenants.repository import get_tenant
from marey.tenants.types import DEFAULT_TENANT, ApiKey, NewApiKey

SCOPES = frozenset({"read", "submit", "operate", "admin", "metrics"})
"""`admin` includes the first three scopes; none includes `metrics`, which covers all tenants."""
FORM = re.compile(r"marey_([0-9a-f]{8})_([A-Za-z0-9_-]{43})")
NOTE_USE_EVERY = 60.0  # seconds; a write per request would be a hot row
UNUSED = tables.api_key.c.last_used_at.is_(None) | (tables.api_key.c.last_used_at < CLOCK - interval(NOTE_USE_EVERY))
NEW = "Make one: `marey admin keys create`."
LONGEST_LIFE = 100 * 365 * 86_400.0
OVERLAP = 86_400.0
"""Seconds that a rotated key stays valid: a day to distribute the new one."""


def create_key(
    conn: sa.Connection,
    name: str,
    scopes: Collection[str],
    *,
    tenant: str = DEFAULT_TENANT,
    lifetime: float | None = None,
    rates: Mapping[str, str] | None = None,
) -> NewApiKey:
    """Create a key `marey_<prefix>_<secret>`.

    A plain SHA-256 is sufficient: the secret has 256 random bits and cannot be guessed.

    Args:
        lifetime: seconds until it expires; None = never.
        rates: the key's own rate limits, by class of request (`marey.core.rates`), which override those of the
            server.

    Raises:
        InvalidInput: control characters in the name; an unknown scope, or none; an invalid lifetime or rate.
        NotFound: no such tenant.
    """
    check_text(name, where="name")
    return _make_key(conn, name, scopes, tenant=tenant, lifetime=lifetime, rates=rates)


def _make_key(
    conn: sa.Connection,
    name: str,
    scopes: Collection[str],
    *,
    tenant: str,
    lifetime: float | None,
    rates: Mapping[str, str] | None,
) -> NewApiKey:
    """Create a key as `create_key` does; the name is taken as stored."""
    unknown = set(scopes) - SCOPES
    if unknown or not scopes:
        what = f"unknown scopes: {', '.join(sorted(unknown))}" if unknown else "a key needs a scope"
        raise InvalidInput(what, where="scopes", hint=f"There are {', '.join(sorted(SCOPES))}.")
    if lifetime is not None and not 0 < lifetime <= LONGEST_LIFE:
        raise InvalidInput(f"{lifetime:g} seconds are not a lifetime", where="lifetime", hint="Up to 100 years.")
    checked = check_rates(rates or {}, where="rates")
    get_tenant(conn, tenant)
    prefix, secret = secrets.token_hex(4), secrets.token_urlsafe(32)
    identifier = new_id()
    conn.execute(
        sa.insert(tables.api_key).values(
            id=identifier,
            tenant_id=tenant,
            name=name,
            prefix=prefix,
            secret_sha256=_digest(secret),
            scopes=sorted(scopes),
            expires_at=None if lifetime is None else CLOCK + interval(lifetime),
            rates=checked,
        )
    )
    return NewApiKey(_one(conn, tables.api_key.c.id == identifier), f"marey_{prefix}_{secret}")


def authenticate(conn: sa.Connection, secret: str) -> ApiKey:
    """Return the key of a secret; compared in constant time. Its use is recorded, at most once a minute.

    Raises:
        Unauthenticated: malformed, unknown, revoked or expired.
        Refused: its tenant is suspended.
    """
    form = FORM.fullmatch(secret)
    if form is None:
        raise Unauthenticated("this is not an API key", hint="Keys look like marey_<8>_<43>.")
    table = tables.api_key.c
    row = conn.execute(_standing().where(table.prefix == form[1])).mappings().one_or_none()
    if row is None or not hmac.compare_digest(row["secret_sha256"], _digest(form[2])):
        raise _unknown(form[1])
    key = _valid(row)
    if not row["unused"]:
        return key
    note = sa.update(tables.api_key).where(table.id == key.id, UNUSED).values(last_used_at=CLOCK)
    used = conn.execute(note.returning(table.last_used_at)).scalar_one_or_none()  # or a concurrent request
    return key if used is None else replace(key, last_used=used)


def check_key(conn: sa.Connection, key: UUID) -> None:
    """Validate a key that was accepted earlier, for connections that stay open for minutes.

    Raises:
        Unauthenticated, Refused: as `authenticate`.
    """
    query = _standing().where(tables.api_key.c.id == key)
    _valid(need_row(conn, query, Unauthenticated("this API key no longer exists")))


def keys_still_valid(conn: sa.Connection, keys: Collection[UUID]) -> set[UUID]:
    """Return those of the given keys that `check_key` accepts, in one query."""
    rows = conn.execute(_standing().where(tables.api_key.c.id.in_(keys))).mappings()
    return {row["id"] for row in rows if row["revoked"] is None and not row["expired"] and not row["suspended"]}


def list_keys(conn: sa.Connection, tenant: str) -> list[ApiKey]:
    """Return the keys of a tenant, newest first, with revoked ones."""
    table = tables.api_key.c
    rows = conn.execute(_keys().where(table.tenant_id == tenant).order_by(table.created_at.desc(), table.id.desc()))
    return [_key(row) for row in rows.mappings()]


def keys_named(conn: sa.Connection, tenant: str, name: str) -> list[ApiKey]:
    """Return valid keys of a tenant with this name, newest first: neither revoked nor expired."""
    table = tables.api_key.c
    valid = table.revoked_at.is_(None) & (table.expires_at.is_(None) | (table.expires_at > CLOCK))
    found = _keys().where(table.tenant_id == tenant, table.name == name, valid)
    return [_key(row) for row in conn.execute(found.order_by(table.id.desc())).mappings()]


def rotate_key(conn: sa.Connection, tenant: str, key: UUID, *, overlap: float = OVERLAP) -> NewApiKey:
    """Replace a key by a new one with its name, scopes, rates and lifetime; the old one works until the overlap ends.

    Args:
        overlap: seconds; 0 = the old key is invalid at once. Never longer than its own lifetime.

    Raises:
        NotFound: the tenant has no such key.
        Conflict: it is revoked, expired, or was rotated before.
        InvalidInput: an invalid overlap.
    """
    if not 0 <= overlap <= LONGEST_LIFE:
        raise InvalidInput(f"{overlap:g} seconds are not a valid duration", where="overlap")
    table = tables.api_key.c
    ours = (table.tenant_id == tenant) & (table.id == key)
    state = sa.select((table.expires_at <= CLOCK).label("expired")).where(ours).with_for_update()
    expired = conn.execute(state).one_or_none()
    if expired is None:
        raise _no_such_key(key)
    old = _one(conn, ours)
    for wrong, what in (
        (old.revoked is not None, "is revoked"),
        (expired.expired, "has expired"),
        (old.replaced_by is not None, f"was rotated to {old.replaced_by}"),
    ):
        if wrong:
            raise Conflict(f"this key {what}", where=f"key {key}", hint=NEW)
    lifetime = None if old.expires is None else (old.expires - old.created).total_seconds()
    new = _make_key(conn, old.name, old.scopes, tenant=tenant, lifetime=lifetime, rates=old.rates)
    ends = sa.func.least(table.expires_at, CLOCK + interval(overlap))  # least() ignores null
    conn.execute(sa.update(tables.api_key).where(ours).values(expires_at=ends, replaced_by=new.key.id))
    return new


def revoke_key(conn: sa.Connection, tenant: str, key: UUID) -> ApiKey:
    """Revoke a key from now on. Revoked already: no change.

    Raises:
        NotFound: the tenant has no such key.
    """
    table = tables.api_key.c
    ours = (table.tenant_id == tenant) & (table.id == key)
    conn.execute(sa.update(tables.api_key).where(ours, table.revoked_at.is_(None)).values(revoked_at=CLOCK))
    return _key(need_row(conn, _keys().where(ours), _no_such_key(key)))


def _valid(row: sa.RowMapping) -> ApiKey:
    key = _key(row)
    if key.revoked is not None:
        raise _unknown(key.prefix)
    if row["expired"]:
        raise Unauthenticated(
            f"this API key expired on {key.expires:%Y-%m-%d %H:%M} UTC", where=_shown(key.prefix), hint=NEW
        )
    if row["suspended"]:
        raise Refused(f"the tenant {key.tenant!r} is suspended", hint="Ask the operator of this server.")
    return key


def _unknown(prefix: str) -> Unauthenticated:
    return Unauthenticated("this API key is unknown or revoked", where=_shown(prefix), hint=NEW)


def _shown(prefix: str) -> str:
    """Return the public part of a key."""
    return f"marey_{prefix}_…"


def _no_such_key(key: UUID) -> NotFound:
    return NotFound("there is no such key", where=f"key {key}", hint="`marey admin keys list` shows them.")


def _digest(secret: str) -> bytes:
    return hashlib.sha256(secret.encode()).digest()


FIELDS = {
    "id": "id",
    "tenant_id": "tenant",
    "name": "name",
    "prefix": "prefix",
    "scopes": "scopes",
    "created_at": "created",
    "last_used_at": "last_used",
    "expires_at": "expires",
    "revoked_at": "revoked",
    "replaced_by": "replaced_by",
    "rates": "rates",
}
"""Columns by field of `ApiKey`."""


def _keys() -> sa.Select[*tuple[Any, ...]]:
    table = tables.api_key.c
    return sa.select(*(table[column].label(name) for column, name in FIELDS.items()))


def _standing() -> sa.Select[*tuple[Any, ...]]:
    """Select keys with everything that decides whether they are valid."""
    table, tenant = tables.api_key.c, tables.tenant.c
    return (
        _keys()
        .add_columns(
            table.secret_sha256,
            UNUSED.label("unused"),
            (table.expires_at <= CLOCK).label("expired"),
            tenant.suspended_at.is_not(None).label("suspended"),
        )
        .join(tables.tenant, tenant.id == table.tenant_id)
    )


def _one(conn: sa.Connection, which: sa.ColumnElement[bool]) -> ApiKey:
    return _key(conn.execute(_keys().where(which)).mappings().one())


def _key(row: sa.RowMapping) -> ApiKey:
    values: dict[str, Any] = {name: row[name] for name in FIELDS.values()}
    values["scopes"] = tuple(row["scopes"])
    return ApiKey(**values)
