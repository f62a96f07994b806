"""New frames of an edit as a motion of their prompt alone has them: changed and drawn as its words ask.

Between kept frames a network reads a side, a number or a manner as badly as alone. Motions of a prompt are mended, and
many movements are drawn (`marey.generation.asked`, `marey.generation.bearing`). So such a motion is made first; then
the frames that join it to the kept ones are generated without a prompt, as the transitions of timelines are.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from marey.core.errors import InvalidInput
from marey.drawing.kinds import DRAWINGS
from marey.generation.asked import changes_of, drawing_of, draws
from marey.generation.bearing import borne_spans
from marey.generation.bearing_drawing import borne
from marey.generation.drawn_whole import ALONE
from marey.generation.fine import FINE
from marey.generation.port import GenerationControl, Generator, Request, S
from marey.generation.shots.dispatch import generate_any, resolve_request
from marey.generation.shots.timelines import RISE, RISE_SPEED, TimelineMotion
from marey.generation.shots.windows import Float32, FrameGap, crossfaded, fill, most_frames, no_text
from marey.generation.stated import STATED
from marey.generation.timed import CUT_SHARE, TimedText, part_seed
from marey.generation.wish import Wish
from marey.motion.features import FeatureLayout
from marey.text.features import TextFeatures
from marey.vocabulary.courses import STRAIGHT
from marey.vocabulary.scope import STANDING

SHORTEST_S = 1.0
"""Seconds of new frames from which on they are a movement of their own, as rows of timelines are."""
JOIN = 4
"""Frames at an end of the new ones that are generated again, at least: a token. With 8, as in timelines, less of the
movement is left, and jerk is as small (docs/decisions/0037-edits-by-a-model.md)."""
CANCELLED = "the edit was cancelled"
_DRAWN = frozenset({*DRAWINGS, *ALONE, *FINE}) - {STANDING}
"""Actions whose movements are drawn; between other frames a network stands as well."""


@dataclass(frozen=True, eq=False)
class AskedFrames:
    """A motion of a prompt alone.

    Attributes:
        features: (T, D), in the layout's own units.
        changes: as of `AskedMotion`.
    """

    features: Float32 = field(repr=False)
    changes: Mapping[str, Any]


def asks_more(generator: Generator[S], text: TextFeatures, settings: S) -> bool:
    """Return True if words ask for what a network between kept frames does not read, and a motion alone would show."""
    request = Request(text, 0, drawing=drawing_of(generator, settings))
    if not draws(generator, request):
        return False
    wish = Wish.of(request)
    turns = wish.turn is not None and wish.turn.least > 0
    winds = wish.course is not None and wish.course.kind != STRAIGHT
    state = STATED.get(wish.action)
    is_stated = state is not None and state(wish.fine(request), random.Random(0), None) is not None  # noqa: S311
    told = (wish.limb, wish.count, wish.metres, wish.side or None, wish.gaze or None)
    return (
        bool(text.movements)
        or wish.action in _DRAWN
        or is_stated
        or bool(turns or winds or wish.pace.pace or wish.pace.mood)
        or any(each is not None for each in told)
        or bool(borne_spans(request, generator.limits.fps, generator.limits.max_frames))
    )


def frames_alone(
    generator: Generator[S],
    text: TextFeatures,
    seed: int,
    frames: int,
    settings: S,
    *,
    control: GenerationControl | None = None,
) -> AskedFrames:
    """Generate a motion of a prompt alone, changed as its words ask, with the bearings that they name.

    Args:
        frames: of the motion, at the model's rate; 1 or more.

    Raises:
        InvalidInput: features of another encoder, or the edit was cancelled.
    """
    limits = generator.limits
    count = max(frames, limits.min_frames)
    request = Request(text, seed, count, drawing=drawing_of(generator, settings))
    if count > limits.max_frames:
        row = TimedText(0.0, count / limits.fps, text)
        request = replace(request, text=replace(text, movements=()), frames=None, timeline=(row,))
    request = resolve_request(generator, request)
    (made,) = generate_any(generator, [request], settings, control=control)
    if made is None:
        raise InvalidInput(CANCELLED)
    if isinstance(made, TimelineMotion):
        request = replace(request, timeline=made.timeline)
    drawn = made.features
    if draws(generator, request):
        drawn = borne(made, generator.layout, borne_spans(request, limits.fps, len(drawn)))
    whole = np.concatenate([drawn, drawn[-1:].repeat(max(0, frames - len(drawn)), axis=0)])
    return AskedFrames(whole[:frames].astype(np.float32), changes_of(made))


def joined(
    generator: Generator[S],
    before: Float32,
    new: Float32,
    after: Float32,
    seed: int,
    settings: S,
    *,
    control: GenerationControl | None = None,
) -> Float32:
    """Return frames (a, D), (n, D) and (b, D) one behind the other; those of the new ones that are next to others are
    generated again, without a prompt.

    Raises:
        InvalidInput: the edit was cancelled.
    """
    layout, limits = generator.layout, generator.limits
    whole = np.concatenate([before, new, after])
    start, end = len(before), len(before) + len(new)
    first = _cut(before[-1:], new[:1], len(new), layout, limits.keeps) if len(before) else 0
    last = _cut(new[-1:], after[:1], len(new), layout, limits.keeps) if len(after) else 0
    most = most_frames(limits, 2)
    parts = [(start, start + min(first, most)), (end - min(last, most), end)]
    gaps = [
        FrameGap(whole[:a], b - a, whole[b:], no_text(limits.text_width), part_seed(seed, "transition", n), free=True)
        for n, (a, b) in enumerate(parts)
        if a < b
    ]
    for (a, _), window in zip(
        [part for part in parts if part[0] < part[1]], fill(generator, gaps, settings, control=control), strict=True
    ):
        if window is None:
            raise InvalidInput(CANCELLED)
        # A window may end with frames that the others have no place for.
        fitting = replace(window, features=window.features[: len(whole) - a + window.first])
        whole = crossfaded(whole, fitting, a - window.first)
    return whole


def _cut(ends: Float32, begins: Float32, frames: int, layout: FeatureLayout, grid: int) -> int:
    """Return how many of so many new frames lead from one pose to the next: more where a body gets up or goes down."""
    heights = [float(layout.decode(each)[0, 0, 1]) for each in (ends, begins)]
    rise = abs(heights[1] - heights[0])
    needed = round(rise / RISE_SPEED * layout.fps) if rise > RISE else 0
    return max(-(-JOIN // grid) * grid, min(needed, frames // CUT_SHARE) // grid * grid)
