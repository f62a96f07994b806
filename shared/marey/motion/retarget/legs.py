"""Legs of a retargeted body: feet stand where the source's stand, at the scale of the legs, on the target's own floor.

Toes have goals; ankles follow from the turn of the foot, knees by two-bone inverse kinematics. While a foot swings, its
ankle goes where the source's goes, so that a knee bends as the source's although the foot is longer or steeper. Where a
leg is too short, the heel comes up, then the hips come down (`marey.motion.legs`).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from marey.motion.filters import smooth, smooth_above
from marey.motion.legs import draw_foot, needed_drop, soft_distance, two_bone_knee
from marey.motion.retarget.align import Alignment
from marey.motion.retarget.source import Source
from marey.motion.rigs.parts import SIDES
from marey.motion.rotations import Array, between, length, multiply, normalize, rotate

STEADY = 0.25
"""Seconds over which sideways corrections of the stance are smoothed."""
UP = np.array([0.0, 1.0, 0.0])


@dataclass
class Leg:
    """A leg of the target while it is solved; (T, 4) turns from the upright rest pose, (T, 3) goals in metres.

    Attributes:
        thigh, shin, foot: turns of its parts.
        hip: goal of the hip joint.
        toe: goal of the toe, or of the ankle where a body has no toes.
        hold: (T,) from 0 to 1, how firmly the foot stands.
    """

    side: str
    thigh: Array = field(repr=False)
    shin: Array = field(repr=False)
    foot: Array = field(repr=False)
    toe: Array = field(repr=False)
    hold: Array = field(repr=False)


class Stance:
    """Heights and lengths that place the target's feet and hips by the source's.

    Attributes:
        scale: ratio of the legs, target to source.
        toes: True if both bodies have toes.
    """

    def __init__(self, alignment: Alignment) -> None:
        self.source, self.target = alignment.source, alignment.target
        self.scale = self.target.leg / self.source.leg
        parts = [f"{side}_toes" for side in SIDES]
        self.toes = all(body.has(part) for body in (self.source, self.target) for part in parts)
        self.feet = {side: self._foot(alignment, side) for side in SIDES}
        self._theirs = {side: self._their_foot(side) for side in SIDES}
        ankles = [self._height(alignment, side) for side in SIDES]
        self.heights = {side: height for side, (height, _, _) in zip(SIDES, ankles, strict=True)}
        self.their_heights = {side: height for side, (_, height, _) in zip(SIDES, ankles, strict=True)}
        self.rise = float(np.mean([rise for _, _, rise in ankles]))
        ahead = [self.scale * self._theirs[side][2] - self.feet[side][2] for side in SIDES]
        self.ahead = float(np.mean(ahead)) if self.toes else 0.0
        widths = [np.linalg.norm(b.at("left_upper_leg") - b.at("right_upper_leg")) for b in (self.target, self.source)]
        self.wider = float(widths[0] - self.scale * widths[1]) / 2

    def shift(self, ahead: Array, fps: float) -> Array:
        """Return by how much (T, 3) hips, and ankles of flat feet, are from the source's at scale, in metres.

        Args:
            ahead: (T, 3) direction in which the body faces, in the floor plane.
        """
        return self.ahead * smooth(ahead, STEADY * fps) + self.rise * UP

    def _their_foot(self, side: str) -> Array:
        names = f"{side}_foot", f"{side}_toes"
        return self.source.at(names[1]) - self.source.at(names[0]) if self.toes else np.zeros(3)

    def _foot(self, alignment: Alignment, side: str) -> Array:
        """Return the vector (3,) from ankle to toe of the target in the source's rest pose."""
        if not self.toes:
            return np.zeros(3)
        names = f"{side}_foot", f"{side}_toes"
        return rotate(alignment.turns[names[0]], self.target.at(names[1]) - self.target.at(names[0]))

    def _height(self, alignment: Alignment, side: str) -> tuple[float, float, float]:
        """Return the heights over the floor of a standing toe (or ankle) of target and source, and how much higher the
        target's ankle is than the source's at scale."""
        part = f"{side}_toes" if self.toes else f"{side}_foot"
        theirs = float(self.source.at(part)[1] - self.source.floor)
        trusted = self.target.standing and not alignment.exact
        own = float(self.target.at(part)[1] - self.target.floor) if trusted else self.scale * theirs
        rise = (own - self.feet[side][1]) - self.scale * (theirs - self._theirs[side][1])
        return own, theirs, float(rise)


def make_legs(source: Source, stance: Stance, turns: dict[str, Array], ahead: Array) -> list[Leg]:
    """Return both legs with their goals.

    Args:
        turns: (T, 4) of the target's parts.
        ahead: (T, 3) direction in which the body faces, in the floor plane.
    """
    legs: list[Leg] = []
    for number, side in enumerate(SIDES):
        part = f"{side}_toes" if stance.toes else f"{side}_foot"
        toe = stance.scale * source.places(part)
        toe[:, 1] += stance.heights[side] - stance.scale * stance.their_heights[side]
        stands = source.contacts[:, 2 * number + int(stance.toes)]
        hold = smooth_above(stands.astype(np.float64), 0.04 * source.fps)
        thigh, shin, foot = (turns[f"{side}_{each}"] for each in ("upper_leg", "lower_leg", "foot"))
        if stance.toes:
            toe = _swung(source, stance, side, toe, foot, hold, ahead)
        aside = np.cross(UP, ahead) * (stance.wider * (1 - 2 * number))
        toe += _held(smooth(aside, STEADY * source.fps), stands)
        legs.append(Leg(side, thigh, shin, foot, toe, hold))
    return legs


