"""The only place that creates Redis clients: each call has a deadline, and silent connections are dropped."""

# pyright: reportMissingTypeStubs=false, reportUnknownMemberType=false
from __future__ import annotations

import socket
import weakref
from collections.abc import Callable
from typing import Any

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry

from marey.core.errors import Unreachable
from marey.core.versions import check_redis
from marey.runtime.app import CONNECT_TIMEOUT, HEALTH_CHECK_INTERVAL, SOCKET_TIMEOUT

SOCKET_SCHEME = "redis+socket://"


class _OneRetry(Retry):
    """One retry, at once, on a fresh connection; after a missed deadline every idle connection is closed too.

    Connections fall silent together (a proxy or a firewall drops all flows of a host). Found one by one, each would
    cost its next user a deadline. Longer retries are left to the caller, which can report the outage meanwhile.
    """

    def __init__(self, pool: redis.ConnectionPool) -> None:
        super().__init__(NoBackoff(), 1)
        self._pool = weakref.ref(pool)

    def __deepcopy__(self, _memo: dict[int, Any]) -> _OneRetry:
        return self  # redis-py copies it for each connection; it has no per-connection state

    def call_with_retry(
        self,
        do: Callable[[], Any],
        fail: Callable[..., Any],
        is_retryable: Callable[[Exception], bool] | None = None,
        with_failure_count: bool = False,
    ) -> Any:
        """See `redis.retry.Retry`."""

        def failed(error: Exception, *count: int) -> None:
            fail(error, *count)
            pool = self._pool()
            if pool is not None and isinstance(error, redis.TimeoutError | socket.timeout):
                pool.disconnect(inuse_connections=False)

        return super().call_with_retry(do, failed, is_retryable, with_failure_count)


def redis_client(
    queue_url: str,
    *,
    timeout: float = SOCKET_TIMEOUT,
    connect_timeout: float = CONNECT_TIMEOUT,
    max_connections: int | None = None,
) -> redis.Redis:
    """Create a client of `redis://…`, `rediss://…` or `redis+socket:///path` (kombu's spelling; redis-py says
    `unix://`).

    A call on a silent connection is repeated after one deadline on a new connection; if that is silent too, redis-py
    raises its TimeoutError after two. Options in the URL override those given here.

    Args:
        timeout: deadline of each read and write, in seconds; a command that blocks must block for less.
        connect_timeout: deadline of a connect.
        max_connections: of the pool.
    """
    options: dict[str, Any] = {
        "socket_timeout": timeout,
        "socket_connect_timeout": connect_timeout,
        "health_check_interval": HEALTH_CHECK_INTERVAL,
    }
    if max_connections is not None:
        options["max_connections"] = max_connections
    if queue_url.startswith(SOCKET_SCHEME):
        client = redis.Redis.from_url("unix://" + queue_url.removeprefix(SOCKET_SCHEME), **options)
    else:
        # redis-py raises TypeError for keepalive on a Unix socket, hence only here.
        client = redis.Redis.from_url(queue_url, socket_keepalive=True, **options)
    client.set_retry(_OneRetry(client.connection_pool))
    return client


def check_queue(queue_url: str) -> str:
    """Return the version of a Redis that answers and is new enough.

    Raises:
        Unreachable: it does not answer, or refuses the connection.
        Conflict: it is too old.
    """
    try:
        with redis_client(queue_url) as client:
            client.ping()
            info: Any = client.info("server")
    except (redis.RedisError, ValueError) as error:
        hint = "Is it running, and is MAREY_QUEUE_URL (MAREY_STREAMS_URL) right? Embedded: `marey serve` starts it."
        raise Unreachable(f"the queue does not answer ({type(error).__name__}: {error})", hint=hint) from error
    version = str(info.get("redis_version", "unknown"))
    check_redis(version)
    return version
