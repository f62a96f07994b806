"""Rate limits by key and class of request, counted in Redis so that all API processes share them."""

# pyright: reportMissingTypeStubs=false
from __future__ import annotations

import math
import threading
import time

import structlog
from limits import RateLimitItemPerSecond
from limits.errors import StorageError
from limits.storage import RedisStorage
from limits.strategies import SlidingWindowCounterRateLimiter

from marey.core.errors import Busy
from marey.core.rates import RateLimit, read_rate
from marey.core.settings import Settings
from marey.runtime.queue import redis_client
from marey.tenants import ApiKey

TIMEOUT = 0.5
"""Seconds to wait for Redis: a counter is worth less than its request, which then proceeds uncounted."""
AWAY_SECONDS = 5.0
"""Circuit breaker: skip Redis for 5 s after an error, so that requests do not wait for it one after the other."""
PREFIX = "marey:rate"

log = structlog.get_logger(__name__)


class RateLimiter:
    """Rate limiter, one per process; connects lazily.

    While Redis is down requests are served uncounted, with a log line: rate limits only keep a looping script from
    crowding out other clients; quotas, which protect costly resources, are stored in the database.
    """

    def __init__(self, config: Settings) -> None:
        self._rates = {kind: read_rate(text, where=kind) for kind, text in config.rates.items()}
        self._client = self._limiter = None
        if config.queue_url is not None:
            url = config.queue_url.get_secret_value()
            client = self._client = redis_client(url, timeout=TIMEOUT, connect_timeout=TIMEOUT)
            pool = client.connection_pool
            storage = RedisStorage("redis://", connection_pool=pool, key_prefix=PREFIX, wrap_exceptions=True)
            self._limiter = SlidingWindowCounterRateLimiter(storage)
        self._lock = threading.Lock()
        self._again = 0.0  # time of the next attempt after an error
        self._away = False

    def take(self, key: ApiKey, kind: str) -> None:
        """Count one request of a class.

        Raises:
            Busy: the limit of the current window is exceeded.
        """
        rate = self._rate(key, kind)
        if rate is None or self._limiter is None or time.monotonic() < self._again:
            return
        item = RateLimitItemPerSecond(rate.amount, rate.seconds)
        try:
            allowed = self._limiter.hit(item, str(key.id), kind)
            seconds = (
                0.0 if allowed else self._limiter.get_window_stats(item, str(key.id), kind).reset_time - time.time()
            )
        except StorageError as error:
            self._lose(error)
            return
        self._find()
        if not allowed:
            raise Busy(
                f"rate limit exceeded: {rate.amount} {kind} requests in {rate.seconds} s",
                where=f"rate {kind}",
                hint="Send it again after the seconds in `Retry-After`.",
                seconds=max(math.ceil(seconds), 1),
            )

    def close(self) -> None:
        """Close the connections."""
        if self._client is not None:
            self._client.close()

    def _rate(self, key: ApiKey, kind: str) -> RateLimit | None:
        own = key.rates.get(kind)
        return self._rates.get(kind) if own is None else read_rate(own, where=kind)

    def _lose(self, error: Exception) -> None:
        with self._lock:
            self._again = time.monotonic() + AWAY_SECONDS
            if not self._away:
                log.warning("rates_uncounted", error=type(error.__cause__ or error).__name__)
            self._away = True

    def _find(self) -> None:
        if self._away:
            with self._lock:
                self._away = False
            log.info("rates_counted_again")