def _swung(source: Source, stance: Stance, side: str, toe: Array, foot: Array, hold: Array, ahead: Array) -> Array:
    """Return goals (T, 3) of a toe that bring the ankle where the source's is as far as the foot does not stand, over
    the floor wherever they were."""
    body = stance.target
    ankle = toe - rotate(foot, body.at(f"{side}_toes") - body.at(f"{side}_foot"))
    wanted = stance.scale * source.places(f"{side}_foot") + stance.shift(ahead, source.fps)
    moved = toe + (1 - hold)[:, None] * (wanted - ankle)
    moved[:, 1] = np.maximum(moved[:, 1], np.minimum(toe[:, 1], stance.heights[side]))
    return moved


def solve_legs(source: Source, stance: Stance, legs: list[Leg], hips: Array, pelvis: Array, ahead: Array) -> Array:
    """Turn thighs, shins and feet until the toes are at their goals; return by how much (T,) the hips come down.

    Args:
        hips: (T, 3) goal of the middle between the hip joints, metres.
        pelvis: (T, 4) turn of the hips.
        ahead: (T, 3) direction that knees bend to.
    """
    body, fps = stance.target, source.fps
    drops: list[Array] = []
    for leg in legs:
        hip = hips + rotate(pelvis, body.at(f"{leg.side}_upper_leg") - body.hips)
        needed = needed_drop(_chain(leg, stance, hip), hip, _foot_places(leg, stance))
        drops.append(leg.hold * np.maximum(needed - stance.scale * _own_drop(source, leg.side), 0.0))
    drop = smooth_above(np.max(drops, axis=0), 0.1 * fps)
    for leg in legs:
        hip = hips + rotate(pelvis, body.at(f"{leg.side}_upper_leg") - body.hips) - drop[:, None] * UP
        _solve(leg, stance, hip, ahead, fps)
    return drop


def _solve(leg: Leg, stance: Stance, hip: Array, ahead: Array, fps: float) -> None:
    was = _chain(leg, stance, hip)
    foot = _foot_places(leg, stance)
    wanted = soft_distance(was, length(foot[:, -1] - hip), fps)
    moved = draw_foot(foot, hip, wanted, leg.hold) if stance.toes else foot
    if not stance.toes:
        across = foot[:, 0] - hip
        moved = (hip + normalize(across) * np.minimum(wanted, length(across))[:, None])[:, None]
    else:
        leg.foot = multiply(between(foot[:, 0] - foot[:, 1], moved[:, 0] - moved[:, 1]), leg.foot)
    knee = two_bone_knee(was, hip, moved[:, -1], ahead)
    leg.thigh = multiply(between(was[:, 1] - was[:, 0], knee - hip), leg.thigh)
    leg.shin = multiply(between(was[:, 2] - was[:, 1], moved[:, -1] - knee), leg.shin)


def _chain(leg: Leg, stance: Stance, hip: Array) -> Array:
    """Return hip, knee and ankle (T, 3, 3) by the turns of thigh and shin."""
    places = [stance.target.at(f"{leg.side}_{part}") for part in ("upper_leg", "lower_leg", "foot")]
    knee = hip + rotate(leg.thigh, places[1] - places[0])
    return np.stack([hip, knee, knee + rotate(leg.shin, places[2] - places[1])], axis=1)


def _own_drop(source: Source, side: str) -> Array:
    """Return what `needed_drop` says of the source itself: so stretched are its legs."""
    leg = np.stack([source.places(f"{side}_{part}") for part in ("upper_leg", "lower_leg", "foot")], axis=1)
    end = f"{side}_toes" if source.body.has(f"{side}_toes") else f"{side}_foot"
    return needed_drop(leg, leg[:, 0], np.stack([source.places(end), leg[:, 2]], axis=1))


def _foot_places(leg: Leg, stance: Stance) -> Array:
    """Return toe and ankle (T, 2, 3) at the goal, or the ankle alone (T, 1, 3)."""
    if not stance.toes:
        return leg.toe[:, None]
    foot = stance.target.at(f"{leg.side}_toes") - stance.target.at(f"{leg.side}_foot")
    return np.stack([leg.toe, leg.toe - rotate(leg.foot, foot)], axis=1)


def _held(shift: Array, stands: NDArray[np.bool_]) -> Array:
    """Return shifts (T, 3) that are constant while a foot stands, and go over from one to the next in between."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], stands, [False]]).astype(np.int8))).reshape(-1, 2)
    if not len(edges) or not np.abs(shift).max() > 1e-9:
        return shift
    times = np.concatenate([[begin, end - 1] for begin, end in edges])
    values = np.concatenate([[shift[begin:end].mean(axis=0)] * 2 for begin, end in edges])
    return np.stack([np.interp(np.arange(len(shift)), times, values[:, axis]) for axis in range(3)], axis=-1)


def flatten_toes(toes: Array, hold: Array) -> Array:
    """Return turns (T, 4) of toes that lie flat while they stand, for a source whose toes do not move by themselves."""
    up = np.broadcast_to(UP, (len(toes), 3))
    flat = multiply(between(rotate(toes, up), up), toes)
    sign = np.where(np.einsum("ti,ti->t", flat, toes) < 0, -1.0, 1.0)[:, None]
    return normalize((1 - hold)[:, None] * toes + hold[:, None] * sign * flat)
