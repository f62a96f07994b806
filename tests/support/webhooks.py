"""Webhooks for tests, what they were told, and time that passes for them."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any
from uuid import UUID

import sqlalchemy as sa
from cryptography.fernet import Fernet
from pydantic import SecretStr
from structlog.testing import capture_logs

from marey.core.addresses import Allowed
from marey.db import transaction
from marey.jobs import cancel
from marey.scheduler.sending import Sender
from marey.scheduler.webhooks import Deliverer
from marey.tenants import DEFAULT_TENANT
from marey.webhooks import (
    DeliveryRow,
    EventKind,
    NewWebhook,
    create_webhook,
    delivery_attempts,
    list_deliveries,
)
from marey.webhooks.vault import Vault, new_signing_secret
from tests.servers.jobs import submit_items
from tests.servers.receiver import LOOPBACK

KEY = Fernet.generate_key().decode()
VAULT = Vault(KEY)
SECRET_KEY = SecretStr(KEY)
SECRET = new_signing_secret()


def new_webhook(
    engine: sa.Engine, url: str = "https://studio.example/", *events: EventKind, tenant: str = DEFAULT_TENANT
) -> UUID:
    """A webhook signed with `SECRET`; of all events, if none are given."""
    with transaction(engine) as conn:
        return create_webhook(conn, NewWebhook(tenant, url, events or list(EventKind), VAULT.encrypt(SECRET)))


def deliveries(engine: sa.Engine, webhook: UUID, tenant: str = DEFAULT_TENANT) -> list[DeliveryRow]:
    """Deliveries to it, the oldest first."""
    with transaction(engine) as conn:
        return list(reversed(list_deliveries(conn, tenant, webhook, limit=1000).rows))


def messages_of(engine: sa.Engine, webhook: UUID, tenant: str = DEFAULT_TENANT) -> list[tuple[str, Any]]:
    """Kinds and states of the events for it, the oldest first."""
    return [(row.kind, row.data.get("state")) for row in deliveries(engine, webhook, tenant)]


def errors(engine: sa.Engine, webhook: UUID, event: UUID) -> Sequence[str | None]:
    """Of every try of a delivery; None = it arrived."""
    with transaction(engine) as conn:
        return [attempt.error for attempt in delivery_attempts(conn, webhook, event)]


def events_written(engine: sa.Engine) -> int:
    """Rows of the outbox."""
    with transaction(engine) as conn:
        return conn.execute(sa.text("SELECT count(*) FROM webhook_event")).scalar_one()


def happen(engine: sa.Engine, times: int = 1) -> None:
    """Cancel new jobs, so that webhooks have events."""
    for _ in range(times):
        job = submit_items(engine, 1)
        with transaction(engine) as conn:
            cancel(conn, DEFAULT_TENANT, job)


def time_passes(engine: sa.Engine) -> None:
    """As if every delivery that waits, for its next try or behind a claim, had waited long enough."""
    with transaction(engine) as conn:
        conn.execute(sa.text("UPDATE webhook_delivery SET next_at = now() WHERE state = 'pending'"))


@contextmanager
def delivering(engine: sa.Engine, api: str) -> Iterator[None]:
    """The scheduler's part, with the address of the API, until the end of the block."""
    stopping, sender = threading.Event(), Sender(Allowed.of(LOOPBACK))
    thread = Deliverer(engine, VAULT, sender, api=api, interval=0.02, stopping=stopping)
    with capture_logs():  # commands that run in this process own its stdout
        thread.start()
        try:
            yield
        finally:
            stopping.set()
            thread.join(30)
