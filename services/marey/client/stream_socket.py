"""The WebSocket of one stream, which is opened again after it breaks."""

from __future__ import annotations

import json
import random
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, cast
from urllib.parse import urlencode

from websockets.exceptions import ConnectionClosed, InvalidStatus, InvalidUpgrade, InvalidURI, WebSocketException
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from marey.client.foreign_answers import HTTP_TO_HTTPS, connection_failure, foreign_answer, no_upgrade
from marey.client.server_address import Server, ca_file
from marey.client.transport import PATIENCE
from marey.core.errors import TYPE_PREFIX, InvalidInput, MareyError, NotFound, Refused, Unauthenticated, Unreachable
from marey.core.tls import trusting_context

if TYPE_CHECKING:
    from websockets.sync.client import ClientConnection

SUBPROTOCOL = Subprotocol("marey.stream.v1")
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 4.0
"""Seconds between attempts, doubling with jitter: a stream moves to another worker in two seconds."""
OPEN_SECONDS, CLOSE_SECONDS = 10.0, 1.0
PING_SECONDS, PONG_SECONDS = 5.0, 10.0
STEADY_SECONDS = 5.0
"""A socket that was open for so long, or brought a frame, was good; patience counts from the last good one."""
MOST_WAITING = 1200
"""Messages that are buffered before reading pauses: as many frames as a server keeps."""
_REFUSALS = {401: Unauthenticated, 403: Refused, 404: NotFound, 422: InvalidInput}
"""Errors by the HTTP status of a refused handshake, and with 4000 added by the close code; others are retried."""

NO_UPGRADE = frozenset({400, 405, 422, 426})
"""Statuses of an answer to a handshake that lost its Upgrade on the way; so is a success. The API answers 426, and
answered 422 before. It refuses parameters of a socket by a close code."""
TEMPORARY = frozenset({408, 425, 429})

Message = bytes | dict[str, Any]


