"""When a bearing is seen in a motion, and how much of it: held all along, or made once as a gesture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from marey.generation.bearing import BorneSpan
from marey.generation.done import AGAIN_HELD, BEGINS_S, FALL, PACES, raised_s
from marey.generation.gaits import STAMP_S
from marey.motion.filters import smooth_seconds
from marey.posing.standing import envelope
from marey.vocabulary.bearings import (
    Bearing,
    StatedBearing,
    load_bearings,
)
from marey.vocabulary.lengths import stated_length

Array = NDArray[np.floating]

PASSES_S = 0.25
"""Standard deviation of the filter by which a body passes into a bearing in the middle of a motion, seconds."""
BROUGHT_S = 0.8
"""Seconds before arms are brought to their place, and after they have left it."""
FACE_S, STANDS = 0.5, frozenset({"idle"})
"""Seconds before hands that are held at the face come there, in a motion of their own, and the actions of such ones."""
DOWN_S = 1.1
"""Seconds in which who sits or kneels down comes there, before hands go to the face."""
LATEST_S = 1.1
"""Seconds before a gesture at most."""
MOVES_FIRST, LATE = frozenset({"sit-down", "stand-up", "sit-floor", "kneel"}), 0.5
"""Actions that are done before a gesture, and the share of the motion that they take."""
GOLDEN = 0.618
"""Share of the bounds of paces by which they differ from seed to seed."""
LEAST = 2
"""Strokes of a gesture of which no number is stated, at least."""
EDGE_S, THERE = 0.15, 0.86
"""Seconds before and after a gesture at least, and the share of the seconds in which a hand comes to its place from
which on it makes strokes."""


@dataclass(frozen=True)
class BearingAmounts:
    """How much of a bearing there is, 0 to 1 (T,): on trunk and head, on the arms, and on hips and legs.

    Attributes:
        done: seconds (T,) of its strokes or keys that are done at each frame; None = it goes on and on.
        times: rounds through its keys.
    """

    trunk: Array
    arms: Array
    legs: Array
    done: Array | None = None
    times: int = 1


def amounts_of_bearings(
    spans: Sequence[BorneSpan], frames: int, fps: float
) -> Iterator[tuple[StatedBearing, BearingAmounts, np.random.Generator]]:
    """Yield each bearing with how much of it there is, in the order of the vocabulary."""
    names = {each.name: each for span in spans for each in span.stated}
    for name in sorted(names, key=list(load_bearings()).index):
        having = [(span, each) for span in spans for each in span.stated if each.name == name]
        rng = np.random.default_rng([having[0][0].seed, having[0][0].begin, len(name)])
        for span, each in having:
            if each.is_done:
                filled = _filling(span, each, fps)
                way, done = _once(span, filled, frames, fps, rng)
                legs = way if each.shown_in(span.action) == "body" else np.zeros(frames)
                yield each, BearingAmounts(way, way, legs, done, filled.times or 1), rng
        having = [(span, each) for span, each in having if not each.is_done]
        if not having:
            continue
        held = {"body": np.zeros(frames), "upper": np.zeros(frames), "trunk": np.zeros(frames)}
        for span, each in having:
            begin, end = _held_in(span, each, fps, goes_on=any(other.end == span.begin for other, _ in having))
            held[each.shown_in(span.action) or "trunk"][begin:end] = 1.0
        legs, arms, trunk = (
            np.clip(smooth_seconds(mask, PASSES_S, fps), 0.0, 1.0)
            for mask in (held["body"], held["body"] + held["upper"], held["body"] + held["upper"] + held["trunk"])
        )
        yield having[-1][1], BearingAmounts(trunk, arms, legs), rng


def _held_in(span: BorneSpan, stated: StatedBearing, fps: float, *, goes_on: bool) -> tuple[int, int]:
    """Return the first frame in which a bearing is held in a part of a motion, and the one after the last: arms that
    are brought to their place come there after a moment, or what is done first, and those that come down do so before
    the end. `goes_on`: it is held in the part before."""
    frames, moment = span.end - span.begin, round(BROUGHT_S * fps)
    begin, end = span.begin, span.end
    at_face = span.free and not stated.whole and span.action in STANDS and _is_at_face(stated.bearing)
    if at_face and not goes_on:  # a body stands with hanging arms before and after
        begin, end = begin + min(round(FACE_S * fps), frames // 4), end - min(moment, frames // 4)
    elif span.action in MOVES_FIRST and (stated.is_brought or stated.bearing.work):
        begin += round(LATE * frames)
    elif span.action in MOVES_FIRST and _is_at_face(stated.bearing) and not (stated.whole or goes_on):
        begin += round(min(LATE * frames, DOWN_S * fps))
    elif stated.is_brought and not goes_on:
        begin += min(moment, frames // 2)
    if stated.times is not None and stated.bearing.gait == "stomp":
        begin, end = begin + round(BEGINS_S * fps), end - round((BEGINS_S + PASSES_S) * fps)
        end = max(min(end, begin + round((stated.times * STAMP_S + BEGINS_S) * fps)), begin + 1)
    if stated.ends:
        end -= min(moment + round(PASSES_S * fps), frames // 4)
    return begin, end


def _is_at_face(bearing: Bearing) -> bool:
    """Return True if a hand is held at the head all the time."""
    return any(pose.at == "head" and not pose.path for pose in bearing.arms.values())


def _filling(span: BorneSpan, stated: StatedBearing, fps: float) -> StatedBearing:
    """Return a gesture that is alone in a part of a stated length with as many strokes, or held as long, as fill it."""
    bearing, asked = stated.bearing, stated.times is not None or stated.hold_s is not None
    if asked or not bearing.gesture or len(span.gestures) > 1 or span.action in MOVES_FIRST:
        return stated
    if stated_length(span.said).seconds is None:
        return stated
    rise = raised_s(bearing)
    room = (span.end - span.begin) / fps - rise - (bearing.fall_s or FALL * rise) - 2 * EDGE_S
    if not bearing.strokes_s(1):
        return replace(stated, hold_s=max(room, bearing.hold_s[0]))
    rounds = int((room + bearing.returns_s) / (bearing.strokes_s(2) - bearing.strokes_s(1)))
    return replace(stated, times=max(rounds, 1))


def _once(
    span: BorneSpan, stated: StatedBearing, frames: int, fps: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Return how much of a gesture there is, 0 to 1 (T,), and the seconds (T,) of its strokes or keys that are done: it
    is made in its share of the span, of one who sits down or stands up at the end of it.

    Strokes are as many as are stated, and whole ones otherwise. Of gestures without strokes the number says how often
    they are made.
    """
    bearing, count = stated.bearing, len(span.gestures)
    at = [each.name for each in span.gestures].index(stated.name)
    first = span.begin + (LATE * (span.end - span.begin) if span.action in MOVES_FIRST else 0.0)
    begin, end = (first + (span.end - first) * share / count for share in (at, at + 1))
    seconds, rise, hold = (end - begin) / fps, raised_s(bearing), stated.hold_s or rng.uniform(*bearing.hold_s)
    fall, pace = bearing.fall_s or FALL * rise, PACES[0] + (PACES[1] - PACES[0]) * (GOLDEN * span.seed % 1.0)
    again = stated.times if stated.times is not None and not bearing.strokes_s(1) else 1
    through = bearing.strokes_s(stated.times or (1 if bearing.keys else max(round(hold * bearing.stroke_hz), LEAST)))
    if through:
        hold = through / pace if stated.times or not bearing.keys else max(hold, through / pace)
        room = max(seconds - rise - fall - 2 * EDGE_S, 0.3 * hold)
        hold, pace = min(hold, room), pace * max(hold / room, 1.0)
    elif again > 1:
        hold *= AGAIN_HELD
        fast = min(1.0, (seconds - 2 * EDGE_S) / (again * (rise + hold + fall)))
        rise, hold, fall = rise * fast, hold * fast, fall * fast
        once, start = rise + hold + fall, max((seconds - again * (rise + hold + fall)) / 2, 0.0)
        ways = [envelope(frames, begin / fps + start + number * once, rise, hold, fall) for number in range(again)]
        return np.max(ways, axis=0), np.maximum(np.arange(frames) / fps - begin / fps - start - rise, 0.0)
    fast = min(1.0, seconds / (rise + fall + (hold if through else 0.6 * hold)))
    rise, fall = rise * fast, fall * fast
    if not through:
        hold = min(hold, max(seconds - rise - fall - 2 * BEGINS_S, 0.5 * hold * fast))
    left = (seconds - rise - fall - hold) / 2
    start = max(min(rng.uniform(BEGINS_S, LATEST_S), left), 0.0)
    start += begin / fps
    since = np.maximum(np.arange(frames) / fps - start - THERE * rise, 0.0)
    return envelope(frames, start, rise, hold, fall), np.minimum(pace * since, through) if through else since
