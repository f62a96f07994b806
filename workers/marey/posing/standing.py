"""Pose editing of a standing or walking body: move arms along smooth paths and bend the trunk; the feet stay as
captured.

Captures for commercial use have two waves, two raised arms and a bow; `marey.data.gestures` makes more of them from
captured idles with these functions. Directions are in the frame of the body: outward (away from the body on the arm's
own side), up, forward.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from marey.checks.kinematics import heading
from marey.motion.filters import smootherstep
from marey.motion.rotations import from_rotvec, normalize, rotate
from marey.motion.skeleton import HUMANML3D
from marey.posing.bones import steady_bends, with_bones
from marey.posing.limbs import ARM_CHAINS, BONE_LENGTHS, CARRIED, FPS, LEG_CHAINS

Array = NDArray[np.floating]

LEFT, RIGHT = "left", "right"
OTHER_SIDE = {LEFT: RIGHT, RIGHT: LEFT}
SIGN = {LEFT: 1.0, RIGHT: -1.0}
"""Of the body's left, on each side: outward is `SIGN` times left."""
ARMS: dict[str, tuple[int, int, int, int]] = dict(zip((LEFT, RIGHT), ARM_CHAINS, strict=True))
"""Collar, shoulder, elbow and wrist."""
LEGS: dict[str, tuple[int, int, int, int]] = dict(zip((LEFT, RIGHT), LEG_CHAINS, strict=True))
"""Hip, knee, ankle and toe."""
_LEG_JOINTS = {joint for leg in LEG_CHAINS for joint in leg}
_ANKLES, _TOES = [7, 8], [10, 11]
_SPINE = (3, 6, 9)
NECK = 12
_COLLAR_LIFT = np.radians(22.0)  # lift of the shoulder if the arm points straight up
_LIFT_FROM, _LIFT_TO = np.radians(-20.0), np.radians(80.0)
_VIA = {"upper": (35.0, -25.0), "fore": (20.0, 25.0)}  # an arm rises in front of the body with a bent elbow
_BACK = 0.12  # metres that the hips move back in a bow to the level
_HIPS_FOLLOW = 0.9  # share of the rise of the ankles; knees are not to be stretched
_DOWN = 0.03  # metres that they move down in it
_PELVIS_SHARE = 0.45  # share of a bow by the hips; the spine bends by the rest
_POLE = (0.7, -1.0, -0.3)  # elbows point down and outward
_ACROSS = 1.2  # how far forward the elbow of an arm across the body points: before the chest, not through it
_SWING_FROM = 0.7  # share of the rise after which a hand swings


def eased(x: Array) -> Array:
    """Return 0 before x = 0, 1 after x = 1, without a jump in speed or acceleration."""
    return smootherstep(np.clip(x, 0.0, 1.0))


def envelope(frames: int, start: float, rise: float, hold: float, fall: float) -> Array:
    """Envelope (frames,): 0 before `start`, 1 while held, 0 after; times in seconds."""
    t = np.arange(frames) / FPS - start
    return eased(t / rise) * (1 - eased((t - rise - hold) / fall))


def direction(azimuth: float, elevation: float) -> Array:
    """Unit vector (outward, up, forward); azimuth from forward to outward and elevation above level, degrees."""
    a, e = np.radians(azimuth), np.radians(elevation)
    return np.array([np.cos(e) * np.sin(a), np.sin(e), np.cos(e) * np.cos(a)])


