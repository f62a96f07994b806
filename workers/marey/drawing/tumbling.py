"""Bodies that fall, turn over and float: the trunk turns as a whole, the limbs go with it or to the floor.

Between poses all values follow monotone cubics; on the way to a pose that is fallen into they change with growing
speed, as under gravity. A trunk that would be in the floor is lifted out of it, one that rests is lowered onto it, and
in flight the centre of mass follows a parabola. Angles may pass 360 degrees.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from marey.drawing.gesture import SIDES, Gesture
from marey.drawing.postures import Point
from marey.motion.filters import smooth_above
from marey.motion.rotations import cross, from_rotvec, normalize, rotate
from marey.posing.bones import two_bones
from marey.posing.curves import blurred, monotone, turning_evenly
from marey.posing.limbs import BONE_LENGTHS, CARRIED, FPS, GRAVITY, LEVEL
from marey.posing.standing import ARMS, LEGS, OTHER_SIDE, SIGN, StandingBody

Array = NDArray[np.floating]

OWN, FLOOR, BODY = "own", "floor", "body"
_SPINE, _NECK = (3, 6, 9), 12
_ROOM = {0: 0.1, 1: 0.09, 2: 0.09, 3: 0.1, 6: 0.1, 9: 0.11, 12: 0.07, 15: 0.1, 16: 0.08, 17: 0.08}
"""Metres of joints of the trunk over the floor on which it lies."""
_WRIST, _ANKLE, _TOE, _BEND = 0.035, 0.045, 0.012, 0.06  # lowest metres of joints; of elbows and knees
_REACH, _LEAST = 0.985, 0.17  # share of the length of an arm; metres from shoulder to wrist
_PARTS = 6  # parts of the way to a pose that is fallen into
_SMOOTH = 0.9  # frames
_TURN = np.radians(28.0)  # by which a foot turns from one frame to the next at most
_SWING = np.radians(32.0)  # by which a hand turns about its shoulder from one frame to the next at most
_PASSES = 4  # frames before and after a moment in which a hand passes its shoulder
_MASSES = {0: 0.16, 3: 0.1, 6: 0.1, 9: 0.16, 15: 0.08, 18: 0.03, 19: 0.03, 20: 0.02, 21: 0.02}
_LEG_MASSES = {1: 0.05, 2: 0.05, 4: 0.06, 5: 0.06, 7: 0.04, 8: 0.04}
"""Shares of the mass of a body at its joints."""


@dataclass(frozen=True)
class Limb:
    """Where a wrist or an ankle is.

    Attributes:
        at: outward, up and forward of the anchor, metres.
        anchor: `own`: where the idle has it (a hand: as the trunk carries it); `floor`: below the pelvis of the idle;
            `body`: the middle of the shoulders with the axes of the trunk for a hand, the pelvis with its axes for a
            foot.
        towards: where the elbow or the toes point, in the same axes.
    """

    at: Point = (0.0, 0.0, 0.0)
    anchor: str = BODY
    towards: Point = (0.7, -0.6, -0.5)


@dataclass(frozen=True)
class Whole:
    """A pose of the whole body.

    Attributes:
        at: metres of the pelvis to the left and forward of its place in the idle.
        height: of the pelvis, as a share of that in the idle.
        tilt: degrees of the pelvis: forward, to the right, and then turned to the left.
        spine, neck: likewise, in the axes of the pelvis, in addition.
        hands, feet: by side; one that is left out is its own.
        rest: share of the weight that lies on the trunk: 1 puts it onto the floor.
        splay: how far the knees point outward; 0: as the pelvis does.
    """

    at: tuple[float, float] = (0.0, 0.0)
    height: float = 1.0
    tilt: Point = (0.0, 0.0, 0.0)
    spine: Point = (0.0, 0.0, 0.0)
    neck: Point = (0.0, 0.0, 0.0)
    hands: Mapping[str, Limb] = field(default_factory=dict)
    feet: Mapping[str, Limb] = field(default_factory=dict)
    rest: float = 0.0
    splay: float = 0.12


def flipped(whole: Whole) -> Whole:
    """Exchange left and right."""
    turned = {name: _mirrored(getattr(whole, name)) for name in ("tilt", "spine", "neck")}
    sided = {name: {OTHER_SIDE[side]: put for side, put in getattr(whole, name).items()} for name in ("hands", "feet")}
    return replace(whole, at=(-whole.at[0], whole.at[1]), **turned, **sided)


def _mirrored(angles: Point) -> Point:
    return (angles[0], -angles[1], -angles[2])


def pair(limb: Limb) -> dict[str, Limb]:
    return dict.fromkeys(SIDES, limb)


def stood(left: float, forward: float) -> dict[str, Limb]:
    """Both feet as in the idle, moved over the floor."""
    return {side: Limb((SIGN[side] * left, 0.0, forward), OWN) for side in SIDES}


@dataclass
class Tumble:
    """Poses and the times at which they are reached, seconds.

    Attributes:
        poses, times: of the same length, two or more; the first and the last pose are held.
        falls: for each pose but the first, whether the body falls into it.
        flights: first and last second of each flight.
    """

    poses: list[Whole] = field(default_factory=lambda: [Whole()])
    times: list[float] = field(default_factory=lambda: [0.4])
    falls: list[bool] = field(default_factory=list)
    flights: list[tuple[float, float]] = field(default_factory=list)

    def then(self, seconds: float, whole: Whole, hold: float = 0.0, *, fall: bool = False) -> None:
        """Reach a pose after `seconds`, falling into it or not, and hold it."""
        self.times.append(self.times[-1] + seconds)
        self.poses.append(whole)
        self.falls.append(fall)
        if hold > 0.0:
            self.then(hold, whole)

    def either(self, rng: random.Random) -> Tumble:
        """The same or its mirror image, at random."""
        return self if rng.random() < 0.5 else self.mirrored()

    def mirrored(self) -> Tumble:
        return replace(self, poses=[flipped(whole) for whole in self.poses])

    def gesture(self, rng: random.Random, kinds: Sequence[str], side: str = "", untrue: str = "") -> Gesture:
        """The gesture that passes through the poses, then stays for a moment; empty kinds are left out."""
        seconds = self.times[-1] + rng.uniform(0.2, 0.8)
        return Gesture(seconds, tuple(filter(None, kinds)), self.apply, side, untrue=untrue)

    def apply(self, body: StandingBody) -> None:
        """Move a body through the poses."""
        times, shares = self._rows()
        poses = self.poses

        def track(values: Sequence[Sequence[float]]) -> Array:
            rows = shares @ np.asarray(values, np.float64)
            return blurred(monotone(times, rows, np.arange(len(body.joints)) / FPS), _SMOOTH)

        def limbs(name: str, side: str) -> dict[str, tuple[Array, Array, Array]]:
            return _by_anchor([getattr(one, name).get(side, Limb(anchor=OWN)) for one in poses], track)

        motion = WholeMotion(
            track([(one.at[0], one.height, one.at[1]) for one in poses]),
            track([one.tilt for one in poses]),
            track([one.spine for one in poses]),
            track([one.neck for one in poses]),
            {side: limbs("hands", side) for side in SIDES},
            {side: limbs("feet", side) for side in SIDES},
            track([(one.rest,) for one in poses])[:, 0],
            track([(one.splay,) for one in poses])[:, 0],
        )
        tumble(body, motion)
        for start, end in self.flights:
            fly(body.joints, round(start * FPS), round(end * FPS))

    def _rows(self) -> tuple[Array, Array]:
        """Times of all rows, and the share of each pose in them."""
        eye = np.eye(len(self.poses))
        times, rows = [self.times[0]], [eye[0]]
        for k, fall in enumerate(self.falls):
            for part in np.arange(1, _PARTS + 1) / _PARTS if fall else (1.0,):
                times.append(self.times[k] + part * (self.times[k + 1] - self.times[k]))
                rows.append((1 - part**2) * eye[k] + part**2 * eye[k + 1])
        return np.array(times), np.array(rows)


def _by_anchor(
    limbs: Sequence[Limb], track: Callable[[Sequence[Sequence[float]]], Array]
) -> dict[str, tuple[Array, Array, Array]]:
    """Share, place and direction over time of each anchor; a pose with another one takes those of the nearest."""
    found = {}
    for anchor in dict.fromkeys(limb.anchor for limb in limbs):
        having = [k for k, limb in enumerate(limbs) if limb.anchor == anchor]
        nearest = [limbs[min(having, key=lambda h, k=k: abs(h - k))] for k in range(len(limbs))]
        share = track([(float(limb.anchor == anchor),) for limb in limbs])
        found[anchor] = (share, track([limb.at for limb in nearest]), track([limb.towards for limb in nearest]))
    return found


@dataclass(frozen=True)
class WholeMotion:
    """A motion over T frames, before the limbs are solved.

    Attributes:
        place: (T, 3) metres of the pelvis to the left of its place in the idle, its height as a share, and forward.
        tilt, spine, neck: (T, 3) degrees; see `Whole`.
        hands, feet: by side and anchor: share (T, 1), place (T, 3) and direction (T, 3); see `Limb`.
        rest, splay: (T,); see `Whole`.
    """

    place: Array
    tilt: Array
    spine: Array
    neck: Array
    hands: Mapping[str, Mapping[str, tuple[Array, Array, Array]]]
    feet: Mapping[str, Mapping[str, tuple[Array, Array, Array]]]
    rest: Array
    splay: Array


def tumble(body: StandingBody, motion: WholeMotion) -> None:
    """Move an idle through a motion of the whole body."""
    joints = body.joints
    rest = joints[:, 0].mean(0)
    left = normalize(((joints[:, 1] - joints[:, 2]) * LEVEL).mean(0))
    axes = np.stack([left, [0.0, 1.0, 0.0], np.cross(left, [0.0, 1.0, 0.0])])
    idle = joints.copy()
    _turn_trunk(body, motion)
    put = rest * LEVEL + motion.place * LEVEL @ axes
    put[:, 1] = motion.place[:, 1] * rest[1]
    joints[:, CARRIED] += (put - joints[:, 0])[:, None]
    clear = np.min([joints[:, j, 1] - room for j, room in _ROOM.items()], axis=0)
    lift = np.maximum(-clear, 0.0) - motion.rest * np.maximum(clear, 0.0)
    joints[:, CARRIED, 1] += blurred(lift, _SMOOTH)[:, None]
    pelvis = _pelvis_axes(axes, motion.tilt)
    for _ in range(3):  # a body whose knees would be in the floor is lifted
        for side in SIDES:
            _solve_leg(joints, idle, side, motion, (axes, pelvis, rest * LEVEL))
        sunk = np.maximum(_BEND - joints[:, [4, 5], 1].min(-1), 0.0)
        joints[:, CARRIED, 1] += blurred(sunk, _SMOOTH)[:, None]
    for side in SIDES:
        _solve_leg(joints, idle, side, motion, (axes, pelvis, rest * LEVEL))
        _solve_arm(joints, side, motion, (axes, rest * LEVEL))


def _turn_trunk(body: StandingBody, motion: WholeMotion) -> None:
    turns = [(_NECK, motion.neck, ())] + [(j, motion.spine / 3, ()) for j in reversed(_SPINE)]
    for joint, angles, besides in (*turns, (0, motion.tilt, (1, 2))):
        for axis, degrees in zip(("left", "forward", "up"), angles.T, strict=True):
            if np.any(degrees):
                body.turn(joint, axis, degrees, besides=besides)


def _pelvis_axes(axes: Array, tilt: Array) -> Array:
    """Axes of the pelvis (T, 3, 3) in rows: left, up, forward."""
    turned = np.repeat(axes[None], len(tilt), axis=0)
    for axis, degrees in zip((0, 2, 1), tilt.T, strict=True):
        turned = rotate(from_rotvec(axes[axis] * np.radians(degrees)[:, None])[:, None], turned)
    return turned


def _solve_leg(joints: Array, idle: Array, side: str, motion: WholeMotion, frames: tuple[Array, Array, Array]) -> None:
    hip, knee, ankle, toe = LEGS[side]
    target, toes = _foot(joints, idle, side, motion, frames)
    across = normalize(frames[1][:, 0])
    outward = motion.splay[:, None] * across * SIGN[side]
    lengths = (BONE_LENGTHS[knee], BONE_LENGTHS[ankle])

    def solve() -> None:
        pole = normalize(cross(normalize(target - joints[:, hip]), across)) + outward
        joints[:, knee], joints[:, ankle] = two_bones(joints[:, hip], target, pole, lengths)

    solve()
    toes = _over_floor(toes, joints[:, ankle, 1], BONE_LENGTHS[toe])
    turned = turning_evenly(toes, _TURN)
    if turned is not toes:  # on its way a foot may point down: the ankle makes room for it
        sunk = _TOE - joints[:, ankle, 1] - BONE_LENGTHS[toe] * turned[:, 1]
        target[:, 1] += smooth_above(np.maximum(sunk, 0.0), _SMOOTH)
        solve()
    joints[:, toe] = joints[:, ankle] + BONE_LENGTHS[toe] * turned


def _foot(
    joints: Array, idle: Array, side: str, motion: WholeMotion, frames: tuple[Array, Array, Array]
) -> tuple[Array, Array]:
    """Where an ankle goes (T, 3), over the floor, and where the toes point (T, 3)."""
    _, _, ankle, toe = LEGS[side]
    axes, pelvis, origin = frames
    sign = np.array([SIGN[side], 1.0, 1.0])
    target, toes = np.zeros((len(joints), 3)), np.zeros((len(joints), 3))
    for anchor, (share, at, towards) in motion.feet[side].items():
        if anchor == BODY:
            point = joints[:, 0] + np.einsum("ti,tij->tj", at * sign, pelvis)
            pointed = np.einsum("ti,tij->tj", towards * sign, pelvis)
        elif anchor == FLOOR:
            point, pointed = origin + at * sign @ axes, towards * sign @ axes
        else:
            point, pointed = idle[:, ankle] + at * sign @ axes, idle[:, toe] - idle[:, ankle]
        target += share * point
        toes += share * normalize(pointed)
    target[:, 1] = np.maximum(target[:, 1], _ANKLE)
    return target, normalize(toes)


def _over_floor(toes: Array, ankles: Array, length: float) -> Array:
    """Directions (T, 3) of feet of a length that do not go into the floor from ankles at heights (T,)."""
    toes = toes.copy()
    toes[:, 1] = np.maximum(toes[:, 1], np.clip((_TOE - ankles) / length, -1.0, 0.9))
    level = np.linalg.norm(toes[:, [0, 2]], axis=-1)
    toes[:, [0, 2]] *= (np.sqrt(1 - np.minimum(toes[:, 1] ** 2, 1.0)) / np.maximum(level, 1e-6))[:, None]
    return normalize(toes)


def _solve_arm(joints: Array, side: str, motion: WholeMotion, frames: tuple[Array, Array]) -> None:
    _, shoulder, elbow, wrist = ARMS[side]
    axes, origin = frames
    sign = np.array([SIGN[side], 1.0, 1.0])
    middle = joints[:, [16, 17]].mean(1)
    up = normalize(middle - joints[:, 0])
    across = joints[:, shoulder] - middle
    out = normalize(across - up * np.einsum("ti,ti->t", across, up)[:, None])
    trunk = np.stack([out, up, SIGN[side] * cross(out, up)], axis=1)
    target, pole = np.zeros((len(joints), 3)), np.zeros((len(joints), 3))
    for anchor, (share, at, towards) in motion.hands[side].items():
        if anchor == BODY:
            point, pointed = middle + np.einsum("ti,tij->tj", at, trunk), np.einsum("ti,tij->tj", towards, trunk)
        elif anchor == FLOOR:
            point, pointed = origin + at * sign @ axes, towards * sign @ axes
        else:
            point = joints[:, wrist]
            pointed = joints[:, elbow] - 0.5 * (joints[:, shoulder] + joints[:, wrist])
        target += share * point
        pole += share * normalize(pointed)
    longest = _REACH * (BONE_LENGTHS[elbow] + BONE_LENGTHS[wrist])
    planted = motion.hands[side][FLOOR][0] if FLOOR in motion.hands[side] else np.zeros((len(joints), 1))
    wrists = joints[:, shoulder] + _swung(target - joints[:, shoulder], planted, longest)
    wrists[:, 1] = np.maximum(wrists[:, 1], _WRIST)
    lengths = (BONE_LENGTHS[elbow], BONE_LENGTHS[wrist])
    for _ in range(2):  # elbows that would be in the floor are lifted
        joints[:, elbow], joints[:, wrist] = two_bones(joints[:, shoulder], wrists, pole, lengths)
        sunk = np.clip((_BEND - joints[:, elbow, 1]) / _BEND, 0.0, 2.0)
        pole = normalize(pole) + blurred(sunk, 2.0)[:, None] * [0.0, 1.0, 0.0]


def _swung(reach: Array, planted: Array, longest: float) -> Array:
    """Return where hands are from their shoulders (T, 3): one that passes its shoulder swings around it, and does not
    fold the arm on the way.

    Args:
        reach: (T, 3) where they would be.
        planted: (T, 1) share in which a hand is on the floor, where it stays.
        longest: metres of the arm.
    """
    distance = np.linalg.norm(reach, axis=-1, keepdims=True)
    lengths = np.clip(distance, _LEAST, longest)
    frames = np.pad(lengths[:, 0], 2 * _PASSES, mode="edge")
    widest = np.lib.stride_tricks.sliding_window_view(frames, 2 * _PASSES + 1).max(axis=1)
    closed = np.lib.stride_tricks.sliding_window_view(widest, 2 * _PASSES + 1).min(axis=1)
    lengths += (1.0 - planted) * blurred(closed[:, None] - lengths, _SMOOTH)
    ways = reach / np.maximum(distance, 1e-6)
    even = turning_evenly(ways, _SWING)
    return lengths * normalize(planted * ways + (1.0 - planted) * even)


def centre_of_mass(joints: Array) -> Array:
    """The centre of mass (T, 3) of poses (T, 22, 3)."""
    masses = {**_MASSES, **_LEG_MASSES}
    weights = np.array(list(masses.values()))
    return np.einsum("tjk,j->tk", joints[:, list(masses)], weights / weights.sum())


def fly(joints: Array, first: int, last: int) -> None:
    """Move a body (T, 22, 3) between two frames so that its centre of mass follows a parabola under gravity."""
    centre = centre_of_mass(joints[first : last + 1])
    x = np.linspace(0.0, 1.0, last - first + 1)[:, None]
    path = (1 - x) * centre[0] + x * centre[-1]
    path[:, 1] += 0.5 * GRAVITY * ((last - first) / FPS) ** 2 * (x * (1 - x))[:, 0]
    joints[first : last + 1] += (path - centre)[:, None]
