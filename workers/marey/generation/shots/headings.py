"""Turns of sequences that turn as far as they were drawn, after they are joined to the movements beside them.

Transitions between rows are made by a network, which turns the body as it likes. Here the difference between the
directions before and after a turn is measured in the whole motion, and what is missing is added to the turn, so that
who turns around comes back on the same line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from marey.generation.turned import bent_along
from marey.motion.courses import Course, carried, natural_course
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.filters import smoothstep
from marey.motion.kinematics import facing
from marey.motion.rotations import Array

Float32 = NDArray[np.float32]

NEAR = 1.5
"""Degrees by which a turn may differ."""
MOST = 100.0
"""Degrees that are added to a turn at most: more are no error of its transitions."""
LOOKS_S, AHEAD_S = 0.8, 1.6
"""Seconds of the movements beside a turn in which their direction is measured, and of a way after it."""
GOES_M, ALIKE = 0.3, 40.0
"""Metres from which a body goes somewhere, and degrees from its heading within which it goes ahead."""


@dataclass(frozen=True)
class JoinedTurn:
    """A turn between two movements of a sequence.

    Attributes:
        before: frame at which the movement before it ends.
        begin, end: frames of the turn and of both its transitions.
        degrees: by which it turns, positive to the left.
        follows: what comes after it goes straight on.
        runs: it is part of a run, whose feet hardly stand: they are turned with the body.
    """

    before: int
    begin: int
    end: int
    degrees: float
    follows: bool = False
    runs: bool = False


def heading_change(features: Float32, layout: FeatureLayout) -> float:
    """Return the degrees from the first frame of features (T, D) to the last, positive to the left."""
    ahead = facing(layout.decode(features).astype(np.float64), layout.skeleton)
    headings = np.unwrap(np.arctan2(ahead[:, 0], ahead[:, 2]))
    return float(np.degrees(headings[-1] - headings[0]))


def with_whole_turns(features: Float32, layout: FeatureLayout, turns: Sequence[JoinedTurn]) -> Float32:
    """Return features (T, D) of a sequence whose turns turn as far as is asked for, measured from the direction of the
    movement before to that of the movement after.

    Args:
        features: of the whole, in the layout's own units.
        layout: of the features.
        turns: those of the sequence, in their order.
    """
    joints, fps = layout.decode(features).astype(np.float64), layout.fps
    for runs in (False, True):
        natural = natural_course(joints, layout.skeleton, fps)
        added = np.zeros(len(joints))
        for turn in turns:
            if turn.runs == runs:
                added += _missing(natural, turn, fps)
        wanted = natural.facing(natural.headings + added)
        if not added.any():
            continue
        if runs:
            joints = carried(joints, natural, wanted, np.arange(len(joints), dtype=np.float64))
        else:
            joints = bent_along(joints, layout, natural, wanted)
        features = encode_all(layout, joints)
    return features


def _missing(natural: Course, turn: JoinedTurn, fps: float) -> Array:
    """Return the radians (T,) that are missing to a turn, as they are added to it; 0 where too many are."""
    comes = _direction(natural, max(turn.before - round(LOOKS_S * fps), 0), turn.before) if turn.before else None
    ahead = round((AHEAD_S if turn.follows else LOOKS_S) * fps)
    goes = _direction(natural, turn.end, min(turn.end + ahead, len(natural.headings)))
    first = natural.headings[0] if comes is None else comes
    last = natural.headings[-1] if goes is None else goes
    missing = np.radians(turn.degrees) - (last - first)
    if not np.radians(NEAR) < abs(missing) < np.radians(MOST):
        return np.zeros(len(natural.headings))
    return missing * _share(natural.headings, turn.begin, turn.end)


def _direction(course: Course, begin: int, end: int) -> float | None:
    """Return the direction in which a body moves ahead between two frames, or its heading where it does not, radians;
    None without a frame between."""
    if end <= begin:
        return None
    heading = float(course.headings[begin:end].mean())
    step = course.places[end - 1] - course.places[begin]
    aside = np.arctan2(step[0], step[1]) - heading
    aside = float((aside + np.pi) % (2 * np.pi) - np.pi)
    return heading + aside if np.linalg.norm(step) > GOES_M and abs(aside) < np.radians(ALIKE) else heading


def _share(headings: Array, begin: int, end: int) -> Array:
    """Return how much of a turn between two frames is done (T,): as it turns, and evenly."""
    last = min(end, len(headings) - 1)
    passed = np.abs(np.diff(headings, prepend=headings[:1]))
    passed[: begin + 1], passed[last + 1 :] = 0.0, 0.0
    even = smoothstep(np.clip((np.arange(len(headings)) - begin) / max(last - begin, 1), 0.0, 1.0))
    if passed.sum() < 1e-6:
        return even
    return 0.7 * np.cumsum(passed) / float(passed.sum()) + 0.3 * even
