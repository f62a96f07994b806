"""The client of one server, with a resource for each noun of its API."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from marey.client.evaluations import Evaluations
from marey.client.jobs import Jobs
from marey.client.models import Models
from marey.client.motions import Motions
from marey.client.place import Server, find_server, server_at
from marey.client.streams import Streams
from marey.client.transport import Transport


class Client:
    """A client of a Marey server; safe to use from several threads, but for `LiveStream`.

    Failed requests are tried again, with back-off, where they may be repeated; a submit and all its retries have one
    idempotency key. Every expected failure is a `MareyError`.

    Args:
        server: its URL; None = that of `MAREY_SERVER`, or of a `marey serve` on this machine.
        key: an API key; None = that of `MAREY_KEY` or `MAREY_KEY_FILE`, or of the `marey serve`.
        timeout: seconds of silence after which a request counts as failed.
        attempts: of each request.

    Raises:
        Unreachable: no server is given and none runs here.
        Unauthenticated: there is no key.
        InvalidInput: the URL is none.

    Attributes:
        jobs, motions, streams, evaluations, models: the nouns of the API.
        transport: requests by path, for routes that have no method here.
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
        self.transport = Transport(server, timeout=timeout, attempts=attempts)
        self.jobs = Jobs(self.transport)
        self.motions = Motions(self.transport)
        self.streams = Streams(self.transport)
        self.evaluations = Evaluations(self.transport)
        self.models = Models(self.transport)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    @property
    def server(self) -> Server:
        """The server and the key that this client uses."""
        return self.transport.server

    def close(self) -> None:
        """Close the connections."""
        self.transport.close()
