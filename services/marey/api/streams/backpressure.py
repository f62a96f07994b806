"""Backpressure for slow clients: detection, and the pause of a stream."""

from __future__ import annotations

import math

from marey.api.stream_hub import Hub
from marey.streams.control import ControlQueue, StreamControl

BEHIND_FRAMES = 40
"""Two seconds."""
BLOCKED_SECONDS = 0.05
"""Duration of one frame: a send that takes longer waits for the client."""


class LagTracker:
    """Tracks how far a client is behind. A client that connects late is far behind and not slow: it catches up."""

    def __init__(self) -> None:
        self._best: float = math.inf

    def is_falling_behind(self, behind: int) -> bool:
        """Return True if the client is two seconds further behind than it was at best.

        Args:
            behind: number of available frames that the client lacks.
        """
        self._best = min(self._best, behind)
        return behind > self._best + BEHIND_FRAMES

    def caught_up(self) -> None:
        """Record that the client has the newest frame."""
        self._best = 0


class BackpressurePause:
    """Pauses a stream, and resumes it if this paused it."""

    def __init__(self, hub: Hub, control: ControlQueue) -> None:
        self._hub, self._control = hub, control
        self._pulled = False

    async def engage(self) -> None:
        """Pause the stream, once.

        Raises:
            Unreachable: Redis does not answer.
        """
        if not self._pulled:
            await self._hub.call(lambda: self._control.send(StreamControl("pause")))
            self._pulled = True

    async def release(self) -> None:
        """Resume the stream, if it was paused here; raises as `engage`."""
        if self._pulled:
            await self._hub.call(lambda: self._control.send(StreamControl("resume")))
            self._pulled = False
