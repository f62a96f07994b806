"""Webhooks: subscriptions, the outbox of events, deliveries, signing secrets."""

from marey.webhooks.deliveries import (
    claim_deliveries,
    delivery_attempts,
    get_delivery,
    give_back_deliveries,
    list_deliveries,
    record_attempt,
    replay_delivery,
    send_test,
)
from marey.webhooks.repository import (
    change_webhook,
    create_webhook,
    delete_webhook,
    get_webhook,
    list_webhooks,
    rotate_secret,
)
from marey.webhooks.types import (
    Attempt,
    AttemptRow,
    DeliveryRow,
    DeliveryState,
    DueDelivery,
    EventKind,
    NewWebhook,
    WebhookChange,
    WebhookRow,
)

__all__ = [
    "Attempt",
    "AttemptRow",
    "DeliveryRow",
    "DeliveryState",
    "DueDelivery",
    "EventKind",
    "NewWebhook",
    "WebhookChange",
    "WebhookRow",
    "change_webhook",
    "claim_deliveries",
    "create_webhook",
    "delete_webhook",
    "delivery_attempts",
    "get_delivery",
    "get_webhook",
    "give_back_deliveries",
    "list_deliveries",
    "list_webhooks",
    "record_attempt",
    "replay_delivery",
    "rotate_secret",
    "send_test",
]
