"""Numbers of frames at other rates."""

from __future__ import annotations


def frames_at_rate(frames: int, fps: float, to: float) -> int:
    """Return the number of frames at another rate: the last is not after the last of the given frames.

    Args:
        frames: at `fps`, at least 1.
        fps: frames a second.
        to: frames a second of the result.
    """
    return int((frames - 1) / fps * to + 1e-6) + 1
