"""Repetitions of an action in a motion: a table with one line for each action that can be counted."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from marey.checks.kinematics import ANKLES, HEAD, WRISTS, swings, trunk_up, velocity
from marey.motion.feet import runs
from marey.motion.filters import smooth_seconds
from marey.selector.motion import OFF_FLOOR, UP, Array, Motion
from marey.vocabulary.counts import STEPPING

LOW = 0.35
"""Share of a rise up to which a repetition has not begun, and from which on it is over on the way back."""
STANDS, LEAST_STEP = 0.6, 0.15
"""Speed under which a foot stands, m/s, and metres from a place of a foot to the next one."""


class Repetition(NamedTuple):
    """The frames in which an action is done once.

    Attributes:
        begin: first frame.
        end: frame after the last; the number of frames where the motion ends before.
    """

    begin: int
    end: int


def _rises(values: Array, least: float) -> Iterator[tuple[int, Repetition]]:
    """Yield the frame of each top of a signal (T,) after a rise of at least `least`, and the frames around it."""
    turns = swings(values, least)
    for number, (bottom, top) in enumerate(pairwise(turns)):
        if values[top] <= values[bottom]:
            continue
        after = turns[number + 2] if number + 2 < len(turns) else len(values) - 1
        up, down = (values[top] - (1 - LOW) * (values[top] - values[low]) for low in (bottom, after))
        before = np.flatnonzero(values[bottom:top] <= up)
        behind = np.flatnonzero(values[top : after + 1] <= down) if values[after] <= values[top] - least else []
        yield (
            top,
            Repetition(bottom + int(before[-1]) + 1, top + int(behind[0]) if len(behind) else len(values)),
        )


def _tops(values: Array, least: float) -> list[Repetition]:
    return [repetition for _, repetition in _rises(values, least)]


def _merged(parts: Iterable[Iterable[Repetition]], nearest: float) -> list[Repetition]:
    """Return repetitions of several limbs in order, without those that begin less than `nearest` frames after
    another."""
    found = list[Repetition]()
    for each in sorted(each for part in parts for each in part):
        if not found or each.begin - found[-1].begin >= nearest:
            found.append(each)
    return found


def _flights(m: Motion) -> list[Repetition]:
    feet, around = m.feet.min(axis=1), round(0.1 * m.fps)
    return [
        Repetition(max(begin - around, 0), min(end + around, m.frames))
        for begin, end in runs(feet > OFF_FLOOR)
        if begin and end < m.frames and end - begin >= 0.08 * m.fps and feet[begin:end].max() >= 0.06
    ]


def _steps(m: Motion) -> list[Repetition]:
    """A foot lifted, and set down elsewhere."""

    def of(k: int) -> Iterator[Repetition]:
        stands = (m.step_speed[:, k] < STANDS) & (m.feet[:, k] < 0.08)
        places = m.joints[:, ANKLES[k]] * [1, 0, 1]
        spans = [(begin, end) for begin, end in runs(stands) if end - begin >= 0.1 * m.fps or not begin]
        for (_, lifted), (landed, _) in pairwise(spans):
            if np.linalg.norm(places[landed] - places[lifted - 1]) >= LEAST_STEP:
                yield Repetition(lifted, landed)

    return sorted((*of(0), *of(1)), key=lambda step: step.end)


def _bows(m: Motion) -> list[Repetition]:
    return _tops(smooth_seconds(m.lean, 0.1, m.fps), 15)


def _squats(m: Motion) -> list[Repetition]:
    return _tops(-smooth_seconds(m.hips, 0.1, m.fps), 0.2)


def _kicks(m: Motion) -> list[Repetition]:
    feet = smooth_seconds(m.feet, 0.05, m.fps)
    return _merged(([r for f, r in _rises(feet[:, k], 0.25) if feet[f, k] > 0.35] for k in (0, 1)), 0.1 * m.fps)


def _thrusts(m: Motion) -> list[Repetition]:
    """A fist shot out ahead."""
    far = smooth_seconds(np.linalg.norm(m.reach, axis=-1), 0.03, m.fps)
    fast = round(0.3 * m.fps)

    def of(k: int) -> Iterator[Repetition]:
        for top, each in _rises(far[:, k], 0.12):
            if m.hand_speed[max(top - fast, 0) : top + 1, k].max() >= 2.0 and m.hands[top, k, 0] > 0.2:
                yield each

    return _merged((of(0), of(1)), 0.1 * m.fps)


def _claps(m: Motion) -> list[Repetition]:
    gap = smooth_seconds(np.linalg.norm(m.joints[:, WRISTS[0]] - m.joints[:, WRISTS[1]], axis=-1), 0.03, m.fps)
    return [each for frame, each in _rises(-gap, 0.05) if gap[frame] < 0.25]


def _raised(m: Motion) -> list[Repetition]:
    """A hand raised; of two hands, those of the busier one."""
    heights = smooth_seconds(m.hands[..., 1], 0.1, m.fps)
    return max(([r for f, r in _rises(heights[:, k], 0.3) if heights[f, k] > -0.1] for k in (0, 1)), key=len)


def _waves(m: Motion) -> list[Repetition]:
    """A lifted hand swung to one side and back; of two hands, those of the busier one."""
    lifting = np.abs(velocity(smooth_seconds(m.hands[..., 1], 0.15, m.fps)[..., None], m.fps))[..., 0]

    def of(k: int) -> Iterator[Repetition]:
        for begin, end in runs((m.hands[:, k, 1] > UP) & (lifting[:, k] < 0.4)):
            aside = m.hands[begin:end, k, 2]
            for each in _tops(aside - smooth_seconds(aside, 0.5, m.fps), 0.07):
                yield Repetition(begin + each.begin, begin + each.end)

    return max((list(of(k)) for k in (0, 1)), key=len)


def _nods(m: Motion) -> list[Repetition]:
    return _tops(smooth_seconds(m.pitch, 0.03, m.fps), 7)


def _push_ups(m: Motion) -> list[Repetition]:
    return _tops(-smooth_seconds(m.joints[:, HEAD, 1], 0.1, m.fps), 0.12)


def _sit_ups(m: Motion) -> list[Repetition]:
    return _tops(-smooth_seconds(m.tilt, 0.1, m.fps), 25)


def _arms_up(m: Motion) -> list[Repetition]:
    return _tops(smooth_seconds(m.hands[..., 1].min(axis=1), 0.1, m.fps), 0.4)


def _upside_down(m: Motion) -> list[Repetition]:
    up = smooth_seconds(trunk_up(m.joints)[:, 1], 0.05, m.fps)
    return [each for frame, each in _rises(-up, 0.8) if up[frame] < 0]


def _knees(m: Motion) -> list[Repetition]:
    thighs = smooth_seconds(m.thighs, 0.05, m.fps)
    return _merged((_tops(thighs[:, k], 40) for k in (0, 1)), 0.1 * m.fps)


def _turns(m: Motion) -> list[Repetition]:
    angle = np.maximum.accumulate(np.abs(m.heading - m.heading[0]))
    return [
        Repetition(*(int(np.argmax(angle >= 360 * number + degrees)) for degrees in (30, 300)))
        for number in range(int((angle[-1] + 60) // 360))
    ]


REPETITIONS: Mapping[str, Callable[[Motion], list[Repetition]]] = {
    **dict.fromkeys(STEPPING, _steps),
    "jump": _flights,
    "jump-forward": _flights,
    "hop": _flights,
    "jumping-jacks": _arms_up,
    "bow": _bows,
    "bend-over": _bows,
    "pick-up": _bows,
    "squat": _squats,
    "kick": _kicks,
    "punch": _thrusts,
    "clap": _claps,
    "raise-arm": _raised,
    "wave": _waves,
    "nod": _nods,
    "push-ups": _push_ups,
    "sit-ups": _sit_ups,
    "cartwheel": _upside_down,
    "knee-to-elbow": _knees,
    "spin": _turns,
}
