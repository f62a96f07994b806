"""Loads that are lifted in one movement of a sequence and put down in a later one, and held in all between.

Networks know carrying as a walk, and each movement begins with arms of its own: at the seams the hands let go. A lift
and a put-down of a load for two hands are drawn (`marey.drawing.loads`), and from the one to the other the arms hold it
before the belly, whatever the movements between make of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.generation.carrying import WALKS
from marey.generation.timed import CUT, TimedText
from marey.generation.wish import action_of
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.filters import smooth_seconds
from marey.motion.skeleton import HUMANML3D
from marey.posing.standing import ARMS, StandingBody
from marey.vocabulary.bearings import UPRIGHT, load_bearings
from marey.vocabulary.loads import lifts_load, puts_load

Array = NDArray[np.floating]
Float32 = NDArray[np.float32]

_FADES_S, _NEAR_M = 0.1, 0.13
"""Standard deviation of the filter by which the arms pass into their hold, seconds, and metres from there up to which
the hands of a lift or a put-down are at the load."""


def with_load(features: Float32, layout: FeatureLayout, rows: Sequence[TimedText]) -> Float32:
    """Return features (T, D) of a sequence in which the hands hold a load from its lift to where it is put down.

    Args:
        features: of the whole sequence, in the layout's own units.
        layout: of the features.
        rows: of its timeline.
    """
    runs = _held_rows(rows)
    if not runs or layout.skeleton.name != HUMANML3D.name:
        return features
    body = StandingBody(layout.decode(features).astype(np.float64))
    pose = load_bearings()["box-carried"].arms
    bones = {side: _held(body, side, pose[side].hand, pose[side].elbow) for side in ARMS}
    away = np.max([_away(body, side, pose[side].hand) for side in ARMS], axis=0)
    held = np.zeros(len(features))
    for first, last in runs:
        held[_begins(rows[first], away, layout.fps) : _ends(rows[last], away, layout.fps)] = 1.0
    share = np.clip(smooth_seconds(held, _FADES_S, layout.fps), 0.0, 1.0)
    for side, (upper, fore) in bones.items():
        body.move_arm(side, share, upper, fore, lag=0.0, straight=True)
    return encode_all(layout, body.solved())


def _held_rows(rows: Sequence[TimedText]) -> list[tuple[int, int]]:
    """Return the first and the last movement of each load that is held: its lift, and where it is put down, or the last
    one on the feet in which the arms have nothing else to do."""
    runs, number = list[tuple[int, int]](), 0
    while number < len(rows):
        if not lifts_load(rows[number].text.said):
            number += 1
            continue
        last = number
        for later in range(number + 1, len(rows)):
            if puts_load(rows[later].text.said, rows[later - 1].text.said):
                last = later
                break
            if action_of(rows[later].text) not in UPRIGHT:
                break
            last = later
        if last > number:
            runs.append((number, last))
        number = last + 1
    return runs


def _begins(row: TimedText, away: Array, fps: float) -> int:
    """Return the frame of a lift from which on the hands have the load before the belly."""
    begin, end = round(row.start * fps), min(round(row.end * fps), len(away))
    there = np.flatnonzero(away[begin:end] > _NEAR_M)
    return begin + int(there[-1]) + 1 if len(there) and there[-1] < end - begin - 1 else end - 1


def _ends(row: TimedText, away: Array, fps: float) -> int:
    """Return the frame at which the hands take the load away from the belly; the last one of a row that holds on."""
    begin, end = round(row.start * fps), min(round(row.end * fps), len(away))
    if not puts_load(row.text.said, WALKS):
        return end
    left = np.flatnonzero(away[begin + CUT : end] > _NEAR_M)
    return begin + CUT + (int(left[0]) if len(left) else 0)


def _held(body: StandingBody, side: str, hand: Sequence[float] | None, elbow: Sequence[float]) -> tuple[Array, Array]:
    """Return the directions (T, 3) of upper arm and forearm that hold a load."""
    target = body.from_shoulder(side, body.joints[:, 0]) + np.asarray(hand)
    return body.reach(side, target, elbow)


def _away(body: StandingBody, side: str, hand: Sequence[float] | None) -> Array:
    """Return the metres (T,) of a wrist from where it holds a load."""
    wrist = body.from_shoulder(side, body.joints[:, ARMS[side][3]])
    return np.linalg.norm(wrist - body.from_shoulder(side, body.joints[:, 0]) - np.asarray(hand), axis=-1)
