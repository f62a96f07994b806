"""Frames of the rows of a timeline, and of the transitions between them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from marey.generation.port import Limits
from marey.generation.timed import TimedText, cut_of, part_seed


@dataclass(frozen=True)
class TimelinePart:
    """Frames of a timeline with one origin: a row, or the transition between two rows.

    Attributes:
        start: first frame.
        end: frame after the last.
        seed: of its first window; windows after it have seeds of their own.
    """

    start: int
    end: int
    seed: int

    @property
    def frames(self) -> int:
        """Return the number of frames."""
        return self.end - self.start


@dataclass(frozen=True)
class TimelinePlan:
    """Frames of the rows and transitions of a timeline."""

    rows: tuple[TimelinePart, ...]
    transitions: tuple[TimelinePart, ...]

    @property
    def frames(self) -> int:
        """Return the frames of the whole."""
        return self.rows[-1].end


def plan_timeline(timeline: Sequence[TimedText], seed: int, limits: Limits) -> TimelinePlan:
    """Return the frames of the rows and transitions of a timeline."""
    times = [(round(row.start * limits.fps), round(row.end * limits.fps)) for row in timeline]
    seeds = [part_seed(seed, "row", n) if row.seed is None else row.seed for n, row in enumerate(timeline)]
    rows = tuple(TimelinePart(*time, own) for time, own in zip(times, seeds, strict=True))
    transitions = tuple(
        _transition(before, after, part_seed(seed, "transition", number), limits.keeps)
        for number, (before, after) in enumerate(pairwise(rows))
    )
    return TimelinePlan(rows, transitions)


def _transition(before: TimelinePart, after: TimelinePart, seed: int, grid: int) -> TimelinePart:
    """Return the frames that are generated without a prompt between two rows: a gap, and the beginning of the row after
    it, if the gap is shorter than that."""
    return TimelinePart(before.end, max(after.start, before.end + cut_of(after.frames, grid)), seed)


def even_parts(frames: int, single: int, most: int) -> list[int]:
    """Return the lengths of windows that make up so many frames, as equal as can be.

    Args:
        frames: of all windows.
        single: most frames of one window that stands alone.
        most: most frames of each of several windows.
    """
    count = 1 if frames <= single else -(-frames // most)
    return [frames * (number + 1) // count - frames * number // count for number in range(count)]


def gaps_of(plan: TimelinePlan) -> Iterator[tuple[int, int]]:
    """Yield the first frame, and the frame after the last, of each gap between rows."""
    return ((before.end, after.start) for before, after in pairwise(plan.rows) if before.end < after.start)
