"""Bodies of other proportions, read from the rest pose of a rig or of an npz file.

A file with the joints of Marey's own exports gives its offsets, as they are. Of every other rig the map of its joints
(`marey.motion.rigs.joint_map`) gives the measures that show: lengths of arms and legs, width of the hips, length of the
trunk, places of collars, shoulders and head. Limbs and trunk get the directions of Marey's T-pose, so that an A-pose
gives the same body. The joints within pelvis and spine, which rigs place as they like, stand where Marey's stand at
that size: then feet reach the floor, and bends look as they were made.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from zipfile import ZipFile

import numpy as np

from marey.core.errors import InvalidFile, InvalidInput, MareyError
from marey.motion.body import DIGITS, STANDARD, NamedBody, standard_body, stature
from marey.motion.clip import load_npz
from marey.motion.retarget.load import load_body
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.parts import SIDES
from marey.motion.rotations import Array, dot, length, normalize
from marey.motion.skeleton import HUMANML3D, Skeleton, known_order

SHORTEST, TALLEST = 0.5, 3.0
"""Metres of stature."""
SHORTEST_BONE = 0.01
"""Metres."""
UNLIKE = 4.0
"""Times that a bone may be longer or shorter than that of the training skeleton at the same stature."""
TURNED = 60.0
"""Degrees that a bone of Marey's own joints may point away from that of the T-pose."""
LIMBS = {
    "knee": ("upper_leg", "lower_leg"),
    "ankle": ("lower_leg", "foot"),
    "foot": ("foot", "toes"),
    "elbow": ("upper_arm", "lower_arm"),
    "wrist": ("lower_arm", "hand"),
}
"""Parts at the ends of the bone that leads to a joint of a side."""


def read_body(given: Path | str, training: Skeleton, rig_map: Path | str | None = None) -> NamedBody:
    """Return the body `standard`, or the body of a rig or an npz file, for bundles trained on a skeleton.

    Args:
        given: `standard`, a reference rig, or the path of a file: an npz of Marey, or a rig
            (`marey.motion.rigs.read.READERS`).
        training: the skeleton of the bundle's training data, of 22 joints.
        rig_map: JSON file of parts and joints of the rig that override what is found.

    Raises:
        NotFound: no such file.
        InvalidFile: a file that cannot be read, or a body that no human has.
        InvalidInput: the bundle has another skeleton, the rig is unknown or has no legs, or a map that does not fit.
        TooLarge: the file is over the limits of its format.
    """
    if str(given) == STANDARD:
        return standard_body(training)
    _check_training(training, str(given))
    path = Path(given)
    if _is_motion(path):
        return _body_of_motion(path, training)
    try:
        return body_of_rig(load_body(given, rig_map), training)
    except MareyError as error:
        if error.argument == "rig":
            error.argument = "body"
            error.where = "body" if error.where == "rig" else error.where
        raise


def body_of_rig(rig: RigBody, training: Skeleton) -> NamedBody:
    """Return the body with the proportions of a rig, for bundles trained on a skeleton.

    Raises:
        InvalidInput: the bundle has another skeleton.
        InvalidFile: a body that no human has; `argument` is `body`.
    """
    where = rig.rig.name
    _check_training(training, where)
    own = _own_joints(rig, training)
    if own is None:
        return NamedBody(where, _standing(_proportions(rig, training), training, where))
    parents = [own[max(parent, 0)] for parent in training.parents]
    offsets = rig.places[own] - rig.places[parents]
    _check_pose(offsets, training, where)
    return NamedBody(where, _standing(offsets, training, where))


def _check_training(training: Skeleton, where: str) -> None:
    if training.name != HUMANML3D.name:
        raise InvalidInput(f"bodies are read for {HUMANML3D.name}; this bundle has {training.name}", where=where)


