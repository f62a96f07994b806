"""API keys: `Authorization: Bearer marey_…`, each with scopes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from fastapi import Depends, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from services.api.context import Context, Shared
from shared.errors import Refused, Unauthenticated
from shared.jobs import ApiKey, authenticate, transaction

bearer = HTTPBearer(auto_error=False, description="An API key: `marey admin keys create`.")


def caller(shared: Shared, credentials: Annotated[HTTPAuthorizationCredentials | None, Security(bearer)]) -> ApiKey:
    """The key that a request shows.

    Raises:
        Unauthenticated: none, or not a valid one.
    """
    return authenticated(shared, None if credentials is None else credentials.credentials)


def authenticated(shared: Context, secret: str | None) -> ApiKey:
    """The key of this secret; raises as `caller`."""
    if not secret:
        raise Unauthenticated("no API key was sent", hint="Send the header `Authorization: Bearer <key>`.")
    with transaction(shared.engine) as conn:
        return authenticate(conn, secret)


def check_scope(key: ApiKey, scope: str) -> None:
    """Nothing, if the key has the scope (`admin` has all).

    Raises:
        Refused: it has not.
    """
    if scope not in key.scopes and "admin" not in key.scopes:
        raise Refused(f"the key {key.name!r} lacks the scope {scope!r}", hint="Use a key that has it.")


def requires(scope: str) -> Callable[[ApiKey], ApiKey]:
    """A dependency: the caller's key, if it has the scope; raises as `check_scope`."""

    def check(key: Annotated[ApiKey, Depends(caller)]) -> ApiKey:
        check_scope(key, scope)
        return key

    return check


Reader = Annotated[ApiKey, Depends(requires("read"))]
Submitter = Annotated[ApiKey, Depends(requires("submit"))]
Operator = Annotated[ApiKey, Depends(requires("operate"))]
