"""When a request is sent again, and after how many seconds."""

from __future__ import annotations

import random

import httpx2

from marey.client.problems import is_busy, is_quota, retry_seconds

ATTEMPTS = 5
FIRST_PAUSE, LONGEST_PAUSE = 0.25, 8.0
"""Seconds between attempts, doubling with jitter: five attempts give a restarting server about five seconds."""
BUSY_SECONDS = 180.0
"""Seconds to wait in all for a server that is busy; at least `ATTEMPTS` are made."""
RETRIED = frozenset({429, 502, 503, 504})


class RequestRetries:
    """RequestRetries of one request.

    A request without an answer, or with an error of the server, has failed: it is given up after so many failures. An
    answer of a busy server is not a failure: it is waited for as long as the caller's patience lasts.
    """

    def __init__(self, attempts: int | None = None, *, repeatable: bool, patience: float | None) -> None:
        """Begin with the first attempt.

        Args:
            attempts: failures after which the request is given up; None = `ATTEMPTS`. With fewer than `ATTEMPTS` the
                caller wants an answer soon, so that a busy server is not waited for.
            repeatable: the request may be carried out twice; otherwise it is repeated only if it was never sent.
            patience: seconds to wait in all while the server is busy; None = `BUSY_SECONDS`.
        """
        self._attempts = ATTEMPTS if attempts is None else attempts
        self._repeatable = repeatable
        self._patience = BUSY_SECONDS if patience is None else patience
        if self._attempts < ATTEMPTS:
            self._patience = 0.0
        self._pause = FIRST_PAUSE
        self._failures = self._refusals = 0
        self._waited = 0.0

    def after_failure(self, error: httpx2.TransportError) -> float | None:
        """Return the seconds to wait after a request without an answer; None = give up."""
        self._failures += 1
        never_sent = isinstance(error, httpx2.ConnectError | httpx2.ConnectTimeout)
        may_repeat = (self._repeatable or never_sent) and not isinstance(error, httpx2.UnsupportedProtocol)
        return self._next_pause() if may_repeat and self._failures < self._attempts else None

    def after_refusal(self, response: httpx2.Response) -> float | None:
        """Return the seconds to wait after an answer that is an error; None = give up.

        A quota is not waited for: unlike a rate it takes minutes, or an operator.
        """
        if response.status_code not in RETRIED or not self._repeatable or is_quota(response):
            return None
        least = retry_seconds(response)
        if is_busy(response):
            self._refusals += 1
            self._waited += max(self._pause, least)
            again = self._refusals < self._attempts or self._waited < self._patience
        else:
            self._failures += 1
            again = self._failures < self._attempts
        return self._next_pause(least) if again else None

    def _next_pause(self, least: float = 0.0) -> float:
        """Return the current pause with jitter, at least about `least` seconds, and double it for the next time."""
        seconds = max(self._pause, least) * random.uniform(0.8, 1.2)  # noqa: S311
        self._pause = min(self._pause * 2, LONGEST_PAUSE)
        return seconds
