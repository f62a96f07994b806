"""The table of every operation and every state of a key: who is let in where, and what the others are told."""

from __future__ import annotations

import re
from collections.abc import Iterator
from uuid import uuid4

import httpx2
import pytest
from fastapi.routing import APIRoute

from marey.api.app import ROUTERS
from marey.api.docs.routes import FILES
from tests.support.auth_states import holders, invalid_knocks, lesser_knocks
from tests.support.document import openapi
from tests.support.live_api import LiveApi

PAGES = {"GET /", "GET /live", "GET /docs", "GET /openapi.json", *(f"GET /docs/{name}" for name in FILES)}
NOBODYS = {"GET /livez", "GET /readyz", *PAGES}
"""Routes without a key: a further one is added here on purpose, or the tests fail."""
SCOPES = {"GET": "read", "PATCH": "operate", "DELETE": "operate", "POST": "operate"}
"""Scope that a method requires, except for these."""
OTHERS = {
    "GET /metrics": "metrics",
    "POST /v1/texts/parse": "read",
    "POST /v1/jobs": "submit",
    "POST /v1/motions/files": "read",
    "POST /v1/motions/review": "submit",
    "POST /v1/motions/reroll": "submit",
    "POST /v1/motions/{motion}/edits": "submit",
    "POST /v1/motions/{motion}/revert": "submit",
    "POST /v1/rigs": "submit",
    "POST /v1/streams": "submit",
    "DELETE /v1/streams/{stream}": "submit",
    "POST /v1/streams/{stream}/end": "submit",
    "POST /v1/evaluations": "submit",
    "POST /v1/schedules": "submit",
    "POST /v1/schedules/{schedule}/run": "submit",
}


def documented() -> dict[str, str | None]:
    """By operation, the scope that the OpenAPI document says it wants."""
    paths = openapi()["paths"]
    return {
        f"{method.upper()} {path}": security[0]["HTTPBearer"][0] if (security := operation.get("security")) else None
        for path, operations in paths.items()
        for method, operation in operations.items()
    }


OPERATIONS = documented()
CLOSED = {operation: scope for operation, scope in OPERATIONS.items() if scope is not None}


@pytest.fixture(scope="module")
def anybody(api: LiveApi) -> Iterator[httpx2.Client]:
    with httpx2.Client(base_url=api.url, timeout=30) as http:
        yield http


def send(http: httpx2.Client, operation: str, headers: dict[str, str], **body: object) -> httpx2.Response:
    """A request of this operation for things that are nowhere."""
    method, template = operation.split(" ")
    return http.request(method, re.sub(r"{\w+}", lambda _: str(uuid4()), template), headers=headers, **body)


def test_the_document_has_every_route_and_says_which_scope_it_wants() -> None:
    served = {
        f"{method} {route.path}"
        for router in ROUTERS
        for route in router.routes
        if isinstance(route, APIRoute)
        for method in route.methods - {"HEAD"}
    }
    assert served - OPERATIONS.keys() == PAGES
    assert {operation for operation, scope in OPERATIONS.items() if scope is None} == NOBODYS - PAGES
    assert {name: OTHERS.get(name, SCOPES[name.split(" ")[0]]) for name in CLOSED} == CLOSED


def test_on_no_route_is_anybody_answered_without_a_valid_key(api: LiveApi, anybody: httpx2.Client) -> None:
    knocks = invalid_knocks(api.engine)
    for operation in CLOSED:
        for knock in knocks:
            response = send(anybody, operation, knock.headers)
            knock.check(response.status_code, response.json())
            assert response.headers["Content-Type"] == "application/problem+json", (operation, knock.state)
            assert ("WWW-Authenticate" in response.headers) == (knock.status == 401), (operation, knock.state)


def test_a_key_opens_the_routes_of_its_scopes_and_no_other(api: LiveApi, anybody: httpx2.Client) -> None:
    lesser = {scope: lesser_knocks(api.engine, scope) for scope in set(CLOSED.values())}
    enough = {scope: holders(api.engine, scope) for scope in set(CLOSED.values())}
    for operation, scope in CLOSED.items():
        for knock in lesser[scope]:
            response = send(anybody, operation, knock.headers, json={"what": "is not even looked at"})
            knock.check(response.status_code, response.json())
        for secret in enough[scope]:
            response = send(anybody, operation, {"Authorization": f"Bearer {secret}"})
            assert response.status_code in (200, 404, 422), f"{operation}: {response.status_code} {response.text[:200]}"


def test_what_nobody_needs_a_key_for_is_told_to_all_alike(api: LiveApi, anybody: httpx2.Client) -> None:
    for operation in NOBODYS:
        answers = {
            (response.status_code, response.text)
            for knock in (None, "Bearer marey_0_0", f"Bearer {api.key}")
            for response in [send(anybody, operation, {} if knock is None else {"Authorization": knock})]
        }
        assert len(answers) == 1, operation
        assert answers.pop()[0] in (200, 503), operation
