"""Webhooks: subscriptions to events."""
