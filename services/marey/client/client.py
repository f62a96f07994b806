"""The client of one server, with a resource for each noun of its API."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from marey.client.evaluations import Evaluations
from marey.client.jobs import Jobs
from marey.client.models import Models
from marey.client.motions import Motions
from marey.client.place import Server, find_server, server_at
from marey.client.references import References
from marey.client.schedules import Schedules
from marey.client.streams import Streams
from marey.client.transport import Transport
from marey.client.webhooks import Webhooks


class Client:
    """A client of a Marey server; safe to use from several threads, except for `LiveStream`.

    Failed requests that may be repeated are retried with back-off; a submit and all its retries share one idempotency
    key. Every expected failure is a `MareyError`.

    Args:
        server: its URL; None = that of `MAREY_SERVER`, or of a `marey serve` on this machine.
        key: an API key; None = that of `MAREY_KEY` or `MAREY_KEY_FILE`, or of the `marey serve`.
        timeout: seconds without data from the server after which a request counts as failed.
        attempts: the largest number of attempts of each request; None = 5, and longer while the server is busy.

    Raises:
        Unreachable: no server is given and none runs here.
        Unauthenticated: there is no key.
        InvalidInput: the URL is not one.

    Attributes:
        jobs, motions, streams, evaluations, schedules, webhooks, models, references: the nouns of the API.
    """

    def __init__(
        self,
        server: str | Server | None = None,
        key: str | None = None,
        *,
        timeout: float = 30.0,
        attempts: int | None = None,
    ) -> None:
        if not isinstance(server, Server):
            server = find_server() if server is None else server_at(server, key)
        if key is not None and key != server.key:
            server = Server(server.url, key)
        self._transport = Transport(server, timeout=timeout, attempts=attempts)
        self.jobs = Jobs(self._transport)
        self.motions = Motions(self._transport)
        self.streams = Streams(self._transport)
        self.evaluations = Evaluations(self._transport)
        self.schedules = Schedules(self._transport)
        self.webhooks = Webhooks(self._transport)
        self.models = Models(self._transport)
        self.references = References(self._transport)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def server(self) -> Server:
        """The server and the key that this client uses."""
        return self._transport.server

    def close(self) -> None:
        """Close the connections."""
        self._transport.close()
