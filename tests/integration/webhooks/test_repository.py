"""The rows of webhooks: listings, the limit of a tenant, refused values."""

from __future__ import annotations

import pytest
import sqlalchemy as sa

from marey.core.errors import Conflict, InvalidInput
from marey.db import transaction
from marey.tenants import DEFAULT_TENANT
from marey.webhooks import (
    Attempt,
    DeliveryState,
    NewWebhook,
    WebhookChange,
    change_webhook,
    claim_deliveries,
    create_webhook,
    list_deliveries,
    list_webhooks,
    record_attempt,
)
from marey.webhooks.repository import MAX_WEBHOOKS
from tests.support.webhooks import happen, new_webhook


def test_listings_go_page_by_page_and_choose_by_state(engine: sa.Engine) -> None:
    webhook = new_webhook(engine)
    happen(engine, 5)
    with transaction(engine) as conn:
        for due in claim_deliveries(conn, 2, each=100):
            record_attempt(conn, due, Attempt(204, 0.1, None))
        first = list_deliveries(conn, DEFAULT_TENANT, webhook, limit=3)
        second = list_deliveries(conn, DEFAULT_TENANT, webhook, limit=3, cursor=first.cursor)
        events = [row.event for row in (*first.rows, *second.rows)]
        assert (len(set(events)), events, second.cursor) == (5, sorted(events, reverse=True), None)
        arrived = list_deliveries(conn, DEFAULT_TENANT, webhook, states=[DeliveryState.DELIVERED]).rows
        assert [row.status for row in arrived] == [204, 204]
        assert [row.id for row in list_webhooks(conn, DEFAULT_TENANT).rows] == [webhook]


def test_a_tenant_has_a_limited_number_of_webhooks_and_each_wants_something(engine: sa.Engine) -> None:
    for _ in range(MAX_WEBHOOKS):
        new_webhook(engine)
    with pytest.raises(Conflict, match="the limit of"):
        new_webhook(engine)
    with transaction(engine) as conn:
        webhook = list_webhooks(conn, DEFAULT_TENANT).rows[0].id
        with pytest.raises(InvalidInput, match="is empty"):
            change_webhook(conn, DEFAULT_TENANT, webhook, WebhookChange(events=[]))
        for change in (WebhookChange(name="a\0"), WebhookChange(url="https://a\0/")):
            with pytest.raises(InvalidInput, match=r"^(name|url): .*NUL"):
                change_webhook(conn, DEFAULT_TENANT, webhook, change)
    with pytest.raises(InvalidInput, match="NUL"), transaction(engine) as conn:
        create_webhook(conn, NewWebhook(DEFAULT_TENANT, "https://a\0/", [], b""))
