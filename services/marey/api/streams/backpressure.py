"""Clients that cannot keep up: how it shows, and the brake that one of them may pull."""

from __future__ import annotations

import math

from marey.api.stream_hub import Hub
from marey.streams.control import Control, ControlQueue

BEHIND_FRAMES = 40
"""Two seconds."""
BLOCKED_SECONDS = 0.05
"""One frame's time: a send that takes longer waits for the client, not for us."""


class LagTracker:
    """How far a client is behind. One that comes late, or comes back, is far behind and not slow: it catches up."""

    def __init__(self) -> None:
        self._best: float = math.inf

    def is_falling_behind(self, behind: int) -> bool:
        """Whether it is two seconds further behind than it was at best.

        Args:
            behind: frames that are there and that it has not.
        """
        self._best = min(self._best, behind)
        return behind > self._best + BEHIND_FRAMES

    def caught_up(self) -> None:
        """It has the newest frame."""
        self._best = 0


class BackpressurePause:
    """Pauses a stream, and lets it go on if it was this that paused it."""

    def __init__(self, hub: Hub, control: ControlQueue) -> None:
        self._hub, self._control = hub, control
        self._pulled = False

    async def engage(self) -> None:
        """Pause, once.

        Raises:
            Unreachable: Redis does not answer.
        """
        if not self._pulled:
            await self._hub.call(lambda: self._control.send(Control("pause")))
            self._pulled = True

    async def release(self) -> None:
        """Go on, if it is pulled; raises as `pull`."""
        if self._pulled:
            await self._hub.call(lambda: self._control.send(Control("resume")))
            self._pulled = False
