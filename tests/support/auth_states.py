"""Every way to come with a key that does not open a route, and what is answered to it."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from typing import Any
from uuid import UUID

import sqlalchemy as sa

from marey.db import transaction
from marey.tenants import authenticate, create_key, create_tenant, revoke_key, suspend_tenant, tables
from marey.tenants.keys import SCOPES

ENDINGS = ("revoked", "expired", "suspended")
HOLDERS = {scope: {scope} if scope == "metrics" else {scope, "admin"} for scope in SCOPES}
"""By scope: those of a key of which one is enough for it."""


@dataclass(frozen=True)
class Knock:
    """A request's `Authorization`, and what must come of it on every route that wants a key."""

    state: str
    header: str | None
    status: int = 401
    kind: str = "unauthenticated"
    says: str = "key"

    @property
    def headers(self) -> dict[str, str]:
        """To send."""
        return {} if self.header is None else {"Authorization": self.header}

    def check(self, status: int, problem: dict[str, Any]) -> None:
        """Fail unless the answer says this, and nothing more than an unknown client may learn."""
        assert (status, problem["type"]) == (self.status, f"urn:marey:problem:{self.kind}"), problem
        assert problem["status"] == status
        assert self.says in problem["detail"], problem
        assert set(problem) <= {"type", "title", "status", "detail", "where", "hint"}, problem
        shown = (self.header or "").rpartition("_")[2]
        assert len(shown) < 40 or shown not in str(problem), problem


def end_key(conn: sa.Connection, ending: str, tenant: str, key: UUID) -> None:
    """Make a key invalid: one of `ENDINGS`."""
    if ending == "revoked":
        revoke_key(conn, tenant, key)
    elif ending == "suspended":
        suspend_tenant(conn, tenant)
    else:
        conn.execute(sa.update(tables.api_key).where(tables.api_key.c.id == key).values(expires_at=sa.func.now()))


def invalid_knocks(engine: sa.Engine) -> list[Knock]:
    """Without a valid key. Makes the tenant `closed`, of which no key opens anything."""
    with transaction(engine) as conn:
        create_tenant(conn, "closed")
        made = {ending: create_key(conn, ending, ["admin", "metrics"], tenant="closed").secret for ending in ENDINGS}
        good = create_key(conn, "good", ["admin"]).secret
    with transaction(engine) as conn:
        ids = {ending: authenticate(conn, secret).id for ending, secret in made.items()}
        for ending in ENDINGS:  # suspended last: then the others are still told what they are
            end_key(conn, ending, "closed", ids[ending])
    prefix, other = good.split("_", 2)[1], secrets.token_urlsafe(32)
    return [
        Knock("no key", None, says="no API key"),
        Knock("empty", "", says="no API key"),
        Knock("of another kind", "Basic bWU6bWU=", says="no API key"),
        Knock("garbage", "Bearer marey_0_0", says="not an API key"),
        Knock("unknown", f"Bearer marey_{secrets.token_hex(4)}_{other}", says="unknown or revoked"),
        Knock("a known prefix with another secret", f"Bearer marey_{prefix}_{other}", says="unknown or revoked"),
        Knock("revoked", f"Bearer {made['revoked']}", says="unknown or revoked"),
        Knock("expired", f"Bearer {made['expired']}", says="expired"),
        Knock("suspended", f"Bearer {made['suspended']}", 403, "refused", "suspended"),
    ]


def lesser_knocks(engine: sa.Engine, wanted: str) -> list[Knock]:
    """With valid keys that lack a scope: each of one other scope, which does not hold it."""
    with transaction(engine) as conn:
        made = {scope: create_key(conn, scope, [scope]).secret for scope in sorted(SCOPES - HOLDERS[wanted])}
    says = f"lacks the scope {wanted!r}"
    return [Knock(f"only {scope}", f"Bearer {secret}", 403, "refused", says) for scope, secret in made.items()]


def holders(engine: sa.Engine, wanted: str) -> list[str]:
    """Secrets of keys of one scope each that hold the wanted one."""
    with transaction(engine) as conn:
        return [create_key(conn, scope, [scope]).secret for scope in sorted(HOLDERS[wanted])]