def _is_motion(path: Path) -> bool:
    """Return True if a file is an npz of Marey, and not the model of SMPL-X, which is a rig."""
    if path.suffix.lower() != ".npz":
        return False
    try:
        with ZipFile(path) as file:
            return "J_regressor.npy" not in file.namelist()
    except Exception:  # a crafted zip makes zipfile raise nearly any; reading the motion says what is wrong
        return True


def _body_of_motion(path: Path, training: Skeleton) -> NamedBody:
    skeleton = load_npz(path).skeleton
    known = known_order(skeleton.joint_names, skeleton.parents)
    if known is None or known[0].name != training.name:
        raise InvalidFile(
            f"its motion is on another skeleton than {training.name}",
            where=str(path),
            hint="Give a motion that Marey exported, or a rig.",
            argument="body",
        )
    offsets = skeleton.offsets.astype(np.float64)[list(known[1])]
    _check_pose(offsets, training, str(path))
    return NamedBody(path.name, _standing(offsets, training, str(path)))


def _own_joints(rig: RigBody, training: Skeleton) -> Sequence[int] | None:
    """Return the joint of the rig for each of the skeleton's; None if it has others. Joints above and beside them, such
    as a root bone, are left aside."""
    index = {name: joint for joint, name in enumerate(rig.rig.joint_names)}
    if not all(name in index for name in training.joint_names):
        return None
    order = [index[name] for name in training.joint_names]
    bones = zip(order, training.parents, strict=True)
    return order if all(parent < 0 or rig.rig.parents[joint] == order[parent] for joint, parent in bones) else None


def _standing(offsets: Array, training: Skeleton, where: str) -> Skeleton:
    """Return the training skeleton with other offsets (J, 3), toes on the floor."""
    offsets = offsets.copy()
    offsets[0] = 0.0
    offsets[0, 1] = -float(training.with_offsets(offsets).rest[:, 1].min())
    offsets = np.round(offsets, DIGITS) + 0.0  # no -0.0
    check_offsets(offsets, training, where)
    return training.with_offsets(offsets)


def _proportions(rig: RigBody, training: Skeleton) -> Array:
    """Return the offsets (J, 3) of the training skeleton with the proportions of a rig, equal on both sides.

    Parts that the rig does not have are those of the training skeleton, at the scale of the legs below the hips and of
    the trunk above.
    """
    own, rest = training.offsets.astype(np.float64), training.rest.astype(np.float64)
    at = dict(zip(training.joint_names, rest - rest[0], strict=True))
    legs = rig.leg / sum(float(length(own[training.index(name)])) for name in ("L_knee", "L_ankle"))
    offsets = legs * own
    for side, letter in zip(SIDES, "LR", strict=True):
        for name in ("knee", "ankle", "foot"):
            _set_limb(offsets, rig, training, f"{letter}_{name}", side)
    size = _hip_height(offsets, training) / _hip_height(own, training)
    pelvis = size * at["L_hip"] * [0.0, 1.0, 0.0]  # from there to the middle of the hips
    trunk, neck = _trunk(rig, at, size)
    for joint, name in enumerate(training.joint_names):
        if not name.endswith(("hip", "knee", "ankle", "foot")):
            offsets[joint] = trunk * own[joint]
    chest = neck - trunk * (at["neck"] - at["spine3"])  # in the rig
    for side, letter in zip(SIDES, "LR", strict=True):
        hip, collar, shoulder = (training.index(f"{letter}_{name}") for name in ("hip", "collar", "shoulder"))
        offsets[hip] = pelvis + rig.at(f"{side}_upper_leg") - rig.hips
        if rig.has(f"{side}_shoulder"):
            offsets[collar] = rig.at(f"{side}_shoulder") - chest
        if rig.has(f"{side}_upper_arm"):
            offsets[shoulder] = rig.at(f"{side}_upper_arm") - chest - offsets[collar]
        for name in ("elbow", "wrist"):
            _set_limb(offsets, rig, training, f"{letter}_{name}", side)
    if rig.has("head") and rig.has("neck1"):
        offsets[training.index("head")] = rig.at("head") - neck
    return 0.5 * (offsets + offsets[list(training.mirror)] * [-1.0, 1.0, 1.0])


