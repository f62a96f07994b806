"""Bodies of other proportions, read from the rest pose of a BVH or npz file.

A file with the joints of Marey's own exports gives its offsets as they are. A file with the joint names of Mixamo and
MotionBuilder, whose rest pose may be an A-pose, gives the lengths of its bones: limbs keep the directions of Marey's
T-pose, hips, spine, neck and collars the places that they have in the file, made equal on both sides.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from marey.core.errors import InvalidFile, InvalidInput
from marey.motion.body import DIGITS, STANDARD, NamedBody, standard_body, stature
from marey.motion.clip import load_npz
from marey.motion.io.bvh import read_bvh
from marey.motion.rotations import Array, dot, length, normalize
from marey.motion.skeleton import HUMANML3D, Skeleton, known_order

SHORTEST, TALLEST = 0.5, 3.0
"""Metres of stature."""
SHORTEST_BONE = 0.01
"""Metres."""
UNLIKE = 4.0
"""Times that a bone may be longer or shorter than that of the training skeleton at the same stature."""
TURNED = 60.0
"""Degrees that a bone may point away from that of the T-pose."""
_SIDED = {
    "hip": "UpLeg",
    "knee": "Leg",
    "ankle": "Foot",
    "foot": "ToeBase",
    "collar": "Shoulder",
    "shoulder": "Arm",
    "elbow": "ForeArm",
    "wrist": "Hand",
}
FOREIGN: dict[str, str] = {
    "pelvis": "Hips",
    "spine1": "Spine",
    "spine2": "Spine1",
    "spine3": "Spine2",
    "neck": "Neck",
    "head": "Head",
    **{f"{s}_{ours}": f"{side}{theirs}" for s, side in zip("LR", ("Left", "Right"), strict=True)
       for ours, theirs in _SIDED.items()},
}  # fmt: skip
"""Joint names of Mixamo and MotionBuilder (HumanIK), without the prefix before a colon, by Marey's."""
_PLACED = frozenset(
    {"spine1", "spine2", "spine3", "neck", "head", "L_hip", "R_hip", "L_collar", "R_collar", "L_shoulder", "R_shoulder"}
)
"""Joints that keep the place of the file, from their parent; others keep the direction of the T-pose."""


def read_body(given: Path | str, training: Skeleton) -> NamedBody:
    """Return the body `standard`, or the body of a BVH or npz file, for bundles trained on a skeleton.

    Args:
        given: `standard`, or the path of a file; lengths in a BVH are centimetres.
        training: the skeleton of the bundle's training data, of 22 joints.

    Raises:
        NotFound: no such file.
        InvalidFile: not a motion file, joints that are not known, or a body that no human has.
        InvalidInput: the bundle has another skeleton, or the path another extension.
    """
    if str(given) == STANDARD:
        return standard_body(training)
    path = Path(given)
    if training.name != HUMANML3D.name:
        raise InvalidInput(f"bodies are read for {HUMANML3D.name}; this bundle has {training.name}", where=str(path))
    match path.suffix.lower():
        case ".npz":
            skeleton = load_npz(path).skeleton
        case ".bvh":
            skeleton = read_bvh(path).skeleton
        case _:
            hint = f"Give {STANDARD}, or a .bvh or .npz file."
            raise InvalidInput("is not a body", where=str(path), hint=hint)
    return NamedBody(path.name, training.with_offsets(_offsets_of(skeleton, training, str(path))))


def _offsets_of(skeleton: Skeleton, training: Skeleton, where: str) -> Array:
    """Return the offsets (J, 3) of the training skeleton's joints in a file's rest pose, toes on the floor."""
    known = known_order(skeleton.joint_names, skeleton.parents)
    if known is not None and known[0].name == training.name:
        offsets = skeleton.offsets.astype(np.float64)[list(known[1])]
    else:
        offsets = _mapped(skeleton, training, where)
    _check_pose(offsets, training, where)
    offsets[0] = 0.0
    offsets[0, 1] = -float(training.with_offsets(offsets).rest[:, 1].min())
    offsets = np.round(offsets, DIGITS) + 0.0  # no -0.0
    check_offsets(offsets, training, where)
    return offsets


def _mapped(skeleton: Skeleton, training: Skeleton, where: str) -> Array:
    """Return the offsets (J, 3) of a rig with the joint names of Mixamo and MotionBuilder."""
    indices = {name.rsplit(":", 1)[-1]: j for j, name in enumerate(skeleton.joint_names)}
    missing = [FOREIGN[name] for name in training.joint_names if FOREIGN[name] not in indices]
    if missing:
        listed = ", ".join(missing[:8]) + (" …" if len(missing) > 8 else "")
        raise InvalidFile(
            f"lacks {len(missing)} of {len(training)} joints: {listed}",
            where=where,
            hint="Give a motion that Marey exported, or a rig with the joint names of Mixamo or MotionBuilder.",
        )
    own, theirs = training.offsets.astype(np.float64), skeleton.rest.astype(np.float64)
    offsets = np.zeros_like(own)
    for j, (name, parent) in enumerate(zip(training.joint_names, training.parents, strict=True)):
        if parent >= 0:
            bone = theirs[indices[FOREIGN[name]]] - theirs[indices[FOREIGN[training.joint_names[parent]]]]
            offsets[j] = bone if name in _PLACED else normalize(own[j]) * length(bone)
    return 0.5 * (offsets + offsets[list(training.mirror)] * [-1.0, 1.0, 1.0])


def _check_pose(offsets: Array, training: Skeleton, where: str) -> None:
    bones, own = normalize(offsets[1:]), normalize(training.offsets[1:].astype(np.float64))
    turned = np.degrees(np.arccos(np.clip(dot(bones, own), -1.0, 1.0)))
    worst = int(turned.argmax())
    if turned[worst] > TURNED:
        raise InvalidFile(
            f"its rest pose is no T-pose that faces +Z: {training.joint_names[worst + 1]} is {turned[worst]:.0f} "
            "degrees off",
            where=where,
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
        raise InvalidFile(f"its offsets are not {len(training)} finite vectors", where=where)
    tall = stature(training.with_offsets(offsets))
    if not SHORTEST <= tall <= TALLEST:
        raise InvalidFile(
            f"its body is {tall:.3g} m tall; allowed: {SHORTEST:g} to {TALLEST:g}",
            where=where,
            hint="Lengths in a BVH file are read as centimetres.",
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
        )
