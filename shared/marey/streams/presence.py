"""Presence of viewers: a key that API processes renew while a socket is open. A stream without viewers ends."""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
from __future__ import annotations

from typing import Any

import redis

from marey.streams.redis import reached, stream_key

KEEP_MS = 10_000
REFRESH_SECONDS = 3.0  # two refreshes may fail before the key expires


class ViewerPresence:
    """Viewers of one stream.

    Args:
        client: as for `FrameStream`.
        stream: its id.
    """

    def __init__(self, client: redis.Redis, stream: str) -> None:
        self.stream = stream
        self.key = stream_key(stream, "watch")
        self._redis: Any = client

    def refresh(self) -> None:
        """Record an active viewer; call it every 3 s.

        Raises:
            Unreachable: Redis does not answer.
        """
        with reached(self.stream):
            self._redis.set(self.key, b"1", px=KEEP_MS)

    def is_active(self) -> bool:
        """Return True if a viewer was recorded within the last 10 s.

        Raises:
            Unreachable: Redis does not answer.
        """
        with reached(self.stream):
            return bool(self._redis.exists(self.key))
