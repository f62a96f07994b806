"""Frame rate and latency of a stream."""

from __future__ import annotations

from collections import deque

WINDOW = 2.0
"""Seconds over which the rate is measured."""


class Pace:
    """The frame rate and latency of a stream, by the clock of the viewer.

    The latency is the age of the newest frame relative to an even schedule: frame n is due n / fps seconds after frame
    0, and the frame that arrived earliest sets the schedule. Between two frames the latency grows from 0 to the length
    of a frame; the rest is delay of the server, the network and this program. The travel time of the earliest frame is
    not included.

    Args:
        fps: frame rate of the stream.
    """

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._zero: float | None = None  # when frame 0 was due
        self._newest = 0
        self._times: deque[float] = deque()

    def arrived(self, number: int, now: float) -> None:
        """Record the arrival of a frame.

        Args:
            now: seconds of a monotonic clock.
        """
        zero = now - number / self._fps
        self._zero = zero if self._zero is None else min(self._zero, zero)
        self._newest = number
        self._times.append(now)
        self._forget(now)

    def rest(self) -> None:
        """Reset the schedule, because the stream is paused or has not started; the next frame sets it again."""
        self._zero = None
        self._times.clear()

    def fps(self, now: float) -> float:
        """Return the frames a second over the last two seconds."""
        self._forget(now)
        if len(self._times) < 2:
            return 0.0
        span = max(now, self._times[-1]) - self._times[0]
        return (len(self._times) - 1) / span if span > 0 else 0.0

    def latency(self, now: float) -> float | None:
        """Return the latency in seconds; None without a schedule."""
        return None if self._zero is None else max(0.0, now - self._zero - self._newest / self._fps)

    def _forget(self, now: float) -> None:
        while self._times and self._times[0] < now - WINDOW:
            self._times.popleft()
