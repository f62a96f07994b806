"""Retarget a motion onto a rig.

The rest pose of the rig is aligned limb by limb with that of the motion's body (`align.py`); then its parts turn as the
source's, in the world. The spine is shared out over the joints that the rig has (`spine.py`). The hips travel at the
scale of the legs, and the legs are solved so that feet stand where the source's stand (`legs.py`). Joints along a limb
share its twist, and `ik_*` joints follow hands and feet (`helpers.py`). All other joints keep their rest pose.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.filters import smooth
from marey.motion.retarget.align import IDENTITY, Alignment
from marey.motion.retarget.arms import reach_hands
from marey.motion.retarget.helpers import share_twists
from marey.motion.retarget.legs import STEADY, UP, Stance, flatten_toes, make_legs, solve_legs
from marey.motion.retarget.source import Source
from marey.motion.retarget.spine import blend, shares, spans
from marey.motion.rigs.body import Body
from marey.motion.rigs.parts import SIDES
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import Array, between, conjugate, multiply, normalize, rotate

MOVES = 1e-6
"""Metres by which a joint's translation must differ from the rest pose, to be written."""


def retarget(source: Source, target: Body, *, hands: bool = False) -> RiggedMotion:
    """Put a motion on a rig.

    Args:
        source: the motion (`source_of`).
        target: the rig with its parts.
        hands: bring the hands where the source's hands are, at the scale of the legs and relative to the hips, by
            two-bone inverse kinematics; otherwise arms keep their directions.

    Returns:
        The motion on the rig, facing at first as its rest pose faces.

    Raises:
        InvalidInput: the motion holds numbers that are not finite.
    """
    if not np.isfinite(source.joints).all():
        raise InvalidInput("the motion holds NaN or infinite numbers", where=source.body.rig.name)
    alignment = Alignment(source.body, target)
    turns = _part_turns(source, alignment)
    stance = Stance(alignment)
    ahead = _ahead(source)
    hips = _hips(source, stance, ahead)
    legs = make_legs(source, stance, turns, ahead)
    drop = solve_legs(source, stance, legs, hips, turns["hips"], ahead)
    hips = hips - drop[:, None] * UP
    for leg in legs:
        turns[f"{leg.side}_upper_leg"], turns[f"{leg.side}_lower_leg"] = leg.thigh, leg.shin
        turns[f"{leg.side}_foot"] = leg.foot
        if not _moves(source, f"{leg.side}_toes"):
            turns[f"{leg.side}_toes"] = flatten_toes(turns[f"{leg.side}_toes"], leg.hold)
    place = hips - rotate(turns["hips"], target.hips - target.at("hips"))
    posed = Posed(target, turns, place)
    if hands:
        reach_hands(source, stance, posed, hips)
    return posed.motion(source)


class Posed:
    """The joints of a target by the turns of its parts.

    Args:
        target: the rig with its parts.
        turns: (T, 4) of each part from the upright rest pose, in the world.
        place: (T, 3) where the hips are, metres.
    """

    def __init__(self, target: Body, turns: dict[str, Array], place: Array) -> None:
        self.target, self.place = target, place
        self.turns = {part: turn for part, turn in turns.items() if target.has(part)}

    def spread(self) -> tuple[Array, Array]:
        """Return turns from the upright rest pose (T, J, 4) and places (T, J, 3) of all joints; those above the hips
        keep their rest pose."""
        rig, parts = self.target.rig, self.target.map.parts
        frames = len(self.place)
        turned, places = np.empty((frames, len(rig), 4)), np.empty((frames, len(rig), 3))
        by_joint = {parts[part]: turn for part, turn in self.turns.items()}
        hips, rest = parts["hips"], self.target.places
        for joint, parent in enumerate(rig.parents):
            if joint in by_joint:
                turned[:, joint] = by_joint[joint]
            else:
                turned[:, joint] = conjugate(self.target.upright) if parent < 0 else turned[:, parent]
            if joint == hips:
                places[:, joint] = self.place
            elif parent < 0:
                places[:, joint] = rig.positions[joint]
            else:
                places[:, joint] = places[:, parent] + rotate(turned[:, parent], rest[joint] - rest[parent])
        return turned, places

    def motion(self, source: Source) -> RiggedMotion:
        """Return the motion in local poses of the rig, with helpers, facing as the rig's rest pose faces."""
        target, rig = self.target, self.target.rig
        turned, places = self.spread()
        share_twists(target, turned)
        for joint, part in target.map.follows.items():
            leader = target.map.parts[part]
            turned[:, joint] = turned[:, leader]
            away = target.places[joint] - target.places[leader]
            places[:, joint] = places[:, leader] + rotate(turned[:, leader], away)
        fixed = [joint for joint in range(len(rig)) if _over(target, joint)]
        face = _facing(target.upright)
        world = multiply(face, multiply(turned, multiply(target.upright, rig.orientations)))
        places = rotate(face, places)
        world[:, fixed], places[:, fixed] = rig.orientations[fixed], rig.positions[fixed]
        return _local(source, target, world, places)


def _over(target: Body, joint: int) -> bool:
    """Return True if a joint neither moves nor hangs on one that does: it is over the hips or beside them."""
    moving = {target.map.parts["hips"], *target.map.follows}
    while joint >= 0:
        if joint in moving:
            return False
        joint = target.rig.parents[joint]
    return True