class StandingBody:
    """A motion (T, 22, 3) on the feet, at 20 fps, for pose editing; metres, Y up."""

    def __init__(self, joints: Array) -> None:
        self.joints = np.array(joints, np.float64)
        angle = np.radians(heading(self.joints, FPS))
        zero, one = np.zeros_like(angle), np.ones_like(angle)
        self._left = np.stack([np.cos(angle), zero, -np.sin(angle)], axis=-1)
        self._forward = np.stack([np.sin(angle), zero, np.cos(angle)], axis=-1)
        self._up = np.stack([zero, one, zero], axis=-1)

    def _axes(self, side: str) -> Array:
        """Axes of the body (T, 3, 3) in rows: outward, up, forward."""
        return np.stack([SIGN[side] * self._left, self._up, self._forward], axis=1)

    def local(self, vectors: Array, side: str) -> Array:
        """Convert vectors (T, 3) from the world to the body's frame."""
        return np.einsum("tij,tj->ti", self._axes(side), vectors)

    def world(self, vectors: Array, side: str) -> Array:
        """Invert `local`."""
        return np.einsum("tij,ti->tj", self._axes(side), vectors)

    def turn(self, joint: int, axis: str, degrees: Array, *, besides: Sequence[int] = ()) -> None:
        """Rotate all descendants of a joint, and `besides`, about it.

        Args:
            joint: its number.
            axis: `left` (positive: forward and down), `forward` (positive: towards the body's right) or `up`
                (positive: towards its left).
            degrees: (T,).
            besides: further joints.
        """
        along = {"left": self._left, "forward": self._forward, "up": self._up}[axis]
        turned = from_rotvec(along * np.radians(degrees)[:, None])
        moved = [*_beyond(joint), *besides]
        pivot = self.joints[:, joint : joint + 1]
        self.joints[:, moved] = pivot + rotate(turned[:, None], self.joints[:, moved] - pivot)

    def move_arm(
        self,
        side: str,
        way: Array,
        upper: Array,
        fore: Array,
        lag: float,
        *,
        straight: bool = False,
        folds: float = 1.0,
    ) -> None:
        """Move an arm from its current direction to another and back.

        Args:
            side: of the arm.
            way: (T,) progress of the movement, 0 to 1.
            upper, fore: (T, 3) or (3,) directions of upper arm and forearm at 1, in the body's frame.
            lag: seconds by which the forearm follows the upper arm.
            folds: more than 1: the elbow bends before the upper arm rises, and stretches after it has come down, so
                that the hand reaches no farther than its place on the way.
            straight: go there the shortest way instead of past the front of the body with a bent elbow.
        """
        collar, shoulder, elbow, wrist = ARMS[side]
        later = np.interp(np.arange(len(way)) - lag * FPS, np.arange(len(way)), way)
        bones = []
        for (a, b), weight, target, via in (
            (
                (shoulder, elbow),
                np.clip(way, 0.0, 1.0) ** folds if folds > 1.0 else way,
                upper,
                direction(*_VIA["upper"]),
            ),
            ((elbow, wrist), 1.0 - (1.0 - np.minimum(later, 1.0)) ** folds, fore, direction(*_VIA["fore"])),
        ):
            here = self.local(normalize(self.joints[:, b] - self.joints[:, a]), side)
            w = weight[:, None]
            via = 0.5 * (here + target) if straight else via
            bones.append(normalize((1 - w) ** 2 * here + 2 * w * (1 - w) * via + w**2 * target).astype(np.float64))
        elevation = np.arcsin(np.clip(bones[0][:, 1], -1, 1))
        hanging = normalize(self.joints[:, elbow] - self.joints[:, shoulder])[:, 1]
        rest = np.arcsin(np.clip(hanging, -1, 1))
        lifted = _COLLAR_LIFT * (_lift(elevation) - _lift(rest))
        clavicle = self.local(self.joints[:, shoulder] - self.joints[:, collar], side)
        cos, sin = np.cos(lifted), np.sin(lifted)
        clavicle = np.stack(
            [clavicle[:, 0] * cos - clavicle[:, 1] * sin, clavicle[:, 0] * sin + clavicle[:, 1] * cos, clavicle[:, 2]],
            axis=-1,
        )
        self.joints[:, shoulder] = self.joints[:, collar] + self.world(clavicle, side)
        self.joints[:, elbow] = self.joints[:, shoulder] + BONE_LENGTHS[elbow] * self.world(bones[0], side)
        self.joints[:, wrist] = self.joints[:, elbow] + BONE_LENGTHS[wrist] * self.world(bones[1], side)

    def reach(self, side: str, target: Array, pole: Sequence[float] | Array = _POLE) -> tuple[Array, Array]:
        """Directions (T, 3) of upper arm and forearm that put the wrist at a target.

        Args:
            side: of the arm.
            target: (T, 3) the wrist relative to the shoulder, in the body's frame, metres; brought into reach.
            pole: (3,) or (T, 3) where the elbow points, in the body's frame; down and outward by default.
        """
        _, _, elbow, wrist = ARMS[side]
        upper, lower = BONE_LENGTHS[elbow], BONE_LENGTHS[wrist]
        distance = np.linalg.norm(target, axis=-1, keepdims=True)
        axis = target / distance
        distance = np.clip(distance, abs(upper - lower) + 0.02, 0.98 * (upper + lower))
        along = (distance**2 + upper**2 - lower**2) / (2 * distance)
        before = np.clip(0.5 + 2.0 * axis[:, 2:], 0.0, 1.0)  # hands behind the head leave the elbow where it is
        across = before * np.maximum(-axis[:, :1], 0.0) ** 2
        poles = np.asarray(pole, np.float64) + _ACROSS * across * [0.0, 0.0, 1.0]
        aside = steady_bends(axis, poles)
        bent = along * axis + np.sqrt(np.maximum(upper**2 - along**2, 0.0)) * aside
        return normalize(bent), normalize(distance * axis - bent)

    def from_shoulder(self, side: str, points: Array) -> Array:
        """Convert points (T, 3) of the world to the body's frame, relative to a shoulder."""
        return self.local(points - self.joints[:, ARMS[side][1]], side)

    def hold(
        self, side: str, way: Array, point: Array, *, lag: float = 0.0, pole: Sequence[float] | Array = _POLE
    ) -> None:
        """Move a hand to a point before the chest and back; see `move_arm`.

        Args:
            side: of the arm.
            way: (T,) progress of the movement, 0 to 1.
            point: (3,) or (T, 3) the wrist relative to the middle of the shoulders, in the body's frame, metres.
            lag: seconds by which the forearm follows the upper arm.
            pole: see `reach`.
        """
        middle = self.joints[:, [arm[1] for arm in ARMS.values()]].mean(1)
        self.move_arm(side, way, *self.reach(side, self.from_shoulder(side, middle) + point, pole), lag)

    def lift_arm(self, side: str, degrees: Array) -> None:
        """Lift a hanging arm away from the body by turning its shoulder by `degrees` (T,)."""
        self.turn(ARMS[side][1], "forward", SIGN[side] * degrees)

    def shrug(self, degrees: Array) -> None:
        """Lift both shoulders by turning the collars by `degrees` (T,)."""
        for side, (collar, *_) in ARMS.items():
            self.turn(collar, "forward", SIGN[side] * degrees)

    def steady(self, share: float) -> None:
        """Take a share, 0 to 1, of the swing of the shoulders out of the spine."""
        across = self.joints[:, ARMS[LEFT][1]] - self.joints[:, ARMS[RIGHT][1]]
        seen = self.local(across, LEFT)
        self.lean(share * np.degrees(np.arctan2(seen[:, 2], seen[:, 0])), "up")

    def shift(self, up: Array, forward: Array | float = 0.0, left: Array | float = 0.0) -> None:
        """Move the hips and all above them, in metres (T,); the knees are solved."""
        moved = np.stack(np.broadcast_arrays(left, up, forward), axis=-1)
        self.joints[:, CARRIED] += self.world(moved, LEFT)[:, None]

    def rise_on_toes(self, degrees: Array) -> None:
        """Lift the heels by turning the feet about the toes by `degrees` (T,), the hips following."""
        before = self.joints[:, _ANKLES].copy()
        turned = from_rotvec(self._left * np.radians(degrees)[:, None])[:, None]
        toes = self.joints[:, _TOES]
        self.joints[:, _ANKLES] = toes + rotate(turned, before - toes)
        seen = self.local((self.joints[:, _ANKLES] - before).mean(1), LEFT)
        self.shift(_HIPS_FOLLOW * seen[:, 1], seen[:, 2])

    def lean(self, degrees: Array, axis: str, joints: Sequence[int] = _SPINE) -> None:
        """Bend the spine by `degrees` (T,) in total; see `turn`."""
        for joint in joints:
            self.turn(joint, axis, degrees / len(joints))

    def bow(self, degrees: Array, *, arms_hang: float, head: float) -> None:
        """Bend forward without moving the feet.

        Args:
            degrees: (T,) of the trunk.
            arms_hang: 0: the arms move with the trunk; 1: they hang straight down.
            head: degrees of the neck per degree of the trunk; negative: the gaze stays ahead.
        """
        hips = self.joints[:, [1, 2]].copy()
        self.turn(0, "left", _PELVIS_SHARE * degrees, besides=(1, 2))
        self.joints[:, CARRIED] += (hips - self.joints[:, [1, 2]]).mean(1, keepdims=True)
        self.lean((1 - _PELVIS_SHARE) * degrees, "left")
        self.turn(NECK, "left", head * degrees)
        for _, shoulder, _, _ in ARMS.values():
            self.turn(shoulder, "left", -arms_hang * degrees)
        sine = np.sin(np.radians(degrees))[:, None, None]
        self.joints[:, CARRIED] -= _BACK * sine * self._forward[:, None] + _DOWN * sine * self._up[:, None]

    def solved(self) -> Array:
        """The poses (T, 22, 3) with bones of the skeleton's lengths and knees solved between hips and feet."""
        return with_bones(self.joints)


