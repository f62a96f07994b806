"""Turn the rest pose of one body to that of another, limb by limb.

Directions of arms and legs decide, whatever the axes of the joints are: an A-pose becomes a T-pose. The trunk, the
collar bones and the pitch of the feet are left as the character was built where its rest pose stands. If both bodies
have the same shape, or the rest pose does not stand, they are turned by their directions too.
"""

from __future__ import annotations

import numpy as np

from marey.motion.retarget.spine import along, spans
from marey.motion.rigs.body import RigBody, frame
from marey.motion.rigs.parts import SIDES
from marey.motion.rotations import Array, between, from_matrix, multiply, rotate

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])
SAME = 0.01
"""Relative difference of the distances within pelvis and chest up to which two bodies have the same shape."""


class Alignment:
    """Rotations from the upright rest pose of a target to that of a source.

    Attributes:
        turns: (4,) of each part of the target, in the world.
        exact: True if both bodies have the same shape, so that every joint can be placed like the source's.
    """

    def __init__(self, source: RigBody, target: RigBody) -> None:
        self.source, self.target = source, target
        self.exact = _same_shape(source, target)
        self.by_direction = self.exact or not target.standing or not source.standing
        self.turns: dict[str, Array] = {"hips": self._hips()}
        self._spine()
        self._neck()
        for side in SIDES:
            self._arm(side)
            self._leg(side)

    def _hips(self) -> Array:
        if not self.exact:
            return IDENTITY
        return _fit(_pelvis(self.source), _pelvis(self.target))

    def _spine(self) -> None:
        chain, theirs = self.target.map.spine, self.source.map.spine
        turn = self.turns["hips"]
        theirs = theirs or (self.source.map.parts["hips"],)
        bones = spans(self.target, chain, self.target.top) if chain else np.zeros((0, 2))
        begins, ends = (along(self.source, theirs, self.source.top, column) for column in bones.T)
        for number in range(1, len(chain) + 1):
            if self.by_direction and number == len(chain):
                turn = self._chest(turn)
            elif self.by_direction:
                own = self.target.places[chain[number]] - self.target.places[chain[number - 1]]
                turn = _aim(turn, own, ends[number - 1] - begins[number - 1])
            self.turns[f"spine{number}"] = turn

    def _chest(self, turn: Array) -> Array:
        if self.exact:
            return _fit(_ribs(self.source), _ribs(self.target))
        frames = [_chest_frame(body) for body in (self.source, self.target)]
        return turn if frames[0] is None or frames[1] is None else from_matrix(frames[0] @ frames[1].T)

    def _neck(self) -> None:
        chain = self.target.map.neck
        turn = self.turns[f"spine{len(self.target.map.spine)}"] if self.target.map.spine else self.turns["hips"]
        heads = self.target.has("head") and self.source.has("head")
        for number in range(1, len(chain) + 1):
            if self.by_direction and heads and self.source.map.neck:
                own = self.target.at("head") - self.target.at("neck1")
                turn = _aim(turn, own, self.source.at("head") - self.source.at("neck1"))
            self.turns[f"neck{number}"] = turn
        self.turns["head"] = turn

    def _arm(self, side: str) -> None:
        spine = self.target.map.spine
        turn = self.turns[f"spine{len(spine)}"] if spine else self.turns["hips"]
        self.turns[f"{side}_shoulder"] = turn
        if self.by_direction:
            turn = self.turns[f"{side}_shoulder"] = self._bone(turn, f"{side}_shoulder", f"{side}_upper_arm")
        turn = self.turns[f"{side}_upper_arm"] = self._bone(turn, f"{side}_upper_arm", f"{side}_lower_arm")
        turn = self.turns[f"{side}_lower_arm"] = self._bone(turn, f"{side}_lower_arm", f"{side}_hand")
        self.turns[f"{side}_hand"] = self._bone(turn, f"{side}_hand", f"{side}_middle1")

    def _leg(self, side: str) -> None:
        hips = self.turns["hips"]
        turn = self.turns[f"{side}_upper_leg"] = self._bone(hips, f"{side}_upper_leg", f"{side}_lower_leg")
        turn = self.turns[f"{side}_lower_leg"] = self._bone(turn, f"{side}_lower_leg", f"{side}_foot")
        names = f"{side}_foot", f"{side}_toes"
        if self.by_direction:
            turn = self._bone(turn, *names)
        else:  # the soles are flat in both rest poses: only the heading may differ
            turn = hips
            if all(body.has(name) for body in (self.source, self.target) for name in names):
                own, wanted = (_flat(body.at(names[1]) - body.at(names[0])) for body in (self.target, self.source))
                if min(np.linalg.norm(own), np.linalg.norm(wanted)) > 1e-3:
                    turn = between(own, wanted)
        self.turns[f"{side}_foot"] = self.turns[f"{side}_toes"] = turn

    def _bone(self, turn: Array, begin: str, end: str) -> Array:
        """Return the rotation that aims a bone as the source's, from the one of the bone before it."""
        if not all(body.has(name) for body in (self.source, self.target) for name in (begin, end)):
            return turn
        own, wanted = (body.at(end) - body.at(begin) for body in (self.target, self.source))
        return _aim(turn, own, wanted)


