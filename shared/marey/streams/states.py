"""States of live streams, and the table of allowed transitions. A database trigger enforces it too."""

from __future__ import annotations

from enum import StrEnum
from typing import Literal


class StreamState(StrEnum):
    """State of a live stream. `ENDED` and `FAILED` are final."""

    WAITING = "waiting"
    LIVE = "live"
    PAUSED = "paused"
    ENDED = "ended"
    FAILED = "failed"


WaitsFor = Literal["slot", "worker"]
"""Reason of a wait. `slot`: every slot is taken; `worker`: no live worker has loaded the bundle of the stream."""
LIVE_QUEUE = "live"
"""Queue name of live workers in their rows."""

STREAM_TRANSITIONS: dict[StreamState, frozenset[StreamState]] = {
    StreamState.WAITING: frozenset({StreamState.LIVE, StreamState.ENDED, StreamState.FAILED}),
    StreamState.LIVE: frozenset({StreamState.PAUSED, StreamState.ENDED, StreamState.FAILED}),
    StreamState.PAUSED: frozenset({StreamState.LIVE, StreamState.ENDED, StreamState.FAILED}),
    StreamState.ENDED: frozenset(),
    StreamState.FAILED: frozenset(),
}
"""Allowed transitions of streams; the trigger `stream_transition` has the same table."""
OPEN_STREAMS = frozenset({StreamState.WAITING, StreamState.LIVE, StreamState.PAUSED})
"""States of open streams."""
