"""API keys: `Authorization: Bearer marey_…`, each with scopes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from fastapi import Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer, SecurityScopes
from starlette.requests import HTTPConnection

from marey.api.context import Context, Shared, no_key
from marey.core.errors import Refused
from marey.db import transaction
from marey.http.queries import check_query
from marey.tenants import ApiKey, authenticate

METRICS = "metrics"
"""Scope for the queues of all tenants; no other scope includes it."""
bearer = HTTPBearer(auto_error=False, description="An API key: `marey admin keys create`.")


Credentials = Annotated[HTTPAuthorizationCredentials | None, Security(bearer)]


def authenticated(shared: Context, secret: str | None) -> ApiKey:
    """Return the key of this secret.

    Raises:
        Unauthenticated: no key, or an invalid one.
    """
    if not secret:
        raise no_key()
    with transaction(shared.engine) as conn:
        return authenticate(conn, secret)


def authorize(shared: Context, key: ApiKey, scope: str, kind: str | None = None) -> None:
    """Validate that the key has the scope, and count the request against its rate limit.

    Args:
        kind: class of the request (`marey.core.rates`), if it differs from the scope.

    Raises:
        Refused: it lacks the scope.
        Busy: its rate limit is exhausted.
    """
    check_scope(key, scope)
    shared.rates.take(key, kind or scope)


def check_scope(key: ApiKey, scope: str) -> None:
    """Validate that the key has the scope. `admin` includes all scopes of its own tenant.

    Raises:
        Refused: the key lacks it.
    """
    if scope not in key.scopes and ("admin" not in key.scopes or scope == METRICS):
        raise Refused(f"the key {key.name!r} lacks the scope {scope!r}", hint="Use a key that has it.")


def requires(kind: str | None = None) -> Callable[[HTTPConnection, Context, Credentials, SecurityScopes], ApiKey]:
    """Return a dependency: the caller's key, authorized for the scopes that the route's `Security` names.

    The OpenAPI document lists the scopes, too. One dependency looks the key up and authorizes it: each costs a change
    of threads.
    """

    def check(asked: HTTPConnection, shared: Shared, credentials: Credentials, wanted: SecurityScopes) -> ApiKey:
        key = authenticated(shared, None if credentials is None else credentials.credentials)
        for scope in wanted.scopes:
            authorize(shared, key, scope, kind)
        check_query(asked)  # only now: unauthenticated callers learn no parameters
        return key

    return check


allowed = requires()
Reader = Annotated[ApiKey, Security(allowed, scopes=["read"])]
Submitter = Annotated[ApiKey, Security(allowed, scopes=["submit"])]
Operator = Annotated[ApiKey, Security(allowed, scopes=["operate"])]
Parser = Annotated[ApiKey, Security(requires("parse"), scopes=["read"])]
Watcher = Annotated[ApiKey, Security(allowed, scopes=[METRICS])]
