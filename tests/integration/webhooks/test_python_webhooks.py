"""`client.webhooks` and `client.references` against a real API, with a receiver beside it."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from standardwebhooks.webhooks import Webhook as Signature

from marey.client import Client, InvalidInput, NotFound, TimedOut, WebhookSecret
from marey.embedded import EmbeddedServer
from tests.servers.receiver import Receiver, status
from tests.support.live_api import LiveApi, running_api, settings_of
from tests.support.webhooks import delivering

HOOK = "https://studio.example/marey"


@pytest.fixture(scope="module")
def api(
    module_database_url: str, valkey: EmbeddedServer, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[LiveApi]:
    config = settings_of(tmp_path_factory.mktemp("webhooks"), module_database_url, valkey.url)
    with running_api(config, module_database_url) as api:
        yield api


@pytest.fixture
def client(api: LiveApi) -> Iterator[Client]:
    with Client(api.url, api.key) as client:
        yield client
        for webhook in client.webhooks.list():
            client.webhooks.delete(webhook)


def test_a_webhook_is_made_changed_and_deleted(client: Client) -> None:
    made = client.webhooks.create(HOOK, events=["job.ended"], name="farm")
    Signature(made.secret)
    assert isinstance(made, WebhookSecret)
    assert made.secret not in repr(made)
    found = client.webhooks.get(made)
    assert (found.id, found.url, found.events, found.name, found.paused) == (
        made.id, HOOK, ("job.ended",), "farm", False,
    )  # fmt: skip
    assert found.created is not None
    assert [each.id for each in client.webhooks.list(limit=1)] == [made.id]
    assert client.webhooks.pause(made).paused
    assert not client.webhooks.resume(made.id).paused
    changed = client.webhooks.update(made, url=f"{HOOK}/2", events=["job.paused"], name="other")
    assert (changed.url, changed.events, changed.name) == (f"{HOOK}/2", ("job.paused",), "other")
    rotated = client.webhooks.rotate(made, overlap_hours=1)
    assert (rotated.id, rotated.secret != made.secret) == (made.id, True)
    client.webhooks.delete(made)
    with pytest.raises(NotFound):
        client.webhooks.get(made)
    with pytest.raises(InvalidInput):
        client.webhooks.create("https://10.0.0.1/hook")


def test_messages_are_sent_replayed_and_listed_with_their_attempts(api: LiveApi, client: Client) -> None:
    with Receiver() as receiver:
        webhook = client.webhooks.create(receiver.url())
        with delivering(api.engine, api.url):
            sent = client.webhooks.wait(client.webhooks.test(webhook), timeout=60)
            assert (sent.state, sent.kind, sent.status, sent.attempts, sent.has_ended) == (
                "delivered", "webhook.test", 200, 1, True,
            )  # fmt: skip
            receiver.answer = status(500)
            failed = client.webhooks.wait(client.webhooks.test(webhook))
            assert (failed.state, failed.status) == ("failed", 500)
            assert [each.event for each in client.webhooks.deliveries(webhook, state="failed")] == [failed.event]
            (attempt,) = client.webhooks.delivery(webhook, failed).log
            assert (attempt.number, attempt.status, attempt.error) == (1, 500, failed.error)
            receiver.answer = status(200)
            again = client.webhooks.wait(client.webhooks.replay(webhook, failed))
            assert (again.event, again.state) == (failed.event, "delivered")
        assert [each.event for each in client.webhooks.deliveries(webhook, limit=1)] == [failed.event]
        assert len(list(client.webhooks.deliveries(webhook.id))) == 2


def test_a_delivery_that_no_scheduler_makes_times_out(client: Client) -> None:
    webhook = client.webhooks.create(HOOK)
    with pytest.raises(TimedOut, match="no attempt was made in time") as told:
        client.webhooks.wait(client.webhooks.test(webhook), timeout=0)
    assert "marey" not in (told.value.hint or "")


def test_short_references_are_resolved(client: Client) -> None:
    webhook = client.webhooks.create(HOOK, name="farm")
    for reference in (webhook.id, webhook.id[-8:], "farm", "last"):
        (match,) = client.references.resolve("webhook", reference)
        assert (match.kind, match.id, match.name) == ("webhook", webhook.id, "farm")
    assert client.references.resolve("webhook", "no such") == ()
    sent = client.webhooks.test(webhook)
    (match,) = client.references.resolve("delivery", "last", webhook=webhook)
    assert (match.id, match.name) == (sent.event, "webhook.test")
    with pytest.raises(InvalidInput):
        client.references.resolve("job", "")
