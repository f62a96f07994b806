"""Webhooks: signed messages to a server of your own when jobs, streams and evaluations end."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import TypedDict, Unpack

from marey.client.resources import Resource, identifier
from marey.client.types.webhooks import Delivery, DeliveryDetail, Webhook, WebhookSecret
from marey.core.errors import TimedOut

POLL_SECONDS = 0.25
"""Seconds between two looks at a delivery."""


class WebhookChanges(TypedDict, total=False):
    """Changes of a webhook; fields that are not given stay as they are."""

    url: str
    events: Sequence[str]
    name: str
    paused: bool


class Webhooks(Resource):
    """`client.webhooks`. Errors of all methods: NotFound, InvalidInput, Refused, Unreachable."""

    def create(self, url: str, *, events: Sequence[str] | None = None, name: str | None = None) -> WebhookSecret:
        """Subscribe a URL to events from now on. The result has the signing secret, which is shown only here.

        Args:
            url: https, at an address that the server permits.
            events: types such as `job.ended`; None = all.
            name: of the webhook.

        Raises:
            InvalidInput: the URL or a type cannot be used.
        """
        body = {"url": url, **({"events": [*events]} if events else {}), **({"name": name} if name else {})}
        return WebhookSecret.of(self._transport.post_once("/v1/webhooks", body))

    def list(self, *, limit: int | None = None) -> Iterator[Webhook]:
        """Iterate over the webhooks, newest first.

        Args:
            limit: the largest number of webhooks; None = all.
        """
        return self._pages(Webhook, "/v1/webhooks", limit)

    def get(self, webhook: Webhook | str) -> Webhook:
        """Return the current state of a webhook."""
        return Webhook.of(self._transport.get(_path(webhook)))

    def update(self, webhook: Webhook | str, **changes: Unpack[WebhookChanges]) -> Webhook:
        """Change a webhook.

        Args:
            changes: url, events, name, paused.
        """
        body = {**changes, **({"events": [*changes["events"]]} if "events" in changes else {})}
        return Webhook.of(self._transport.patch(_path(webhook), body))

    def pause(self, webhook: Webhook | str) -> Webhook:
        """Pause deliveries; messages wait meanwhile."""
        return self.update(webhook, paused=True)

    def resume(self, webhook: Webhook | str) -> Webhook:
        """Resume deliveries, waiting messages first."""
        return self.update(webhook, paused=False)

    def rotate(self, webhook: Webhook | str, *, overlap_hours: float = 24.0) -> WebhookSecret:
        """Replace the signing secret. The result has the new one, which is shown only here.

        Args:
            overlap_hours: hours (0 to 720) during which messages carry the signatures of both secrets.
        """
        path = f"{_path(webhook)}/rotate?overlap_hours={overlap_hours:g}"
        return WebhookSecret.of(self._transport.post_once(path, None))

    def delete(self, webhook: Webhook | str) -> None:
        """Delete a webhook with its deliveries and their log."""
        self._transport.delete(_path(webhook))

    def deliveries(
        self,
        webhook: Webhook | str,
        *,
        state: str | None = None,
        limit: int | None = None,
        page_size: int | None = None,
    ) -> Iterator[Delivery]:
        """Iterate over the deliveries of the last 30 days, newest first.

        Args:
            state: pending, delivered or failed; None = any.
            limit: the largest number of deliveries; None = all.
            page_size: deliveries of each request, at most 1,000; None = as many as the limit allows.
        """
        return self._pages(Delivery, f"{_path(webhook)}/deliveries", limit, page_size, state=state)

    def delivery(self, webhook: Webhook | str, event: Delivery | str) -> DeliveryDetail:
        """Return a delivery with its attempts.

        Args:
            event: a delivery, or the id of its message.
        """
        return DeliveryDetail.of(self._transport.get(_delivery_path(webhook, event)))

    def replay(self, webhook: Webhook | str, event: Delivery | str) -> Delivery:
        """Deliver a message again, under the same id and with all attempts."""
        return Delivery.of(self._transport.post(f"{_delivery_path(webhook, event)}/replay"))

    def test(self, webhook: Webhook | str) -> Delivery:
        """Send a message of the type `webhook.test`, which is attempted once; `wait` returns the outcome."""
        return Delivery.of(self._transport.post_once(f"{_path(webhook)}/test", None))

    def wait(self, delivery: Delivery, *, timeout: float = 60.0) -> Delivery:
        """Wait until a delivery has ended; it is delivered or failed then.

        Args:
            timeout: seconds.

        Raises:
            TimedOut: `timeout` passed; the delivery is still pending.
        """
        deadline = time.monotonic() + timeout
        found = delivery
        while not found.has_ended:
            if time.monotonic() > deadline:
                raise TimedOut(
                    "no attempt was made in time",
                    where=f"webhook {found.webhook}",
                    hint="Check that a scheduler runs, then wait again.",
                )
            time.sleep(POLL_SECONDS)
            found = self.delivery(found.webhook, found)
        return found


def _path(webhook: Webhook | str) -> str:
    return f"/v1/webhooks/{identifier(webhook)}"


def _delivery_path(webhook: Webhook | str, event: Delivery | str) -> str:
    message = event.event if isinstance(event, Delivery) else event
    return f"{_path(webhook)}/deliveries/{identifier(message)}"
