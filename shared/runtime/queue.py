"""A plain Redis client on the broker's URL, with the timeouts every client here must have."""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
from __future__ import annotations

import redis

from shared.runtime.app import CONNECT_TIMEOUT, HEALTH_CHECK_INTERVAL, SOCKET_TIMEOUT

SOCKET_SCHEME = "redis+socket://"


def redis_client(queue_url: str) -> redis.Redis:
    """A client of `redis://…`, `rediss://…` or `redis+socket:///path` (kombu's spelling; redis-py says `unix://`)."""
    options = {
        "socket_timeout": SOCKET_TIMEOUT,
        "socket_connect_timeout": CONNECT_TIMEOUT,
        "health_check_interval": HEALTH_CHECK_INTERVAL,
    }
    if queue_url.startswith(SOCKET_SCHEME):
        return redis.Redis.from_url("unix://" + queue_url.removeprefix(SOCKET_SCHEME), **options)
    # redis-py raises TypeError for keepalive on a Unix socket, hence here alone.
    return redis.Redis.from_url(queue_url, socket_keepalive=True, **options)
