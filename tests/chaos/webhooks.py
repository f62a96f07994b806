"""A receiver of webhooks that fails now and then, and what it must have been told."""

from __future__ import annotations

import json
import random
from collections import Counter
from http.server import BaseHTTPRequestHandler
from uuid import UUID

import sqlalchemy as sa
from standardwebhooks.webhooks import Webhook, WebhookVerificationError

from tests.servers.receiver import Received, Receiver, status
from tests.support.webhooks import SECRET

FAILING = 0.15
"""Share of messages whose first try is answered with 500; a second try comes 5 s later."""

TOLD = """
    SELECT event.id, event.kind, event.data, delivery.state, delivery.attempts FROM webhook_event AS event
    JOIN webhook_delivery AS delivery ON delivery.event_id = event.id WHERE delivery.webhook_id = :webhook
"""
OCCURRED = """
    SELECT job_id::text AS job, data ->> 'to' AS state, count(*) AS times FROM job_event
    WHERE kind = 'state' AND data ->> 'to' NOT IN ('queued', 'running') GROUP BY 1, 2
"""


class Flaky(Receiver):
    """Answers 500 to the first try of some messages, and checks every signature."""

    def __init__(self, seed: int) -> None:
        super().__init__()
        self._draw = random.Random(f"{seed} receiver")
        self._seen: set[str] = set()
        self.forged: list[str] = []
        self.answer = self._answer

    def _answer(self, receiver: Receiver, handler: BaseHTTPRequestHandler, request: Received) -> None:
        try:
            Webhook(SECRET).verify(request.body, request.headers)
        except WebhookVerificationError as error:
            self.forged.append(f"{request.id}: {error}")
        fails = request.id not in self._seen and self._draw.random() < FAILING
        self._seen.add(request.id)
        status(500 if fails else 200)(receiver, handler, request)


def webhooks_wrong(conn: sa.Connection, webhook: UUID, receiver: Flaky) -> list[str]:
    """Every event that occurred came, as it is written, and none that did not.

    That each end and pause of a job has its event is the audit's of the tables.
    """
    wrong = [f"forged: {one}" for one in receiver.forged]
    came: dict[str, list[dict[str, object]]] = {}
    for request in receiver.received:
        came.setdefault(request.id, []).append(json.loads(request.body)["data"])
    told = {str(row.id): row for row in conn.execute(sa.text(TOLD), {"webhook": webhook})}
    wrong += [f"message {one} is about no event" for one in came.keys() - told.keys()]
    for one, row in told.items():
        if row.state != "delivered" or one not in came:
            times = len(came.get(one, []))
            wrong.append(f"event {one} is {row.state} after {row.attempts} tries and came {times} times")
        wrong += [
            f"event {one} was told as {data}"
            for data in came.get(one, [])
            if (data["job"], data["state"]) != (row.data["job"], row.data["state"])
        ]
    occurred = {(row.job, row.state): row.times for row in conn.execute(sa.text(OCCURRED))}
    counted = Counter((row.data["job"], row.data["state"]) for row in told.values())
    wrong += [
        f"{state} of job {job} was told {n} times and occurred {occurred.get((job, state), 0)} times"
        for (job, state), n in counted.items()
        if n != occurred.get((job, state), 0)
    ]
    return wrong
