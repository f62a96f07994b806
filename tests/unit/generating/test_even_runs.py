"""Runs that lose their beat, and those that do not."""

from __future__ import annotations

import numpy as np

from marey.generation.even_runs import even_run, lost_beats
from marey.motion.features import HUMANML3D_263
from tests.support.bodies import walker

LAYOUT = HUMANML3D_263


def hanging(begin: float, end: float, seconds: float = 5.0) -> np.ndarray:
    """Return features (T, D) of a way whose legs hang still in the air for some time."""
    joints = walker(seconds)
    frames = slice(round(begin * LAYOUT.fps), round(end * LAYOUT.fps))
    joints[frames, :, 1] += 0.2
    return LAYOUT.encode(joints)


def test_a_run_goes_on_with_even_strides_behind_and_before_its_lost_beats() -> None:
    for begin, end in ((0.8, 1.3), (3.0, 3.5)):
        features = hanging(begin, end)
        assert len(lost_beats(features, LAYOUT)) == 1
        even = even_run(features, LAYOUT)
        assert even is not None
        assert len(even) == len(features)
        assert not lost_beats(even, LAYOUT)
        ahead = np.diff(LAYOUT.decode(even)[::10, 0, 2])
        assert ahead.min() > 0.3


def gliding(begin: float, end: float, seconds: float = 5.0) -> np.ndarray:
    """Return features (T, D) of a way in which the body goes on for some time while its legs stand still."""
    joints = walker(seconds)
    first, last = round(begin * LAYOUT.fps), round(end * LAYOUT.fps)
    held = joints[first] - joints[first, 0]
    joints[first:last] = joints[first:last, :1] + held
    return LAYOUT.encode(joints)


def test_a_run_goes_on_with_even_strides_where_its_legs_stood_still() -> None:
    for begin, end in ((0.8, 1.2), (3.0, 3.5)):
        features = gliding(begin, end)
        assert len(lost_beats(features, LAYOUT)) == 1
        even = even_run(features, LAYOUT)
        assert even is not None
        assert len(even) == len(features)
        assert not lost_beats(even, LAYOUT)


def test_a_body_that_stops_has_not_lost_its_beat() -> None:
    joints = walker(4.0)
    joints[60:] = joints[60]
    assert not lost_beats(LAYOUT.encode(joints), LAYOUT)


def test_an_even_run_and_one_that_hardly_is_stay() -> None:
    assert even_run(LAYOUT.encode(walker(4.0)), LAYOUT) is None
    assert even_run(hanging(0.9, 1.5, seconds=2.2), LAYOUT) is None
