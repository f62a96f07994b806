"""Requests and waits of live stream tests."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import httpx2
import sqlalchemy as sa

from marey.core.settings import Settings
from marey.db import transaction
from marey.tenants import create_key
from tests.support.live_api import LiveApi, settings_of
from tests.support.live_streams import PATIENCE, watching

WALK = {"prompt": "a person walks"}
LATE = 600
"""Frames that no buffer between us and a client that reads nothing can hold, and that Redis still has."""


def new_key(api: LiveApi, *scopes: str, tenant: str = "default") -> str:
    with transaction(api.engine) as conn:
        return create_key(conn, "one", scopes, tenant=tenant).secret


def begin(http: httpx2.Client, **fields: object) -> dict[str, Any]:
    response = http.post("/v1/streams", json={**WALK, **fields})
    assert response.status_code == 201, response.text
    return response.json()


def refused(response: httpx2.Response, status: int, kind: str) -> dict[str, Any]:
    assert response.status_code == status, response.text
    assert response.json()["type"] == f"urn:marey:problem:{kind}"
    return response.json()


def close_code(api: LiveApi, stream: str, secret: str | None, **options: Any) -> int:
    with watching(api.url, stream, secret, **options) as viewer:
        return viewer.closed()[0]


def beside(config: Settings, **changes: str | None) -> Settings:
    """Settings of another API process on the same database and queue, but for the changes."""
    assert config.database_url is not None
    assert config.queue_url is not None
    own = settings_of(config.home, config.database_url.get_secret_value(), config.queue_url.get_secret_value())
    return Settings.model_validate({**own.model_dump(), **changes})


def waiting_for_a_row(engine: sa.Engine) -> bool:
    """Return True if a transaction on this database waits for another to commit."""
    asked = "SELECT count(*) FROM pg_stat_activity WHERE datname = current_database() AND wait_event_type = 'Lock'"
    with transaction(engine) as conn:
        return conn.execute(sa.text(asked)).scalar_one() > 0


def until(holds: Callable[[], object]) -> None:
    """Wait until something holds."""
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)
