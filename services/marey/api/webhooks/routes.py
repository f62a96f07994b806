"""`/v1/webhooks`."""

from __future__ import annotations

from typing import Annotated
from uuid import UUID

from fastapi import APIRouter, Query, Response

from marey import webhooks
from marey.api.audit import note
from marey.api.auth import Operator, Reader
from marey.api.context import Connection, Shared
from marey.api.webhooks.schemas import (
    DeliveryDetailView,
    DeliveryView,
    MadeWebhookView,
    NewWebhookBody,
    WebhookPatch,
    WebhookView,
)
from marey.core.addresses import Allowed
from marey.http.json_bodies import UniqueKeysRoute
from marey.http.problems import RESPONSES
from marey.http.schemas import Cursor, Limit, PageView
from marey.webhooks.addresses import check_url
from marey.webhooks.vault import Vault, new_signing_secret

router = APIRouter(prefix="/v1/webhooks", tags=["webhooks"], responses=RESPONSES, route_class=UniqueKeysRoute)


@router.post("", status_code=201)
def create_webhook(
    body: NewWebhookBody, response: Response, shared: Shared, conn: Connection, key: Operator
) -> MadeWebhookView:
    """Create a webhook for future events. The answer has the signing secret, which is shown only here."""
    url = check_url(body.url, Allowed.of(shared.config.webhook_allow))
    secret = new_signing_secret()
    sealed = Vault.of(shared.config).encrypt(secret)
    made = webhooks.create_webhook(conn, webhooks.NewWebhook(key.tenant, url, body.events, sealed, body.name))
    note(conn, key, "webhook.create", made, events=list(body.events))
    response.headers["Location"] = f"/v1/webhooks/{made}"
    return MadeWebhookView.made(webhooks.get_webhook(conn, key.tenant, made), secret)


@router.get("")
def list_webhooks(conn: Connection, key: Reader, cursor: Cursor = None, limit: Limit = 50) -> PageView[WebhookView]:
    """List webhooks, newest first."""
    page = webhooks.list_webhooks(conn, key.tenant, cursor=cursor, limit=limit)
    return PageView[WebhookView].of(page, WebhookView.of)


@router.get("/{webhook}")
def get_webhook(webhook: UUID, conn: Connection, key: Reader) -> WebhookView:
    """Get one webhook."""
    return WebhookView.of(webhooks.get_webhook(conn, key.tenant, webhook))


@router.patch("/{webhook}")
def change_webhook(webhook: UUID, patch: WebhookPatch, shared: Shared, conn: Connection, key: Operator) -> WebhookView:
    """Change the given fields. While a webhook is paused its messages wait; then they go to its current URL."""
    fields = patch.model_dump()
    if patch.url is not None:
        fields["url"] = check_url(patch.url, Allowed.of(shared.config.webhook_allow))
    note(conn, key, "webhook.change", webhook, fields=sorted(patch.model_fields_set))
    return WebhookView.of(webhooks.change_webhook(conn, key.tenant, webhook, webhooks.WebhookChange(**fields)))


@router.post("/{webhook}/rotate")
def rotate_webhook(
    webhook: UUID,
    shared: Shared,
    conn: Connection,
    key: Operator,
    overlap_hours: Annotated[
        float, Query(ge=0, le=720, description="The current secret also signs for this long; 0 = not at all.")
    ] = 24,
) -> MadeWebhookView:
    """Sign with a new secret. The answer has it, and only this one; until the overlap ends messages carry two
    signatures."""
    secret = new_signing_secret()
    sealed = Vault.of(shared.config).encrypt(secret)
    row = webhooks.rotate_secret(conn, key.tenant, webhook, sealed, overlap=3600 * overlap_hours)
    note(conn, key, "webhook.rotate", webhook, overlap_hours=overlap_hours)
    return MadeWebhookView.made(row, secret)


@router.delete("/{webhook}", status_code=204, response_class=Response)
def delete_webhook(webhook: UUID, conn: Connection, key: Operator) -> None:
    """Delete a webhook, with its deliveries and their log."""
    webhooks.delete_webhook(conn, key.tenant, webhook)
    note(conn, key, "webhook.delete", webhook)


@router.post("/{webhook}/test", status_code=202)
def send_test(webhook: UUID, conn: Connection, key: Operator) -> DeliveryView:
    """Send a message of the type `webhook.test`, which is attempted once."""
    note(conn, key, "webhook.test", webhook)
    return DeliveryView.of(webhooks.send_test(conn, key.tenant, webhook))


@router.get("/{webhook}/deliveries")
def list_deliveries(
    webhook: UUID,
    conn: Connection,
    key: Reader,
    state: Annotated[list[webhooks.DeliveryState] | None, Query()] = None,
    cursor: Cursor = None,
    limit: Limit = 50,
) -> PageView[DeliveryView]:
    """List deliveries of the last 30 days, newest first."""
    page = webhooks.list_deliveries(conn, key.tenant, webhook, states=state or (), cursor=cursor, limit=limit)
    return PageView[DeliveryView].of(page, DeliveryView.of)


@router.get("/{webhook}/deliveries/{event}")
def get_delivery(webhook: UUID, event: UUID, conn: Connection, key: Reader) -> DeliveryDetailView:
    """Get one delivery with its attempts."""
    row = webhooks.get_delivery(conn, key.tenant, webhook, event)
    return DeliveryDetailView.detail(row, webhooks.delivery_attempts(conn, webhook, event))


@router.post("/{webhook}/deliveries/{event}/replay", status_code=202)
def replay_delivery(webhook: UUID, event: UUID, conn: Connection, key: Operator) -> DeliveryView:
    """Deliver again, now, under the same id and with all attempts; also a pending one."""
    note(conn, key, "webhook.replay", webhook, event=str(event))
    return DeliveryView.of(webhooks.replay_delivery(conn, key.tenant, webhook, event))
