"""Bodies that pass through given postures: hips that go far down, hands and feet that go where they are put.

Between postures the hips, the trunk and the feet follow monotone cubics, so that they neither overshoot nor stop at
each; a foot that is put elsewhere on the floor steps there, one after the other. What a posture does not set stays as
in the idle, with its breath and sway.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.drawing.postures import HandPlace, Posture
from marey.motion.rotations import cross, normalize
from marey.posing.bones import two_bones
from marey.posing.curves import blurred, monotone
from marey.posing.limbs import BONE_LENGTHS, CARRIED, FPS
from marey.posing.standing import ARMS, LEFT, LEGS, SIGN, StandingBody, eased

Array = NDArray[np.floating]

_ANKLES = [7, 8]
_HIPS = (1, 2)
_SPINE, _NECK = (3, 6, 9), 12
_ARM_REACH = 0.985  # share of the length of an arm
_LEAST_REACH = 0.17  # metres from shoulder to wrist
_VIA = (0.1, 0.0, 0.12)  # metres, outward, up and forward of the trunk; a hand on its way to a place goes round
_SWAY = 0.15  # share of an idle's sway that is left in hips that are put somewhere
_ANKLE, _TOE = 0.07, 0.01  # metres of a foot that stands
_STANDS, _LOW = 0.94, 0.45  # metres of the hips of a standing body, and from which they depend on its height
_LOWEST = 0.035  # metres of a wrist over the floor
_TRUNK = (0, 9)
_TRUNK_ROOM, _THIGH_ROOM = 0.14, 0.08  # metres from a wrist to the axis of the trunk and of the thigh
_OUT = 0.04  # metres; nearer to the axis than this, a wrist is moved outward
_ELBOW_LIFT = (0.9, 1.0, 0.0)  # outward, up and forward
_LIFTED = 0.07  # an elbow below this height is lifted
_KNEE_LIFT = (1.0, 0.6, 0.2)  # likewise a knee, which goes aside
_KNEE_ROOM = 0.03  # a knee below this height is lifted
_LIFTS = 4  # times that the knees are solved until none is in the floor
_STRAIGHT = 0.03  # metres; a knee that is bent by less points where the foot does
_STEP = 0.03  # metres; a foot that goes farther over the floor is lifted
_FLOOR = 0.2  # metres of an ankle
_STEPS_S = 0.45  # seconds from which on both feet of a body step in turn; in less, it hops
_SMOOTH, _SMOOTH_FEET = 1.1, 0.6  # frames


def pose(body: StandingBody, times: Sequence[float], postures: Sequence[Posture]) -> None:
    """Move a body through postures at `times`, seconds, increasing; the first and the last are held."""
    _Posing(body, np.asarray(times, np.float64), postures).apply()


class _Posing:
    def __init__(self, body: StandingBody, times: Array, postures: Sequence[Posture]) -> None:
        self.body, self.postures = body, postures
        joints = body.joints
        self.t = np.arange(len(joints)) / FPS
        self.times = times
        self.origin = joints[:, _ANKLES].mean((0, 1)) * np.array([1.0, 0.0, 1.0])
        across = (joints[:, 1] - joints[:, 2]).mean(0) * np.array([1.0, 0.0, 1.0])
        left = normalize(across)
        self.axes = np.stack([left, [0.0, 1.0, 0.0], np.cross(left, [0.0, 1.0, 0.0])])
        """Rows: left, up, forward."""
        self.bends = {side: self._bend(side) for side in LEGS}
        """Where the knees of the idle point, by side: outward, up and forward."""
        self.places = {side: self._places(side) for side in LEGS}
        """Ankles of each posture (N, 3), by side: outward, up and forward."""
        self.clocks = self._clocks()
        """Seconds (T,) at which each foot is, by side: while one steps, that of the other stands still."""

    def apply(self) -> None:
        self._trunk()
        for side in LEGS:
            self._leg(side)
        for side in ARMS:
            self._arm(side)

    def _track(
        self, values: Sequence[Sequence[float] | Array] | Array, smooth: float = _SMOOTH, *, clock: Array | None = None
    ) -> Array:
        """Smooth path (T, K) through one row per posture, at the seconds (T,) of a clock or of all frames."""
        rows = np.asarray(values, np.float64)
        if len(rows) == 1:
            return np.repeat(rows, len(self.t), axis=0)
        path = monotone(self.times, rows, self.t if clock is None else clock)
        return blurred(path, smooth)

    def _floor(self, points: Array) -> Array:
        """Convert points (..., 3) of the world to left, up, forward."""
        return (points - self.origin) @ self.axes.T

    def _world(self, vectors: Array, side: str = LEFT) -> Array:
        """Convert directions (..., 3), outward, up and forward, to the world."""
        return (vectors * self._outward(side)) @ self.axes

    def _outward(self, side: str) -> Array:
        """Factors (3,) that turn left, up, forward to outward, up, forward."""
        return np.array([SIGN[side], 1.0, 1.0])

    def _trunk(self) -> None:
        body = self.body
        own = self._floor(body.joints[:, 0])
        rest = own.mean(0)
        put = self._track([self._hips(posture, rest) for posture in self.postures])
        sway = self._track([[1.0 if posture.pelvis is None else _SWAY] for posture in self.postures])
        moved = put + sway * (own - rest) - own
        for joint, part in ((0, "tilt"), *((joint, "spine") for joint in _SPINE), (_NECK, "neck")):
            share = 3 if part == "spine" else 1
            angles = self._track([getattr(posture, part) for posture in self.postures]) / share
            self._turn(joint, angles)
        hang = self._track([[posture.hang] for posture in self.postures])[:, 0]
        lean = self._track([np.add(posture.tilt, posture.spine)[:1] for posture in self.postures])[:, 0]
        for _, shoulder, _, _ in ARMS.values():
            body.turn(shoulder, "left", -hang * lean)
        body.joints[:, CARRIED] += self._world(moved)[:, None]

    def _hips(self, posture: Posture, rest: Array) -> Array:
        """Where a posture has the pelvis (3,)."""
        if posture.pelvis is None:
            return rest
        if not posture.over:
            return self._tall(np.array(posture.pelvis), rest)
        foot = self._floor(self.body.joints[:, LEGS[posture.over][2]]).mean(0)
        if posture.over in posture.feet:
            foot = np.array(posture.feet[posture.over].at) * np.array([SIGN[posture.over], 1.0, 1.0])
        return self._tall(np.array(posture.pelvis), rest) + foot * np.array([1.0, 0.0, 1.0])

    def _tall(self, pelvis: Array, rest: Array) -> Array:
        """Adapt the place of a pelvis that is high over the floor to the height at which this body stands."""
        share = np.clip((pelvis[1] - _LOW) / (_STANDS - _LOW), 0.0, 1.0)
        return pelvis + np.array([0.0, share * (rest[1] - _STANDS), 0.0])

    def _turn(self, joint: int, angles: Array) -> None:
        """Rotate what hangs on a joint by (T, 3) degrees: forward, then to the right, then to the left."""
        besides = _HIPS if joint == 0 else ()
        for axis, degrees in zip(("left", "forward", "up"), angles.T, strict=True):
            if np.any(degrees):
                self.body.turn(joint, axis, degrees, besides=besides)

    def _leg(self, side: str) -> None:
        hip, knee, ankle, toe = LEGS[side]
        joints = self.body.joints
        sign = self._outward(side)
        own, pointed = self._floor(joints[:, ankle]) * sign, ((joints[:, toe] - joints[:, ankle]) @ self.axes.T) * sign
        rest, towards = own.mean(0), pointed.mean(0)
        feet = [posture.feet.get(side) for posture in self.postures]
        if any(feet):
            clock = self.clocks[side]
            free = self._track([[0.0 if foot else 1.0] for foot in feet], clock=clock)
            put = self._track(self.places[side], _SMOOTH_FEET, clock=clock) + free * (own - rest)
            put[:, 1] += self._lifts(side)
            toes = self._track(
                [normalize(np.array(foot.toes if foot and foot.toes else towards)) for foot in feet], clock=clock
            )
            toes = normalize(toes + free * (normalize(pointed) - normalize(towards)))
            joints[:, ankle] = self.origin + self._world(put, side)
            joints[:, toe] = joints[:, ankle] + BONE_LENGTHS[toe] * self._world(toes, side)
        pole = self._track(
            [normalize(np.array(posture.knees.get(side, self.bends[side]))) for posture in self.postures]
        )
        pole, aside = self._world(pole, side), self._world(np.array(_KNEE_LIFT), side)
        lengths = (BONE_LENGTHS[knee], BONE_LENGTHS[ankle])
        for _ in range(_LIFTS):
            joints[:, knee], _ = two_bones(joints[:, hip], joints[:, ankle], pole, lengths)
            sunk = np.clip((_KNEE_ROOM - joints[:, knee, 1]) / _KNEE_ROOM, 0.0, 2.0)
            if not sunk.any():
                break
            pole = normalize(pole) + blurred(sunk, 2.0)[:, None] * aside

    def _bend(self, side: str) -> Array:
        """Where a knee of the idle points (3,); a straight one, where the foot does."""
        hip, knee, ankle, toe = (self.body.joints[:, joint] for joint in LEGS[side])
        axis = normalize(ankle - hip)
        aside = knee - hip - axis * np.einsum("ti,ti->t", knee - hip, axis)[:, None]
        pointed = (toe - ankle) * np.array([1.0, 0.0, 1.0])
        return self._floor(self.origin + (aside + _STRAIGHT * normalize(pointed)).mean(0)) * self._outward(side)

    def _places(self, side: str) -> Array:
        """Where each posture has an ankle (N, 3); a foot that no posture sets is where the idle has it."""
        _, _, ankle, toe = LEGS[side]
        joints, sign = self.body.joints, self._outward(side)
        rest = (self._floor(joints[:, ankle]) * sign).mean(0)
        towards = ((joints[:, toe] - joints[:, ankle]) @ self.axes.T).mean(0)
        flat = np.array([0.0, rest[1] - _ANKLE, 0.0])
        raised = np.array([0.0, rest[1] + BONE_LENGTHS[toe] * normalize(towards)[1] - _TOE, 0.0])
        feet = [posture.feet.get(side) for posture in self.postures]
        return np.array([foot.at + (raised if foot.toes else flat) if foot else rest for foot in feet])

    def _steps(self, side: str) -> Array:
        """Metres (N - 1,) of the step of a foot to the place of each posture but the first; 0 where it makes none."""
        places = self.places[side]
        far = np.linalg.norm(np.diff(places, axis=0)[:, [0, 2]], axis=-1)
        feet = [posture.feet.get(side) for posture in self.postures[1:]]
        drags = np.array([foot is not None and foot.drags for foot in feet], bool)
        low = np.maximum(places[1:, 1], places[:-1, 1]) < _FLOOR
        return np.where((far > _STEP) & low & ~drags, far, 0.0)

    def _clocks(self) -> dict[str, Array]:
        """Seconds at which each foot is: where both step between two postures of a body on its feet, the one that goes
        farther takes the first half of the time, and the other one the second."""
        steps = np.stack([self._steps(side) for side in LEGS])
        up = np.array([_STANDS if posture.pelvis is None else posture.pelvis[1] for posture in self.postures])
        clocks = np.stack([self.t] * len(LEGS))
        for k, lasts in enumerate(np.diff(self.times)):
            if not steps[:, k].all() or lasts < _STEPS_S or max(up[k], up[k + 1]) < _LOW:
                continue
            now = (self.times[k] <= self.t) & (self.t < self.times[k + 1])
            share = (self.t[now] - self.times[k]) / lasts
            for place, foot in enumerate(np.argsort(-steps[:, k], kind="stable")):
                clocks[foot, now] = self.times[k] + lasts * np.clip(2 * share - place, 0.0, 1.0)
        return dict(zip(LEGS, clocks, strict=True))

    def _lifts(self, side: str) -> Array:
        """Extra height (T,) of a foot that steps."""
        lift = np.zeros(len(self.t))
        for k, far in enumerate(self._steps(side)):
            if far:
                within = (self.clocks[side] - self.times[k]) / (self.times[k + 1] - self.times[k])
                lift += min(0.12, 0.05 + 0.2 * far) * np.sin(np.pi * np.clip(within, 0.0, 1.0))
        return blurred(lift, _SMOOTH_FEET)

    def _arm(self, side: str) -> None:
        hands = [posture.hands.get(side) for posture in self.postures]
        if not any(hands) and all(posture.pelvis is None for posture in self.postures):
            return
        joints = self.body.joints
        _, shoulder, elbow, wrist = ARMS[side]
        share: dict[HandPlace | None, Array] = {}
        for hand, weight in zip(hands, self._weights().T, strict=True):
            share[hand] = share.get(hand, 0.0) + weight[:, None]
        target, pole = np.zeros((len(self.t), 3)), np.zeros((len(self.t), 3))
        for hand, weight in share.items():
            point, towards = self._anchored(hand, side) if hand else self._held(side)
            target += weight * (point - joints[:, shoulder])
            pole += weight * normalize(towards)
        free = share.get(None, np.zeros((len(self.t), 1)))
        target += 4 * free * (1 - free) * (np.array(_VIA) @ self._trunk_axes(side))
        target, pole = (blurred(one, _SMOOTH) for one in (target, pole))
        distance = np.linalg.norm(target, axis=-1, keepdims=True)
        target *= np.clip(distance, _LEAST_REACH, _ARM_REACH * (BONE_LENGTHS[elbow] + BONE_LENGTHS[wrist])) / distance
        lengths = (BONE_LENGTHS[elbow], BONE_LENGTHS[wrist])
        wrists = self._clear(joints[:, shoulder] + target, side)
        wrists[:, 1] = np.maximum(wrists[:, 1], _LOWEST)
        for _ in range(2):  # elbows that would be in the floor are lifted
            joints[:, elbow], joints[:, wrist] = two_bones(joints[:, shoulder], wrists, pole, lengths)
            sunk = np.clip((_LIFTED - joints[:, elbow, 1]) / _LIFTED, 0.0, 2.0)
            lift = self._world(np.array(_ELBOW_LIFT), side)
            pole = normalize(pole) + blurred(sunk, 2.0)[:, None] * lift

    def _clear(self, wrists: Array, side: str) -> Array:
        """Move wrists (T, 3) that would go through the trunk or the thigh away from it."""
        joints, out = self.body.joints, self._world(np.array([_OUT, 0.0, 0.0]), side)
        for (a, b), room in ((_TRUNK, _TRUNK_ROOM), (LEGS[side][:2], _THIGH_ROOM)):
            bone = joints[:, b] - joints[:, a]
            along = np.einsum("ti,ti->t", wrists - joints[:, a], bone) / np.einsum("ti,ti->t", bone, bone)
            nearest = joints[:, a] + np.clip(along, 0.0, 1.0)[:, None] * bone
            away = wrists - nearest
            short = np.maximum(room - np.linalg.norm(away, axis=-1, keepdims=True), 0.0)
            wrists = wrists + blurred(short * normalize(away + out), _SMOOTH)
        return wrists

    def _weights(self) -> Array:
        """Share (T, number of postures) of each posture in a hand's place; they sum to 1."""
        k = np.clip(np.searchsorted(self.times, self.t, side="right") - 1, 0, len(self.times) - 2)
        within = eased((self.t - self.times[k]) / (self.times[k + 1] - self.times[k]))
        weights = np.zeros((len(self.t), len(self.times)))
        rows = np.arange(len(self.t))
        weights[rows, k], weights[rows, k + 1] = 1 - within, within
        return weights

    def _held(self, side: str) -> tuple[Array, Array]:
        """The wrist (T, 3) where the arm of the idle has it, and where the elbow points."""
        joints = self.body.joints
        _, shoulder, elbow, wrist = ARMS[side]
        return joints[:, wrist], joints[:, elbow] - 0.5 * (joints[:, shoulder] + joints[:, wrist])

    def _chest(self) -> Array:
        """The middle of the shoulders (T, 3)."""
        return self.body.joints[:, [arm[1] for arm in ARMS.values()]].mean(1)

    def _trunk_axes(self, side: str) -> Array:
        """Axes of the trunk (T, 3, 3) in rows: outward, up, forward."""
        middle = self._chest()
        up = normalize(middle - self.body.joints[:, 0])
        across = self.body.joints[:, ARMS[side][1]] - middle
        out = normalize(across - up * np.einsum("ti,ti->t", across, up)[:, None])
        return np.stack([out, up, SIGN[side] * cross(out, up)], axis=1)

    def _anchored(self, hand: HandPlace, side: str) -> tuple[Array, Array]:
        """The point (T, 3) of a hand, and where the elbow points."""
        joints = self.body.joints
        at, elbow = np.array(hand.at), np.array(hand.elbow)
        if hand.anchor == "trunk":
            axes = self._trunk_axes(side)
            return self._chest() + at @ axes, elbow @ axes
        anchors = {
            "floor": self.origin,
            "shoulder": joints[:, ARMS[side][1]],
            "knee": joints[:, LEGS[side][1]],
        }
        towards = np.broadcast_to(self._world(elbow, side), (len(self.t), 3))
        return anchors[hand.anchor] + np.broadcast_to(self._world(at, side), (len(self.t), 3)), towards