class Link:
    """The socket of a stream. Not for several threads.

    Args:
        server: the socket is at its address, `wss` for `https`.
        stream: the stream's id.
        slow: policy for a client that cannot keep up, `skip` or `pause`.
        patience: seconds of failed attempts after which the server counts as unreachable.

    Attributes:
        next: number of the frame from which a new socket continues.
        sockets: number of sockets that were opened.
    """

    def __init__(self, server: Server, stream: str, *, slow: str = "skip", patience: float = PATIENCE) -> None:
        self.next = 0
        self.sockets = 0
        self._server = server
        self._address = f"ws{server.url.removeprefix('http')}/v1/streams/{stream}"
        self._tls = trusting_context(ca_file()) if server.url.startswith("https") else None
        self._slow = slow
        self._patience = patience
        self._socket: ClientConnection | None = None
        self._closing = ExitStack()
        self._good = time.monotonic()
        self._opened = 0.0
        self._pause = FIRST_PAUSE
        self._retry_at = 0.0
        self._refusal: MareyError | None = None

    def __enter__(self) -> Link:
        return self

    def __exit__(self, *_: object) -> None:
        self._closing.close()

    @property
    def connected(self) -> bool:
        """True while a socket is open."""
        return self._socket is not None

    def send(self, message: dict[str, str]) -> bool:
        """Send a control message; return False if no socket is open."""
        if self._socket is None:
            return False
        try:
            self._socket.send(json.dumps(message, ensure_ascii=False))
        except ConnectionClosed as closed:
            self._drop(closed)
            return False
        return True

    def receive(self, wait: float) -> list[Message]:
        """Return the messages that have arrived, in order: frames as bytes, others as objects. Opens the socket.

        Args:
            wait: seconds to wait for the first message.

        Raises:
            Unauthenticated, Refused, NotFound: the server refuses the socket.
            InvalidInput: the server speaks another protocol.
            Unreachable: attempts failed for longer than the patience lasts.
        """
        if self._refusal is not None:
            raise self._refusal
        if self._socket is None and not self._open(wait):
            return []
        messages: list[Message] = []
        try:
            while self._socket is not None and len(messages) < MOST_WAITING:
                messages.append(_read(self._socket.recv(timeout=0 if messages else wait)))
        except TimeoutError:
            pass
        except ConnectionClosed as closed:
            self._drop(closed)
        if any(isinstance(message, bytes) for message in messages):
            self._good, self._pause = time.monotonic(), FIRST_PAUSE
        return messages

    def _open(self, wait: float) -> bool:
        """Open a socket; return False if it is too early for another attempt, or this one fails."""
        early = self._retry_at - time.monotonic()
        if early > 0:
            time.sleep(min(wait, early))
            return False
        try:
            self._socket = self._closing.enter_context(
                connect(
                    f"{self._address}?{urlencode({'from': self.next, 'slow': self._slow})}",
                    additional_headers={"Authorization": f"Bearer {self._server.key}"},
                    subprotocols=[SUBPROTOCOL],
                    ssl=self._tls,
                    proxy=None if self._server.is_here else True,
                    compression=None,  # 200 bytes of noise a frame: nothing to gain
                    open_timeout=OPEN_SECONDS,
                    close_timeout=CLOSE_SECONDS,
                    ping_interval=PING_SECONDS,
                    ping_timeout=PONG_SECONDS,
                    max_queue=MOST_WAITING,
                )
            )
        except InvalidURI as error:
            raise InvalidInput(f"is not an address of a server: {error}", where=self._server.url) from error
        except InvalidStatus as error:
            self._answered(error)
        except InvalidUpgrade as error:
            raise no_upgrade(101, self._address) from error
        except (OSError, WebSocketException) as error:
            if (final := connection_failure(error, self._server.url)) is not None:
                raise final from error
            self._failed(error, None, "")
        else:
            self.sockets += 1
            self._opened = time.monotonic()
        return self._socket is not None

    def _answered(self, error: InvalidStatus) -> None:
        """Set the time of the next attempt after a refused handshake, by the API or a proxy.

        Raises:
            MareyError: another attempt makes no sense.
        """
        answer = error.response
        status, text = answer.status_code, (answer.body or b"").decode(errors="replace")
        problem = _problem(text)
        if HTTP_TO_HTTPS not in text and (status < 300 or status in NO_UPGRADE):
            raise no_upgrade(status, self._address) from error
        if problem is not None:
            self._failed(error, status, problem)
        elif status < 500 and status not in TEMPORARY:
            raise foreign_answer(status, answer.headers.get, text, self._address) from error
        else:
            self._failed(error, status, "")

    def _drop(self, closed: ConnectionClosed) -> None:
        self._socket = None
        self._closing.close()
        if time.monotonic() - self._opened > STEADY_SECONDS:
            self._good, self._pause = time.monotonic(), FIRST_PAUSE
        code, reason = (closed.rcvd.code, closed.rcvd.reason) if closed.rcvd else (None, "")
        try:
            self._failed(closed, code, reason)
        except MareyError as refusal:
            self._refusal = refusal  # raised after the messages that arrived before it

    def _failed(self, error: Exception, code: int | None, reason: str) -> None:
        """Set the time of the next attempt.

        Raises:
            MareyError: another attempt makes no sense.
        """
        if code is not None and (refusal := _REFUSALS.get(code % 4000)) is not None:
            raise refusal(reason or f"the server refuses the socket ({code})", where=self._address)
        now = time.monotonic()
        if now - self._good > self._patience:
            raise Unreachable(
                f"the stream was out of reach for {self._patience:.0f} s ({reason or error})",
                where=self._address,
                hint="The server ends a stream without viewers after a minute.",
            ) from error
        self._retry_at = now + self._pause * random.uniform(0.8, 1.2)  # noqa: S311
        self._pause = min(self._pause * 2, LONGEST_PAUSE)


def _problem(text: str) -> str | None:
    """Return the detail of a problem of the API; None for any other text."""
    try:
        found = json.loads(text)
    except ValueError:
        return None
    if not isinstance(found, dict):
        return None
    problem = cast("dict[str, Any]", found)
    return str(problem.get("detail")) if str(problem.get("type")).startswith(TYPE_PREFIX) else None


def _read(message: str | bytes) -> Message:
    if isinstance(message, bytes):
        return message
    try:
        found = json.loads(message)
    except ValueError:
        found = None
    read = cast("dict[str, Any]", found) if isinstance(found, dict) else {}
    if not isinstance(read.get("type"), str):
        hint = "client and server are of different releases: update the older one"
        raise InvalidInput(f"the server sent {message[:60]!r}, which is no message", where="stream", hint=hint)
    return read
