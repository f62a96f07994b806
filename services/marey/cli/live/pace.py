"""How fast frames come, and how late the newest one is."""

from __future__ import annotations

from collections import deque

WINDOW = 2.0
"""Seconds over which the rate is measured."""


class Pace:
    """The rate and the latency of a stream, by the clock of whoever watches.

    The latency is the age of the newest frame on an even clock: frame n is due n / fps seconds after frame 0, and the
    clock is set by the frame that came earliest. Between two frames it grows from 0 to one frame; what is above that is
    what the server, the network and this program have lost since. It knows nothing of what lies before the clock: the
    time that even the earliest frame was under way.

    Args:
        fps: frames a second of the stream.
    """

    def __init__(self, fps: float) -> None:
        self._fps = fps
        self._zero: float | None = None  # when frame 0 was due
        self._newest = 0
        self._times: deque[float] = deque()

    def arrived(self, number: int, now: float) -> None:
        """A frame is here; `now` in seconds of a clock that does not jump."""
        zero = now - number / self._fps
        self._zero = zero if self._zero is None else min(self._zero, zero)
        self._newest = number
        self._times.append(now)
        self._forget(now)

    def rest(self) -> None:
        """The stream is paused, or does not run yet: the clock stands, and the next frame sets it anew."""
        self._zero = None
        self._times.clear()

    def fps(self, now: float) -> float:
        """Frames a second over the last two."""
        self._forget(now)
        if len(self._times) < 2:
            return 0.0
        span = max(now, self._times[-1]) - self._times[0]
        return (len(self._times) - 1) / span if span > 0 else 0.0

    def latency(self, now: float) -> float | None:
        """Seconds; None while the clock stands."""
        return None if self._zero is None else max(0.0, now - self._zero - self._newest / self._fps)

    def _forget(self, now: float) -> None:
        while self._times and self._times[0] < now - WINDOW:
            self._times.popleft()