def _lift(elevation: Array) -> Array:
    return eased((elevation - _LIFT_FROM) / (_LIFT_TO - _LIFT_FROM))


def _beyond(joint: int) -> list[int]:
    """Descendants of a joint, without the legs, which are solved."""
    found = [joint]
    for j, parent in enumerate(HUMANML3D.parents):
        if parent in found and j not in _LEG_JOINTS:
            found.append(j)
    return found[1:]


def swung(vectors: Array, degrees: Array) -> Array:
    """Rotate directions (3,) or (T, 3) by `degrees` (T,) in the plane of the chest; positive is outward."""
    vectors = np.broadcast_to(vectors, (len(degrees), 3))
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.stack(
        [vectors[:, 0] * cos + vectors[:, 1] * sin, vectors[:, 1] * cos - vectors[:, 0] * sin, vectors[:, 2]], axis=-1
    )


def swings(way: Array, rate: Callable[[Array], Array] | float) -> Array:
    """Oscillation (T,) between -1 and 1 while the movement is nearly complete.

    Args:
        way: (T,) see `StandingBody.move_arm`.
        rate: full swings per second.
    """
    t = np.arange(len(way)) / FPS
    begin = t[int(np.argmax(way >= _SWING_FROM))]
    rates = np.broadcast_to(rate(t) if callable(rate) else rate, t.shape)
    phase = np.cumsum(np.where(t >= begin, rates, 0.0)) / FPS
    return np.sin(2 * np.pi * phase) * eased((way - _SWING_FROM) / (1 - _SWING_FROM))


