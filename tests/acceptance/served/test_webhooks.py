"""Webhooks under `marey serve`, which brings the key of their secrets."""

from __future__ import annotations

import stat

from tests.support.marey import Marey


def test_a_server_brings_its_own_key_and_tells_what_did_not_arrive(marey: Marey) -> None:
    assert stat.S_IMODE((marey.home / "webhook.key").stat().st_mode) == 0o600
    marey("webhooks", "add", "https://127.0.0.1/hook").refused(2, "private address", "MAREY_WEBHOOK_ALLOW")
    with marey.client() as client:
        webhook = client.post_once("/v1/webhooks", {"url": "https://no-such-host.invalid/hook"})["id"]
    marey("webhooks", "test", webhook, "--wait").refused(6, "it did not arrive: the host is unknown")
    marey("webhooks", "remove", webhook, "--yes").ok()
