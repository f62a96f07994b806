"""Webhooks: who is told what happens."""
