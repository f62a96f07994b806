"""Retarget a motion onto a rig.

The rest pose of the rig is aligned limb by limb with that of the motion's body (`align.py`); then its parts turn as the
source's, in the world. The spine is shared out over the joints that the rig has (`spine.py`). The hips travel at the
scale of the legs, and the legs are solved so that feet stand where the source's stand (`legs.py`). Joints along a limb
share its twist, and `ik_*` joints follow hands and feet (`helpers.py`). All other joints keep their rest pose.
"""

from __future__ import annotations

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.filters import smooth
from marey.motion.retarget.align import Alignment
from marey.motion.retarget.arms import reach_hands
from marey.motion.retarget.legs import UP, Stance, flatten_toes, make_legs, solve_legs
from marey.motion.retarget.posed import PosedRig
from marey.motion.retarget.source import Source
from marey.motion.retarget.spine import blend, shares, spans
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.parts import SIDES
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import Array, conjugate, multiply, normalize, rotate


def retarget(source: Source, target: RigBody, *, hands: bool = False) -> RiggedMotion:
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
    posed = PosedRig(target, turns, place)
    if hands:
        reach_hands(source, stance, posed, hips)
    return posed.motion(source)


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
    return stance.scale * middle + stance.shift(ahead, source.fps)


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


def _spine(source: Source, target: RigBody) -> dict[str, Array]:
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


def _neck(source: Source, target: RigBody) -> dict[str, Array]:
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
