"""Courses: the smoothed path of a motion over the floor, and motions bent to another (Gleicher, "Motion path editing",
2001).

What a motion adds to its own path, sway and bob, is carried over, turned by the difference of the two directions. A
standing foot is carried as a whole by the place of the path at the middle of its stand, so it stands as still as
before; its swings take up the difference.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.motion.curves import hump, smooth_open
from marey.motion.features import FeatureLayout
from marey.motion.feet import runs
from marey.motion.kinematics import facing, forward_kinematics
from marey.motion.legs import follow_feet, foot_chain
from marey.motion.pose import aim_bones
from marey.motion.rotations import Array, about, multiply, rotate
from marey.motion.skeleton import Skeleton

NATURAL_S = 0.25
"""Standard deviation in seconds of the smoothing of a motion's own path: a step is half a second long."""
SWING_S = 0.25
"""Seconds of the shortest swing in which a foot takes up a difference of its stands."""
STEP_S, STEP_EVERY_S, STEP_FROM, STEP_LIFT = 0.3, 0.4, 0.12, 0.05
"""Steps that are added where a body is carried away from a standing foot: seconds of one and between two, metres from
which one is taken, and metres that the foot is lifted."""
Bool = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Course:
    """The smoothed path of a motion: (T, 2) places in metres, (T,) headings in radians."""

    places: Array = field(repr=False)
    headings: Array = field(repr=False)

    @property
    def turn(self) -> float:
        """Degrees from the first frame to the last, positive to the left."""
        return float(np.degrees(self.headings[-1] - self.headings[0]))

    def speeds(self, fps: float) -> Array:
        """Return metres a second (T,)."""
        return np.linalg.norm(gradient(self.places), axis=1) * fps

    def straight(self) -> Course:
        """Return a course in which the body keeps the heading of frame 0, and moves as it does from its heading."""
        return self.facing(np.full(len(self.headings), self.headings[0]))

    def facing(self, headings: Array) -> Course:
        """Return a course with other headings (T,), in which the body moves as it does from its heading."""
        change = headings - self.headings
        steps = turned(np.diff(self.places, axis=0), 0.5 * (change[1:] + change[:-1]))
        return Course(self.places[0] + np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)]), headings)

    def at(self, times: Array) -> Course:
        """Return the course at other frames (n,)."""
        frames = np.arange(len(self.headings))
        x, z = (np.interp(times, frames, self.places[:, k]) for k in range(2))
        return Course(np.stack([x, z], axis=1), np.asarray(np.interp(times, frames, self.headings), np.float64))


def natural_course(joints: Array, skeleton: Skeleton, fps: float) -> Course:
    """Return the smoothed path of a motion (T, J, 3)."""
    ahead = facing(joints, skeleton)
    headings = np.unwrap(np.arctan2(ahead[:, 0], ahead[:, 2]))
    sigma = NATURAL_S * fps
    return Course(smooth_open(joints[:, 0, [0, 2]], sigma), smooth_open(headings[:, None], sigma)[:, 0])


def course_of(features: Array, layout: FeatureLayout) -> Course:
    """Return the smoothed path of a motion of features (T, D), in the layout's own units."""
    return natural_course(layout.decode(features).astype(np.float64), layout.skeleton, layout.fps)


def bent(
    rotations: Array, root: Array, contacts: Bool, natural: Course, wanted: Course, skeleton: Skeleton, fps: float
) -> tuple[Array, Array, Bool]:
    """Return rotations (T, J, 4), root (T, 3) and contacts (T, 4) of a motion that is bent from its own course to
    another."""
    frames = np.arange(len(root), dtype=np.float64)
    joints = forward_kinematics(skeleton, rotations, root)
    before = carried(joints, natural, wanted, frames)
    moved, contacts = before.copy(), contacts.copy()
    toes = joints[:, skeleton.feet[1::2]]
    stands, lifts = with_steps(contacts[:, 1::2], before[:, skeleton.feet[1::2]], toes, fps)
    for side in range(2):
        chain = foot_chain(skeleton, skeleton.feet[2 * side + 1])
        clock, standing = stand_clock(stands[:, side], fps)
        moved[:, chain] = carried(joints[:, chain], natural, wanted, clock)
        moved[:, chain, 1] += lifts[:, side, None]
        contacts[:, 2 * side : 2 * side + 2] &= standing[:, None]
    follow_feet(before, moved, contacts[:, 1::2], skeleton, fps)
    rotations = rotations.copy()
    rotations[:, 0] = multiply(about("Y", wanted.headings - natural.headings), rotations[:, 0])
    return aim_bones(moved, rotations, skeleton), moved[:, 0], contacts


