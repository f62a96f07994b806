"""HTTP by hand, for clients that no library would be: slow, lying, endless."""

from __future__ import annotations

import http.client
import json
import socket
import threading
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

GENEROUS = 60.0
"""Seconds for an answer; no test waits so long where all is well."""


@dataclass(frozen=True)
class RawResponse:
    """Response; `status` 0 = the server closed the connection without an answer."""

    status: int
    headers: dict[str, str]
    body: bytes
    ended: bool
    """The server closed the connection after it."""

    @property
    def problem(self) -> dict[str, Any]:
        """The body as a problem."""
        assert self.headers["content-type"] == "application/problem+json"
        return json.loads(self.body)


class RawClient:
    """One connection."""

    def __init__(self, url: str) -> None:
        address = urlsplit(url)
        assert address.hostname is not None
        self._socket = socket.create_connection((address.hostname, address.port or 80), timeout=GENEROUS)
        self.sent = 0
        """Bytes of `dribble` that the connection took."""

    def __enter__(self) -> RawClient:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, data: bytes) -> None:
        """All of it."""
        self._socket.sendall(data)

    def dribble(self, parts: Iterable[bytes], every: float = 0.0) -> RawResponse:
        """Send part after part, until the server answers or closes; what it answers."""
        stopped = threading.Event()
        sender = threading.Thread(target=self._send_all, args=(parts, every, stopped), daemon=True)
        sender.start()
        try:
            return self.answer()
        finally:
            stopped.set()
            self._socket.close()
            sender.join(GENEROUS)

    def answer(self) -> RawResponse:
        """The next answer, whole."""
        response = http.client.HTTPResponse(self._socket)
        try:
            response.begin()
        except (http.client.BadStatusLine, ConnectionError):
            return RawResponse(0, {}, b"", True)
        headers = {name.lower(): value for name, value in response.getheaders()}
        return RawResponse(response.status, headers, response.read(), self._ended() if response.will_close else False)

    def _ended(self) -> bool:
        try:
            return self._socket.recv(1) == b""
        except ConnectionError:
            return True

    def _send_all(self, parts: Iterable[bytes], every: float, stopped: threading.Event) -> None:
        try:
            for part in parts:
                self._socket.sendall(part)
                self.sent += len(part)
                if stopped.wait(every):
                    return
        except OSError:
            return  # the server has closed; `answer` says with what
