"""API keys: the database holds a prefix to find them by and a SHA-256 of the secret."""

from __future__ import annotations

from collections.abc import Collection
from uuid import UUID

import sqlalchemy as sa

from shared.jobs.types import DEFAULT_TENANT, ApiKey, NewApiKey

SCOPES = frozenset({"read", "submit", "operate", "admin"})


def create_key(conn: sa.Connection, name: str, scopes: Collection[str], *, tenant: str = DEFAULT_TENANT) -> NewApiKey:
    """Make a key `marey_<prefix>_<secret>`.

    Raises:
        InvalidInput: an unknown scope.
        NotFound: no such tenant.
    """
    raise NotImplementedError


def authenticate(conn: sa.Connection, secret: str) -> ApiKey:
    """The key this secret belongs to; compared in constant time.

    Raises:
        Unauthenticated: malformed, unknown or revoked.
    """
    raise NotImplementedError


def list_keys(conn: sa.Connection, tenant: str) -> list[ApiKey]:
    """Keys of a tenant, newest first, revoked ones too."""
    raise NotImplementedError


def revoke_key(conn: sa.Connection, tenant: str, key: UUID) -> ApiKey:
    """Make a key invalid from now on.

    Raises:
        NotFound: the tenant has no such key.
    """
    raise NotImplementedError
