"""New frames of an edit as a motion of their prompt alone has them: changed and drawn as its words ask.

Between kept frames a network reads a side, a number or a manner as badly as alone. Motions of a prompt are mended, and
many movements are drawn (`marey.generation.asked`, `marey.generation.bearing`). So such a motion is made first; then
the frames that join it to the kept ones are generated without a prompt, as the transitions of timelines are.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from marey.core.errors import InvalidInput
from marey.drawing.kinds import DRAWINGS
from marey.generation.asked import changes_of, drawing_of, draws
from marey.generation.bearing import BorneSpan, borne_spans, with_bearing
from marey.generation.bearing_drawing import borne
from marey.generation.drawn_whole import ALONE
from marey.generation.fine import FINE
from marey.generation.port import GenerationControl, Generator, MotionFeatures, Request, S
from marey.generation.shots.dispatch import generate_any, resolve_request
from marey.generation.shots.edit_levels import LevelledFrames, levelled
from marey.generation.shots.levels import CLIMBS, lifted
from marey.generation.shots.lifted_steps import between_stances, with_steps
from marey.generation.shots.provenance import KEY, describe_timeline
from marey.generation.shots.timelines import RISE_SPEED, TimelineMotion
from marey.generation.shots.windows import Float32, FrameGap, crossfaded, fill, most_frames, no_text
from marey.generation.stated import STATED
from marey.generation.timed import CUT_SHARE, TimedText, part_seed
from marey.generation.wish import Wish
from marey.motion.features import FeatureLayout
from marey.quality.postures import RISE
from marey.text.features import TextFeatures
from marey.vocabulary.courses import RUNS, STRAIGHT
from marey.vocabulary.scope import STANDING

SHORTEST_S = 1.0
"""Seconds of new frames from which on they are a movement of their own, as rows of timelines are."""
JOIN = 4
"""Frames at an end of the new ones that are generated again, at least: a token. With 8, as in timelines, less of the
movement is left, and jerk is as small (docs/decisions/0037-edits-by-a-model.md)."""
STEPS = 12
"""Frames in which a body that stands steps into the stance of the new frames, and out of it."""
CANCELLED = "the edit was cancelled"
SINK_SPEED = 1.0
"""Metres a second at which a body goes down to where the new frames begin, or from where they end: faster than it gets
up."""
_DRAWN = frozenset({*DRAWINGS, *ALONE, *FINE}) - {STANDING}
"""Actions whose movements are drawn; between other frames a network stands as well."""


@dataclass(frozen=True, eq=False)
class AskedFrames:
    """A motion of a prompt alone, or one between kept frames.

    Attributes:
        features: (T, D), in the layout's own units; between kept frames, with these.
        changes: what was changed and drawn, and the bearings, as manifests of motions have them.
        before, after: metres by which the kept frames on that side are higher than in their motion.
    """

    features: Float32 = field(repr=False)
    changes: Mapping[str, Any]
    before: float = 0.0
    after: float = 0.0


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
        or wish.action in _DRAWN | CLIMBS | RUNS
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
    drawn, spans = made.features, list[BorneSpan]()
    if draws(generator, request):
        spans = borne_spans(request, limits.fps, len(drawn))
        drawn = borne(made, generator.layout, spans)
    whole = np.concatenate([drawn, drawn[-1:].repeat(max(0, frames - len(drawn)), axis=0)])
    return AskedFrames(whole[:frames].astype(np.float32), _described(made, request, spans, generator))


def _described(
    made: MotionFeatures | TimelineMotion, request: Request, spans: Sequence[BorneSpan], generator: Generator[Any]
) -> dict[str, Any]:
    """Return what was changed and drawn in a motion, and its bearings, as manifests of motions have them."""
    told = dict(changes_of(made))
    if request.timeline is not None:
        lists = generator.bundle.manifest.actions
        told[KEY] = describe_timeline(request, request.timeline, generator.limits, lists)[KEY]
    return with_bearing(told, spans, generator.limits.fps)


def ways(before: Float32, level: LevelledFrames, after: Float32, layout: FeatureLayout, grid: int) -> tuple[int, int]:
    """Return how many of the new frames lead from the kept pose (a, D) before them, and to that (b, D) after them."""
    new, count = level.features, len(level.features)
    here, there = _pelvis(before[-1:], layout, level.before), _pelvis(after[:1], layout, level.after)
    first = _pelvis(new[:1], layout) - here if len(before) else None
    last = there - _pelvis(new[-1:], layout) if len(after) else None
    lead, end = (0 if rise is None else _way(rise, count, layout.fps, grid) for rise in (first, last))
    return lead, end


def joined(
    generator: Generator[S],
    before: Float32,
    level: LevelledFrames,
    after: Float32,
    seed: int,
    settings: S,
    *,
    ends: tuple[int, int],
    control: GenerationControl | None = None,
) -> Float32:
    """Return frames (a, D), the new ones (n, D) and (b, D) one behind the other; new ones that are next to others are
    generated again, without a prompt.

    Args:
        ends: how many, by `ways`.

    Raises:
        InvalidInput: the edit was cancelled.
    """
    layout, limits, new = generator.layout, generator.limits, level.features
    raised = [lifted(before, level.before, layout), new, lifted(after, level.after, layout)]
    cut, start, end = np.concatenate(raised), len(before), len(before) + len(new)
    whole = cut
    most, (first, last) = most_frames(limits, 2), ends
    found = [
        (a, b, number, floor)
        for number, (a, b, floor) in enumerate(
            [
                (start, start + min(first, most), level.floors[0]),
                (end - min(last, most), end, level.floors[1]),
            ]
        )
        if a < b
    ]
    text = no_text(limits.text_width)
    gaps = list[FrameGap]()
    for a, b, number, floor in found:
        own = lifted(whole, -floor, layout)  # networks know bodies on a floor at 0
        gaps.append(FrameGap(own[:a], b - a, own[b:], text, part_seed(seed, "transition", number), free=True))
    for (a, _, _, floor), window in zip(found, fill(generator, gaps, settings, control=control), strict=True):
        if window is None:
            raise InvalidInput(CANCELLED)
        # A window may end with frames that the others have no place for.
        made = window.features[: len(whole) - a + window.first]
        whole = crossfaded(whole, replace(window, features=lifted(made, floor, layout)), a - window.first)
    steps = min(STEPS, len(new) // 2)
    whole = between_stances(whole, layout, cut, [(start, start + steps), (end - steps, end)])
    return with_steps(whole, layout, [(a, b) for a, b, *_ in found])


def _pelvis(features: Float32, layout: FeatureLayout, raised: float = 0.0) -> float:
    """Return the height of the pelvis in the only frame of features (1, D), raised by so many metres; 0 without it."""
    return float(layout.decode(features)[0, 0, 1]) + raised if len(features) else 0.0


def _way(rise: float, frames: int, fps: float, grid: int) -> int:
    """Return how many of so many new frames lead from one pose to the next: more where a body gets up by so many
    metres, or goes down where they are negative."""
    speed = RISE_SPEED if rise > 0 else SINK_SPEED
    needed = round(abs(rise) / speed * fps) if abs(rise) > RISE else 0
    return max(-(-JOIN // grid) * grid, min(needed, frames // CUT_SHARE) // grid * grid)


def frames_between(
    generator: Generator[S],
    before: Float32,
    frames: int,
    after: Float32,
    text: TextFeatures,
    seed: int,
    settings: S,
    *,
    stay: bool = False,
    control: GenerationControl | None = None,
) -> AskedFrames:
    """Return frames (a, D) and (b, D) with so many of a prompt between them, as a motion of it alone has them.

    Where a body has to get up or go down on the way, the motion alone is shorter by that way, so that all of it is
    shown.

    Args:
        stay: the frames after keep their place and height.

    Raises:
        InvalidInput: features of another encoder, or the edit was cancelled.
    """
    layout, grid, fps = generator.layout, generator.limits.keeps, generator.limits.fps
    made = frames_alone(generator, text, seed, frames, settings, control=control)
    level = levelled(before, made.features, after, text, layout, stay=stay)
    ends = ways(before, level, after, layout, grid)
    lead, rest = (max(0, each - JOIN) for each in ends)
    if (lead or rest) and frames - lead - rest >= SHORTEST_S * fps:
        made = frames_alone(generator, text, seed, frames - lead - rest, settings, control=control)
        new = made.features
        padded = np.concatenate([new[:1].repeat(lead, axis=0), new, new[-1:].repeat(rest, axis=0)])
        level = levelled(before, padded, after, text, layout, stay=stay)
    whole = joined(generator, before, level, after, seed, settings, ends=ends, control=control)
    return AskedFrames(whole, made.changes, level.before, level.after)