def _local(source: Source, target: Body, world: Array, places: Array) -> RiggedMotion:
    rig = target.rig
    rotations, translations, moving = local_poses(rig, world, places)
    about = {"name": rig.name, "sha256": rig.sha256, "family": target.map.family}
    manifest = {**source.manifest, "rig": about}
    hips = target.map.parts["hips"]
    return RiggedMotion(rig, rotations, translations, moving, source.contacts, source.fps, hips, manifest)


def local_poses(rig: Rig, world: Array, places: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return local rotations (T, J, 4), translations (T, J, 3) and which joints move (J,), see `RiggedMotion`, of
    orientations (T, J, 4) and places (T, J, 3) in the world."""
    rotations, translations = world.copy(), places.copy()
    inner = [joint for joint, parent in enumerate(rig.parents) if parent >= 0]
    over = [rig.parents[joint] for joint in inner]
    back = conjugate(world[:, over])
    rotations[:, inner] = multiply(back, world[:, inner])
    translations[:, inner] = rotate(back, places[:, inner] - places[:, over])
    moving = np.abs(translations - rig.offsets).max(axis=(0, 2)) > MOVES
    translations[:, ~moving] = rig.offsets[~moving]
    return rotations, translations, moving


def _facing(upright: Array) -> Array:
    """Return the turn (4,) about the vertical from +Z to where a rest pose faces; none if it does not stand upright."""
    if rotate(upright, UP) @ UP < 0.99:
        return IDENTITY
    ahead = rotate(conjugate(upright), np.array([0.0, 0.0, 1.0]))
    return between(np.array([0.0, 0.0, 1.0]), ahead * np.array([1.0, 0.0, 1.0]))


def _moves(source: Source, part: str) -> bool:
    """Return True if a part turns against the one that it hangs on."""
    if not source.body.has(part):
        return False
    joint = source.body.map.parts[part]
    parent = source.body.rig.parents[joint]
    apart = multiply(conjugate(source.turned[:, parent]), source.turned[:, joint])
    return bool(np.abs(apart[:, 1:]).max() > 1e-3)


def _ahead(source: Source) -> Array:
    """Return where the body faces (T, 3), in the floor plane."""
    across = source.places("left_upper_leg") - source.places("right_upper_leg")
    if source.body.has("left_upper_arm") and source.body.has("right_upper_arm"):
        across = across + source.places("left_upper_arm") - source.places("right_upper_arm")
    return normalize(smooth(normalize(np.cross(across, UP)), 0.2 * source.fps))


def _hips(source: Source, stance: Stance, ahead: Array) -> Array:
    """Return the goal (T, 3) of the middle between the target's hip joints, metres."""
    middle = (source.places("left_upper_leg") + source.places("right_upper_leg")) / 2
    shift = stance.ahead * smooth(ahead, STEADY * source.fps)
    return stance.scale * middle + shift + stance.rise * UP


def _part_turns(source: Source, alignment: Alignment) -> dict[str, Array]:
    """Return how far each part of the target turns (T, 4) from its upright rest pose."""
    target = alignment.target
    turned = {"hips": source.turns("hips")}
    turned |= _spine(source, target)
    turned |= _neck(source, target)
    chest = source.turned[:, source.body.map.chest]
    for side in SIDES:
        turned |= _limb(source, side, ("shoulder", "upper_arm", "lower_arm", "hand"), chest)
        turned |= _limb(source, side, ("upper_leg", "lower_leg", "foot", "toes"), turned["hips"])
    parts = {**{part: alignment.turns[part] for part in turned}}
    return {part: multiply(turn, parts[part]) for part, turn in turned.items()}


def _spine(source: Source, target: Body) -> dict[str, Array]:
    own, theirs = target.map.spine, source.body.map.spine
    hips = source.turns("hips")
    chest = source.turned[:, source.body.map.chest]
    if not own:
        return {}
    if len(theirs) < 2:  # nothing to share out: bend evenly from the hips to the chest
        weights = [(number + 1) / len(own) for number in range(len(own))]
        turns = [blend([hips, chest], np.array([1 - weight, weight])) for weight in weights]
    else:
        table = shares(spans(target, own, target.top), spans(source.body, theirs, source.body.top))
        turns = [blend([source.turned[:, joint] for joint in theirs], row) for row in table]
        turns[-1] = chest
    return {f"spine{number}": turn for number, turn in enumerate(turns, start=1)}


def _neck(source: Source, target: Body) -> dict[str, Array]:
    own, theirs = target.map.neck, source.body.map.neck
    chest = source.turned[:, source.body.map.chest]
    head = source.turns("head") if source.body.has("head") else chest
    if theirs and own and target.has("head") and source.body.has("head"):
        table = shares(spans(target, own, target.at("head")), spans(source.body, theirs, source.body.at("head")))
        turns = [blend([source.turned[:, joint] for joint in theirs], row) for row in table]
    else:
        turns = [blend([chest, head], np.array([0.5, 0.5])) for _ in own]
    return {**{f"neck{number}": turn for number, turn in enumerate(turns, start=1)}, "head": head}


def _limb(source: Source, side: str, parts: tuple[str, ...], base: Array) -> dict[str, Array]:
    """Return the turns of a limb; a part that the source does not have turns with the one before it."""
    turns: dict[str, Array] = {}
    for part in parts:
        name = f"{side}_{part}"
        base = source.turns(name) if source.body.has(name) else base
        turns[name] = base
    return turns
