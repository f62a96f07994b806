"""Following jobs and evaluations until they end, through restarts of the server and lost connections."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from typing import Any

from marey.client.transport import PATIENCE, Transport
from marey.client.types.evaluations import OPEN_EVALUATION
from marey.client.types.jobs import ENDED_JOB
from marey.core.errors import Busy, TimedOut, Unreachable

View = dict[str, Any]
SILENCE = 30.0
"""Seconds an open connection may stay silent: the server pings every 15 s."""
RETRY_SECONDS = 0.5
POLL = 1.0
"""Seconds between two requests: an evaluation takes minutes, and the scheduler checks it every two seconds."""


def follow_job(
    transport: Transport,
    job: str,
    *,
    timeout: float | None = None,
    hint: str | None = None,
) -> Generator[tuple[View, View | None], None, View]:
    """Yield the job, then its events as they happen, until it has ended; return the ended job.

    A connection that breaks is opened again.

    Args:
        timeout: seconds; None = no limit.
        hint: of `TimedOut`.

    Raises:
        TimedOut: `timeout` passed; the job continues.
        Unreachable: the server was away for longer than `PATIENCE`.
    """
    deadline = None if timeout is None else time.monotonic() + timeout

    def allowed_silence() -> float:
        """Return the seconds that the connection may stay silent; raise `TimedOut` when no time is left."""
        if deadline is None:
            return SILENCE
        left = deadline - time.monotonic()
        if left <= 0:
            raise TimedOut("the time allowed has passed; the job goes on", where=f"job {job}", hint=hint)
        return min(SILENCE, left)

    state = transport.get(f"/v1/jobs/{job}")
    seen, reachable = 0, time.monotonic()
    yield state, None
    while state["state"] not in ENDED_JOB:
        try:
            for event in transport.events(job, after=seen, patience=allowed_silence()):
                seen = event["seq"]
                reachable = time.monotonic()
                yield state, event
                allowed_silence()
            state = transport.get(f"/v1/jobs/{job}")
            reachable = time.monotonic()
        except Busy as error:  # the key has no event stream left: poll instead
            time.sleep(min(error.seconds, allowed_silence()))
            state = transport.get(f"/v1/jobs/{job}")
            reachable = time.monotonic()
        except Unreachable:
            if time.monotonic() - reachable > PATIENCE:
                raise
            time.sleep(RETRY_SECONDS)
        yield state, None
    return state


def follow_evaluation(
    transport: Transport,
    evaluation: str,
    *,
    timeout: float | None = None,
    hint: str | None = None,
    look: Callable[[View], None],
) -> View:
    """Call `look` with the evaluation about once a second until it has ended, and return it.

    Raises:
        TimedOut: `timeout` passed; the evaluation continues.
        Unreachable: the server was away for longer than `PATIENCE`.
    """
    deadline = None if timeout is None else time.monotonic() + timeout
    reachable = time.monotonic()
    while True:
        try:
            found = transport.get(f"/v1/evaluations/{evaluation}")
            reachable = time.monotonic()
            look(found)
            if found["state"] not in OPEN_EVALUATION:
                return found
        except Unreachable:
            if time.monotonic() - reachable > PATIENCE:
                raise
        left = POLL if deadline is None else deadline - time.monotonic()
        if left <= 0:
            raise TimedOut(
                "the time allowed has passed; the evaluation goes on", where=f"evaluation {evaluation}", hint=hint
            )
        time.sleep(min(POLL, left))
