"""Limit on the amount of text parsed at once."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from marey.core.errors import Busy

MAX_WORDS = 4000
"""Words in flight in one process: four seconds of one core. A single request may have more."""
RETRY_SECONDS = 2


class Ticket:
    """The share of the limit that one request holds until `release`."""

    def __init__(self, limit: WordLimit, words: int) -> None:
        self._limit, self._words = limit, words

    def release(self) -> None:
        """Give the share back; a second call does nothing."""
        words, self._words = self._words, 0
        self._limit.give_back(words)

    def __enter__(self) -> Ticket:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()


class WordLimit:
    """Counts the words of all requests in flight. Thread-safe."""

    def __init__(self, limit: int = MAX_WORDS) -> None:
        self._limit = limit
        self._words = 0
        self._lock = threading.Lock()

    @property
    def in_flight(self) -> int:
        """Number of words being parsed now."""
        return self._words

    def take(self, prompts: Sequence[str]) -> Ticket:
        """Count the words of a request.

        Raises:
            Busy: with those in flight, they are too many.
        """
        words = sum(max(1, len(prompt.split())) for prompt in prompts)  # split at any white space
        with self._lock:
            if self._words and self._words + words > self._limit:
                raise Busy(
                    "too many prompts are being parsed at this moment",
                    where="prompts",
                    hint="Send them again after the seconds in `Retry-After`, or submit them as a job.",
                    seconds=RETRY_SECONDS,
                )
            self._words += words
        return Ticket(self, words)

    def give_back(self, words: int) -> None:
        """Subtract words of a finished request."""
        with self._lock:
            self._words -= words