def stations(frames: int, times: Sequence[float], points: Array | Sequence[Sequence[float]]) -> Array:
    """Path (frames, K) through points (n, K) at `times` in seconds, increasing, with a stop at each; ends are held."""
    t = np.arange(frames) / FPS
    at, through = np.asarray(times, np.float64), np.asarray(points, np.float64)
    k = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(at) - 2)
    w = eased((t - at[k]) / (at[k + 1] - at[k]))[:, None]
    return (1 - w) * through[k] + w * through[k + 1]


def way_through(
    t: Array, times: Sequence[float] | Array, points: Array | Sequence[float] | Sequence[Sequence[float]]
) -> Array:
    """Numbers (T,), or path (T, K), in straight lines through points (n,) or (n, K); ends are held.

    Unlike `stations` it stops nowhere; callers smooth it.

    Args:
        t: (T,) seconds.
        times: (n,) seconds of the points, increasing.
        points: what is passed.
    """
    through = np.asarray(points, np.float64)
    if through.ndim == 1:
        return np.interp(t, times, through)
    return np.stack([np.interp(t, times, each) for each in through.T], axis=-1)


def poses_at(joints: Array, frames: Array) -> Array:
    """Return joints (N, J, 3) at frames (N,), which may lie between those of joints (T, J, 3); ends are held."""
    flat = joints.reshape(len(joints), -1)
    return way_through(frames, np.arange(float(len(joints))), flat).reshape(-1, *joints.shape[1:])


def tremble(frames: int, rate: float, phase: float) -> Array:
    """Oscillation (frames,) between -1 and 1 of about `rate` per second, unsteady in pace and strength.

    Args:
        frames: its length.
        rate: mean full swings per second.
        phase: radians; different parts of a body get different ones.
    """
    t = np.arange(frames) / FPS
    strength = 0.78 + 0.22 * np.sin(2 * np.pi * 0.6 * t + 2.3 * phase)
    return strength * np.sin(2 * np.pi * rate * t + phase + 0.35 * np.sin(2 * np.pi * 0.8 * t + 1.7 * phase))