def _trunk(rig: RigBody, at: Mapping[str, Array], size: float) -> tuple[float, Array]:
    """Return the size of the trunk, and the place (3,) of the neck in the rig, metres.

    Args:
        at: places (3,) of the training skeleton's joints from its pelvis.
        size: of the legs; it is that of a trunk without an upper end too.
    """
    pelvis = rig.hips - size * at["L_hip"] * [0.0, 1.0, 0.0]
    ends = ((("neck1",), "neck"), (tuple(f"{side}_upper_arm" for side in SIDES), "L_shoulder"), (("head",), "head"))
    for parts, name in ends:
        if all(rig.has(part) for part in parts):
            end, own = np.mean([rig.at(part) for part in parts], axis=0), at[name] * [0.0, 1.0, 1.0]
            trunk = (float(length(end - rig.hips)) + size * float(at["L_hip"][1])) / float(own[1])
            return trunk, end + trunk * (at["neck"] - own)
    return size, pelvis + size * at["neck"]


def _set_limb(offsets: Array, rig: RigBody, training: Skeleton, name: str, side: str) -> None:
    """Give a bone of a limb the length that it has in the rig, in the direction of the T-pose."""
    begin, end = (f"{side}_{part}" for part in LIMBS[name.partition("_")[2]])
    if rig.has(begin) and rig.has(end):
        joint = training.index(name)
        direction = normalize(training.offsets[joint].astype(np.float64))
        offsets[joint] = direction * length(rig.at(end) - rig.at(begin))


def _hip_height(offsets: Array, training: Skeleton) -> float:
    """Return the height of the hip joints over the floor of the T-pose, metres."""
    return -sum(float(offsets[training.index(f"L_{name}")][1]) for name in ("knee", "ankle", "foot"))


def _check_pose(offsets: Array, training: Skeleton, where: str) -> None:
    bones, own = normalize(offsets[1:]), normalize(training.offsets[1:].astype(np.float64))
    turned = np.degrees(np.arccos(np.clip(dot(bones, own), -1.0, 1.0)))
    worst = int(turned.argmax())
    if turned[worst] > TURNED:
        raise InvalidFile(
            f"its rest pose is no T-pose that faces +Z: {training.joint_names[worst + 1]} is {turned[worst]:.0f} "
            "degrees off",
            where=where,
            argument="body",
        )


def check_offsets(offsets: Array, training: Skeleton, where: str) -> None:
    """Validate the proportions of a body.

    Args:
        offsets: (J, 3) metres.
        training: the skeleton whose proportions they are compared with.
        where: of the offsets, for the error.

    Raises:
        InvalidFile: numbers that are not finite, a stature or a bone that no human has.
    """
    if offsets.shape != training.offsets.shape or not np.isfinite(offsets).all():
        raise InvalidFile(f"its offsets are not {len(training)} finite vectors", where=where, argument="body")
    tall = stature(training.with_offsets(offsets))
    if not SHORTEST <= tall <= TALLEST:
        raise InvalidFile(
            f"its body is {tall:.3g} m tall; allowed: {SHORTEST:g} to {TALLEST:g}",
            where=where,
            hint="Scale the character to the size of a person; `marey rigs show FILE` tells the unit that is read.",
            argument="body",
        )
    bones = length(offsets[1:])
    wanted = length(training.offsets[1:].astype(np.float64)) * (tall / stature(training))
    ratios = np.maximum(bones, 1e-9) / wanted
    wrong = (bones < SHORTEST_BONE) | (ratios > UNLIKE) | (ratios < 1 / UNLIKE)
    if wrong.any():
        j = int(wrong.argmax())
        raise InvalidFile(
            f"its bone to {training.joint_names[j + 1]} is {bones[j]:.3g} m long, {ratios[j]:.2g} times that of the "
            f"standard body; allowed: {1 / UNLIKE:g} to {UNLIKE:g} times",
            where=where,
            argument="body",
        )
