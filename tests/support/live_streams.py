"""Hands to do the part of a live loop, and eyes for what a socket shows."""

from __future__ import annotations

import contextlib
import json
import socket
import time
from collections.abc import Generator, Sequence
from dataclasses import dataclass, field
from typing import Any
from uuid import UUID

import numpy as np
import redis
import sqlalchemy as sa
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from marey.core.errors import InvalidInput
from marey.core.settings import Settings
from marey.db import transaction
from marey.streams import StreamChunk, StreamState, add_chunk, end_stream, take_stream
from marey.streams.control import START, ControlQueue, StreamControl
from marey.streams.frames import Frame, encode_frame
from marey.streams.redis import FrameStream
from marey.streams.rewrites import PromptRewrite
from tests.support.models import add_text_bundles, random_bundle, streaming_model

JOINTS = 22
BUNDLE = "streamer-paperclip"
PATIENCE = 30.0
"""Seconds that anything may take on a busy machine."""


def add_streamer(config: Settings) -> None:
    """A bundle that can stream, for an API that has none: `BUNDLE`, of random weights."""
    if not (config.models / BUNDLE).exists():
        model = streaming_model()
        add_text_bundles(config.models)
        random_bundle(model, config.models / BUNDLE)


class Hand:
    """Takes a stream and writes it, as a worker would."""

    def __init__(self, engine: sa.Engine, client: redis.Redis, stream: str) -> None:
        self.engine, self.stream = engine, UUID(stream)
        self.frames = FrameStream(client, stream, lease_ms=600_000)
        self._queue = ControlQueue(client, stream)
        lease = self.frames.acquire()
        assert lease is not None
        self.lease = lease
        with transaction(engine) as conn:
            self.past = take_stream(conn, self.stream, lease.fence, "hand")
        self._next = 0
        self._noted = 0
        self._read = START

    def show(self, count: int, *, prompt: int = 0, last: bool = False) -> list[bytes]:
        """Write the next frames; their bytes."""
        numbers = range(self._next, self._next + count)
        made = [_frame(number, prompt, last and number == numbers[-1]) for number in numbers]
        self.frames.write(self.lease, made)
        self._next += count
        return [encode_frame(frame) for frame in made]

    def note(
        self, *prompts: tuple[int, str], state: StreamState | None = None, reads: Sequence[PromptRewrite] | None = None
    ) -> None:
        """Put on record what was shown since."""
        count = self._next - self._noted
        chunk = StreamChunk(self._noted, count, bytes(2 * count), prompts, "0-0", state, reads=reads)
        with transaction(self.engine) as conn:
            assert add_chunk(conn, self.stream, self.lease.fence, chunk)
        self._noted = self._next

    def end(self, reason: str = "stopped") -> None:
        """The stream is over."""
        with transaction(self.engine) as conn:
            assert end_stream(conn, self.stream, self.lease.fence, reason)

    def received(self) -> list[StreamControl]:
        """Requests since the last call; wait for the next one if there are none."""
        found: list[tuple[str, StreamControl | InvalidInput]] = []
        until = time.monotonic() + 5.0
        while not found and time.monotonic() < until:
            found = self._queue.read(self._read, block_ms=1000)
        self._read = found[-1][0] if found else self._read
        return [control for _, control in found if isinstance(control, StreamControl)]


@dataclass
class Seen:
    """Everything that came, in order, up to and with what was waited for."""

    frames: list[bytes] = field(default_factory=list)
    messages: list[dict[str, Any]] = field(default_factory=list)

    @property
    def numbers(self) -> list[int]:
        """Of the frames."""
        return [int.from_bytes(data[4:8], "little") for data in self.frames]

    def of(self, kind: str) -> list[dict[str, Any]]:
        """The messages of this type."""
        return [message for message in self.messages if message["type"] == kind]


class Viewer:
    """A client of one socket."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection

    def ask(self, kind: str, **fields: str) -> None:
        """Send a message."""
        self.connection.send(json.dumps({"kind": kind, **fields}))

    def until(self, kind: str) -> Seen:
        """Messages up to one of this type."""
        seen = Seen()
        while not seen.of(kind):
            self._next(seen)
        return seen

    def until_frame(self, number: int) -> Seen:
        """Messages up to the frame of this number."""
        seen = Seen()
        while not seen.frames or seen.numbers[-1] < number:
            self._next(seen)
        return seen

    def closed(self) -> tuple[int, str]:
        """The code and reason with which the server closes, after whatever it still sends."""
        with contextlib.suppress(ConnectionClosed):
            while True:
                self.connection.recv(timeout=PATIENCE)
        assert self.connection.close_code is not None
        return self.connection.close_code, self.connection.close_reason or ""

    def _next(self, seen: Seen) -> None:
        data = self.connection.recv(timeout=PATIENCE)
        if isinstance(data, bytes):
            seen.frames.append(data)
        else:
            seen.messages.append(json.loads(data))


@contextlib.contextmanager
def watching(
    url: str, stream: str, secret: str | None, *, narrow: bool = False, host: str | None = None, **options: Any
) -> Generator[Viewer]:
    """An open socket.

    Args:
        url: of the API.
        stream: its id, with the query if there is one.
        secret: shown as a header; None sends none.
        narrow: hardly anything fits on the way to it.
        host: what it calls the server; None = what it is.
        options: of the client.
    """
    headers = dict(options.pop("additional_headers", {}))
    if secret is not None:
        headers["Authorization"] = f"Bearer {secret}"
    place, _, port = url.removeprefix("http://").partition(":")
    line = socket.socket()
    if narrow:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        options["max_queue"] = 1
    line.connect((place, int(port)))
    address = f"ws://{host or place}:{port}/v1/streams/{stream}"
    options |= {"open_timeout": PATIENCE, "close_timeout": 0.5}  # what was not read keeps the answer to a close waiting
    with connect(address, additional_headers=headers, sock=line, **options) as connection:
        yield Viewer(connection)


def _frame(number: int, prompt: int, last: bool) -> Frame:
    rotations = np.tile(np.array([1, 0, 0, 0], np.float32), (JOINTS, 1))
    return Frame(number, np.array([number / 20, 0.9, 0], np.float32), rotations, prompt=prompt, last=last)
