"""Notification of live workers about a new stream, ahead of their next poll of the rows.

A counter that workers compare twenty times a second. A worker that misses a change, or has no Redis for a moment,
finds the row half a second later; nothing else depends on it.
"""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
from __future__ import annotations

from typing import Any

import redis

from marey.streams.redis import reached

KEY = "marey:streams:begun"


class StreamNotifier:
    """One end of the notification channel.

    Args:
        client: as for `FrameStream`.
    """

    def __init__(self, client: redis.Redis) -> None:
        self._redis: Any = client
        self._heard: bytes | None = None

    def notify(self) -> None:
        """Notify workers of a waiting stream, after its row is committed.

        Raises:
            Unreachable: Redis does not answer.
        """
        with reached("any"):
            self._redis.incr(KEY)

    def poll(self) -> bool:
        """Return True if there was a notification since this end's last poll.

        Raises:
            Unreachable: Redis does not answer.
        """
        with reached("any"):
            count = self._redis.get(KEY)
        rang = count != self._heard
        self._heard = count
        return rang
