"""The message format: JSON with `type`, `timestamp` and `data`, signed according to Standard Webhooks."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime

from standardwebhooks.webhooks import Webhook

from marey.core.package import own_version
from marey.webhooks.types import DueDelivery

NOUNS = {
    "job": "/v1/jobs/{}",
    "stream": "/v1/streams/{}",
    "evaluation": "/v1/evaluations/{}",
    "schedule": "/v1/schedules/{}",
    "webhook": "/v1/webhooks/{}",
}
"""API path of the object that an event names."""


def message_of(due: DueDelivery, api: str) -> bytes:
    """Return the body, the same in every attempt; `api` is the address of the API."""
    urls = {noun: api + path.format(due.data[noun]) for noun, path in NOUNS.items() if due.data.get(noun) is not None}
    document = {"type": due.kind, "timestamp": due.at.isoformat(), "data": {**due.data, "urls": urls}}
    return json.dumps(document, separators=(",", ":"), sort_keys=True).encode()


def headers_of(due: DueDelivery, body: bytes, secrets: Sequence[str], now: datetime | None = None) -> Mapping[str, str]:
    """Return the headers of one attempt: event id, time, and the signatures over both and the body. While a secret is
    rotated there are two signatures, of which receivers know one."""
    at = now or datetime.now(UTC)
    identifier = str(due.event)
    return {
        "content-type": "application/json",
        "user-agent": f"Marey/{own_version()}",
        "webhook-id": identifier,
        "webhook-timestamp": str(int(at.timestamp())),
        "webhook-signature": " ".join(Webhook(each).sign(identifier, at, body.decode()) for each in secrets),
    }