def with_steps(stands: Bool, carried: Array, toes: Array, fps: float) -> tuple[Bool, Array]:
    """Return stands (T, 2) with steps where a body is carried away from a standing foot, and how high these steps lift
    the foot (T, 2), metres.

    The feet take turns; one steps only while the other stands.

    Args:
        carried: (T, 2, 3) the toes, as the course of the body carries them.
        toes: (T, 2, 3) the toes of the motion.
    """
    stands, lifts = stands.copy(), np.zeros(stands.shape)
    pushed = np.cumsum(np.linalg.norm(carried_on(carried, toes), axis=-1), axis=0)
    swing, period = max(round(STEP_S * fps), 3), round(2 * STEP_EVERY_S * fps)
    beside = min(swing // 2, period // 2 - swing)  # the steps of the other foot are no nearer
    last = [0.0, 0.0]
    for begin in range(swing, len(stands) - swing, 1):
        side = (begin // (period // 2)) % 2
        if begin % (period // 2) or begin + 2 * swing > len(stands):
            continue
        window = slice(begin, begin + swing)
        wide = slice(begin - beside, begin + swing + beside)
        far = pushed[min(begin + period // 2, len(stands) - 1), side] - last[side]
        if not stands[wide, side].all():
            last[side] = pushed[begin, side]
        elif far > STEP_FROM and stands[wide, 1 - side].all():
            stands[window, side] = False
            lifts[window, side] = STEP_LIFT * hump(np.linspace(-1, 1, swing + 2)[1:-1])
            last[side] = pushed[begin + swing // 2, side]
    return stands, lifts


def carried_on(carried: Array, toes: Array) -> Array:
    """Return by how much more than by itself each toe moves a frame (T, 2, 3), on the floor."""
    step = np.diff(carried, axis=0, prepend=carried[:1])
    own = np.linalg.norm(np.diff(toes, axis=0, prepend=toes[:1]), axis=-1, keepdims=True)
    step[..., 1] = 0.0
    size = np.linalg.norm(step, axis=-1, keepdims=True)
    return step * np.maximum(size - own, 0.0) / np.maximum(size, 1e-9)


def stand_clock(stands: Bool, fps: float) -> tuple[Array, Bool]:
    """Return the frame (T,) by which a foot is carried: that of the middle of its stand, and between two stands the
    frames from one middle to the next; and the frames in which it does not move.

    A swing shorter than `SWING_S` takes frames of the stands beside it; one at either end of the clip takes part in the
    stand.
    """
    clock, least = np.arange(len(stands), dtype=np.float64), max(round(SWING_S * fps), 2)
    found = runs(stands)
    if not found:
        return clock, np.zeros(len(stands), bool)
    middles = [(begin + end - 1) / 2 for begin, end in found]
    begins, ends = [begin for begin, _ in found], [end - 1 for _, end in found]
    begins[0] = 0 if begins[0] < least else begins[0]
    ends[-1] = len(stands) - 1 if ends[-1] >= len(stands) - least else ends[-1]
    for k in range(len(found) - 1):
        short = max(least - (begins[k + 1] - ends[k]), 0)
        ends[k] = max(ends[k] - short // 2, int(middles[k]))
        begins[k + 1] = min(begins[k + 1] + short - short // 2, int(np.ceil(middles[k + 1])))
    still = np.zeros(len(stands), bool)
    _ease(clock, 0, begins[0], 0.0, middles[0])
    for k, middle in enumerate(middles):
        clock[begins[k] : ends[k] + 1] = middle
        still[begins[k] : ends[k] + 1] = True
        after = (begins[k + 1], middles[k + 1]) if k + 1 < len(found) else (len(stands) - 1, len(stands) - 1.0)
        if after[0] > ends[k]:
            _ease(clock, ends[k], after[0], middle, after[1])
    return clock, still


def _ease(clock: Array, begin: int, end: int, start: float, stop: float) -> None:
    """Write a smooth passage from frame `begin` to `end`."""
    if end > begin:
        inside = np.arange(begin, end + 1)
        clock[inside] = stop + (start - stop) * hump((inside - begin) / (end - begin))


def carried(joints: Array, natural: Course, wanted: Course, times: Array) -> Array:
    """Return joints (T, n, 3), carried from one course to the other as it is at `times` (T,)."""
    here, there = natural.at(times), wanted.at(times)
    from_origin = joints - _flat(here.places)[:, None]
    return rotate(about("Y", there.headings - here.headings)[:, None], from_origin) + _flat(there.places)[:, None]


def turned(flat: Array, angle: float | Array) -> Array:
    """Return X and Z of vectors (..., 2) turned about the vertical."""
    x, z = flat[..., 0], flat[..., 1]
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.stack([cosine * x + sine * z, cosine * z - sine * x], axis=-1)


def gradient(values: Array) -> Array:
    """Return the change a frame (T, C)."""
    return np.gradient(values, axis=0) if len(values) > 1 else np.zeros_like(values)


def _flat(places: Array) -> Array:
    return np.stack([places[:, 0], np.zeros(len(places)), places[:, 1]], axis=1)
