"""Rows of timelines, and transitions between them, while their windows are generated one after another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from marey.generation.port import Limits, Request
from marey.generation.shots.going_on import is_way, passes_over
from marey.generation.shots.headings import heading_change
from marey.generation.shots.levels import lifted
from marey.generation.shots.raised_arms import TURNING
from marey.generation.shots.timeline_plan import TimelinePart, even_parts
from marey.generation.shots.way_lengths import WayRow
from marey.generation.shots.windows import CONTEXT, Float32, FrameGap, Window, crossfaded, most_frames
from marey.generation.timed import TimedText, part_seed
from marey.generation.wish import action_of
from marey.motion.features import FeatureLayout
from marey.text.features import TextFeatures
from marey.vocabulary.bearing_words import stated_bearings
from marey.vocabulary.counts import STEPPING, stated_count
from marey.vocabulary.distances import stated_distance
from marey.vocabulary.scope import STANDING


@dataclass
class Fate:
    """State that all parts of one timeline share while it is generated.

    Attributes:
        drawing: rules may draw its movements.
        dropped: its generation was called off.
    """

    drawing: bool
    dropped: bool = False


class Strand:
    """A part of a timeline while it grows, window by window.

    Attributes:
        fate: of the timeline that it belongs to.
        lengths: frames of each window.
        windows: those that are made.
    """

    def __init__(self, fate: Fate, part: TimelinePart, text: TextFeatures, most: tuple[int, int]) -> None:
        """`most`: frames of a part that is one window, and of each window of a longer one."""
        self.fate = fate
        self.part = part
        self.text = text
        self.windows: list[Window] = []
        self.lengths = even_parts(part.frames, *most)

    @property
    def seed(self) -> int:
        """Return the seed of the next window."""
        number = len(self.windows)
        return self.part.seed if number == 0 else part_seed(self.part.seed, "window", number)

    @property
    def is_last(self) -> bool:
        """Return True if the next window is the last."""
        return len(self.windows) == len(self.lengths) - 1

    @property
    def start(self) -> int:
        """Return the first frame of the next window, in the timeline."""
        return self.part.start + sum(self.lengths[: len(self.windows)])


class RowStrand(Strand):
    """A row: its first window is a motion of the prompt, those after it continue it."""

    def __init__(self, fate: Fate, part: TimelinePart, timed: TimedText, limits: Limits) -> None:
        super().__init__(fate, part, timed.text, (limits.max_frames, limits.max_frames - CONTEXT))
        self.open = timed.open
        self.held = timed.held
        self.beside: tuple[str, str] = ("", "")
        self.features: Float32 | None = None
        self.base = 0.0
        self.changes: Mapping[str, Any] = {}
        self.entered = 0
        self.turn = 0.0

    @property
    def is_drawn(self) -> bool:
        """True if rules draw its movement."""
        return self.open and "drawn" in self.changes

    @property
    def is_trimmed(self) -> bool:
        """True if its rest may be left out: its features show the movement, no gesture is drawn on it later."""
        stated = stated_bearings(self.text.said)
        moves = any(each.bearing.moves for each in stated)  # it is drawn whole, and nothing on it
        waits = not moves and (action_of(self.text) in ("", STANDING) or any(each.bearing.gesture for each in stated))
        is_low = self.held.is_drawn and bool(self.held.begin)  # it has no rest before it goes down
        return self.is_drawn and not (waits or is_low)

    @property
    def goes_on(self) -> bool:
        """True if it is a way, or is drawn as one over something: none of them halts before the next."""
        return is_way(self.text) or (self.is_drawn and passes_over(self.text))

    def as_way(self, layout: FeatureLayout) -> WayRow:
        """Return what the row is for the lengths of ways."""
        action = action_of(self.text)
        turns = self.is_drawn and action in TURNING and self.features is not None
        turn = heading_change(self.features, layout) if turns and self.features is not None else 0.0
        counted = stated_count(self.text.said, action) if action in STEPPING else None
        return WayRow(is_way(self.text), turn, stated_distance(self.text.said, action) if counted is None else None)

    def request(self) -> Request:
        """Return the request of the first window."""
        own_length = self.open and len(self.lengths) == 1
        return Request(
            self.text,
            self.seed,
            self.lengths[0],
            open=own_length,
            beside=self.beside,
            held=self.held,
            drawing=self.fate.drawing,
        )

    def gap(self) -> FrameGap:
        """Return the gap of a window after the first."""
        assert self.features is not None
        return FrameGap(self.features, self.lengths[len(self.windows)], self.features[:0], self.text, self.seed)

    def add(self, window: Window) -> None:
        """Append a window."""
        if self.features is None:
            self.features = window.features
        else:
            grown = np.concatenate([self.features, window.new])
            self.features = crossfaded(grown, window, len(self.features) - window.first)
        self.windows.append(window)


class Transition(Strand):
    """A transition: windows without a prompt; the last one has the frames of the next row behind it."""

    def __init__(
        self, part: TimelinePart, before: RowStrand, after: RowStrand, limits: Limits, layout: FeatureLayout
    ) -> None:
        super().__init__(after.fate, part, after.text, (most_frames(limits, 2), limits.max_frames - CONTEXT))
        assert before.features is not None
        assert after.features is not None
        self._layout, self._base = layout, after.base
        self._before = self._lifted(before.features[: part.start - before.part.start], -self._base)
        self._after = self._lifted(after.features[part.end - after.part.start :], -self._base)

    def _lifted(self, features: Float32, metres: float) -> Float32:
        """Return features (T, D) at another height: networks know bodies on a floor."""
        return lifted(features, metres, self._layout) if metres else features

    def gap(self) -> FrameGap:
        """Return the gap of the next window."""
        made = [window.new for window in self.windows]
        before = np.concatenate([self._before[-CONTEXT:], *made]) if made else self._before
        after = self._after if self.is_last else self._after[:0]
        return FrameGap(before, self.lengths[len(self.windows)], after, self.text, self.seed, free=True)

    def add(self, window: Window) -> None:
        """Append a window."""
        self.windows.append(window)

    def write(self, frames: Float32) -> Float32:
        """Return the frames of the timeline with this transition in them."""
        start = self.part.start
        for window, length in zip(self.windows, self.lengths, strict=True):
            raised = replace(window, features=self._lifted(window.features, self._base))
            frames = crossfaded(frames, raised, start - window.first)
            start += length
        return frames
