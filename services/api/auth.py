"""API keys: `Authorization: Bearer marey_…`, each with scopes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from fastapi import Depends, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from services.api.context import Shared
from shared.errors import Refused, Unauthenticated
from shared.jobs import ApiKey, authenticate, transaction

bearer = HTTPBearer(auto_error=False, description="An API key: `marey admin keys create`.")


def caller(shared: Shared, credentials: Annotated[HTTPAuthorizationCredentials | None, Security(bearer)]) -> ApiKey:
    """The key that a request shows.

    Raises:
        Unauthenticated: none, or not a valid one.
    """
    if credentials is None:
        raise Unauthenticated("no API key was sent", hint="Send the header `Authorization: Bearer <key>`.")
    with transaction(shared.engine) as conn:
        return authenticate(conn, credentials.credentials)


def requires(scope: str) -> Callable[[ApiKey], ApiKey]:
    """A dependency: the caller's key, if it has the scope (`admin` has all).

    Raises:
        Refused: it has not.
    """

    def check(key: Annotated[ApiKey, Depends(caller)]) -> ApiKey:
        if scope not in key.scopes and "admin" not in key.scopes:
            raise Refused(f"the key {key.name!r} lacks the scope {scope!r}", hint="Use a key that has it.")
        return key

    return check


Reader = Annotated[ApiKey, Depends(requires("read"))]
Submitter = Annotated[ApiKey, Depends(requires("submit"))]
Operator = Annotated[ApiKey, Depends(requires("operate"))]