def _aim(turn: Array, own: Array, wanted: Array) -> Array:
    """Return `turn`, turned on the shortest way until it takes a bone to a wanted direction."""
    if min(np.linalg.norm(own), np.linalg.norm(wanted)) < 1e-6:
        return turn
    return multiply(between(rotate(turn, own), wanted), turn)


def _flat(vector: Array) -> Array:
    return vector * np.array([1.0, 0.0, 1.0])


def _pelvis(body: RigBody) -> Array:
    """Return the places of hips, hip joints and the beginning of the spine (4, 3)."""
    spine = body.at("spine1") if body.has("spine1") else body.top
    return np.stack([body.at("hips"), body.at("left_upper_leg"), body.at("right_upper_leg"), spine])


def _ribs(body: RigBody) -> Array:
    """Return the places of the neck and of both arms' beginnings (3, 3)."""
    begins = [f"{side}_shoulder" if body.has(f"{side}_shoulder") else f"{side}_upper_arm" for side in SIDES]
    return np.stack([body.at("neck1") if body.has("neck1") else body.top, *(body.at(name) for name in begins)])


def _chest_frame(body: RigBody) -> Array | None:
    if not (body.has("left_upper_arm") and body.has("right_upper_arm")):
        return None
    up, left = body.top - body.hips, body.at("left_upper_arm") - body.at("right_upper_arm")
    chest = body.places[body.map.chest]
    up = body.top - chest if np.linalg.norm(body.top - chest) > 0.02 * body.leg else up
    return frame(up, left) if np.linalg.norm(np.cross(up, left)) > 1e-6 else None


def _same_shape(source: RigBody, target: RigBody) -> bool:
    """Return True if pelvis, chest and limbs of both bodies are alike but for their size."""
    optional = ("left_upper_arm", "right_upper_arm", "left_shoulder", "right_shoulder", "neck1", "left_toes")
    if any(source.has(part) != target.has(part) for part in optional) or not source.has("left_upper_arm"):
        return False
    own, theirs = _measures(target), _measures(source)
    if len(own) != len(theirs):
        return False
    long = theirs > 1e-3
    ratio = own[long] / theirs[long]
    return bool((own[~long] < 1e-3).all() and np.ptp(ratio) <= SAME * ratio.mean())


def _measures(body: RigBody) -> Array:
    """Return the distances within pelvis and chest and the lengths of the limbs, as far as the body has them."""
    chains = (("upper_leg", "lower_leg", "foot", "toes"), ("shoulder", "upper_arm", "lower_arm", "hand"))
    lengths = [_distances(_pelvis(body)), _distances(_ribs(body))]
    for side in SIDES:
        for chain in chains:
            places = [body.at(f"{side}_{part}") for part in chain if body.has(f"{side}_{part}")]
            lengths.append(np.linalg.norm(np.diff(np.array(places), axis=0), axis=-1))
    return np.concatenate(lengths)


def _distances(points: Array) -> Array:
    first, second = np.triu_indices(len(points), 1)
    return np.linalg.norm(points[first] - points[second], axis=-1)


def _fit(wanted: Array, own: Array) -> Array:
    """Return the rotation (4,) that takes points (n, 3) nearest to others (n, 3), both from their middle (Kabsch)."""
    u, _, v = np.linalg.svd((wanted - wanted.mean(axis=0)).T @ (own - own.mean(axis=0)))
    flip = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ v)))])
    return from_matrix(u @ flip @ v)
