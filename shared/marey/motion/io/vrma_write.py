"""Write VRM animations: glb with the extension VRMC_vrm_animation 1.0 (VRM Consortium).

VRM names the bones of the body; a player puts their rotations on any VRM avatar. Joints without a name of VRM's are
merged into the next bone that has one, since players regard no others.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.arrange import Arranged, Posed, arrange
from marey.motion.export_options import PLAIN, ExportOptions
from marey.motion.io.glb_write import GENERATOR, Numbers, animation_of, joint_nodes, pack
from marey.motion.kinematics import global_rotations
from marey.motion.rotations import conjugate, multiply
from marey.motion.skeleton import Skeleton, mirror_by_name

EXTENSION = "VRMC_vrm_animation"
_SIDED = ("UpperLeg", "LowerLeg", "Foot", "UpperArm", "LowerArm", "Hand")
REQUIRED = ("hips", "spine", "head", *(f"{side}{part}" for side in ("left", "right") for part in _SIDED))
"""Bones that every humanoid of VRM has."""
BONES = frozenset(
    {*REQUIRED, "chest", "upperChest", "neck"}
    | {f"{side}{part}" for side in ("left", "right") for part in ("Shoulder", "Toes")}
)


def format_vrma(clip: Posed, options: ExportOptions = PLAIN) -> bytes:
    """Return the bytes of a VRM animation: metres, Y up, +Z in front, in the T-pose at rest. Equal clips give equal
    bytes.

    Raises:
        InvalidInput: a bone that VRM requires is not found in the skeleton, or numbers that are not finite.
    """
    posed = _bones_alone(arrange(clip, replace(options, names="vrm")))
    if not (np.isfinite(posed.rotations).all() and np.isfinite(posed.positions).all()):
        raise InvalidInput("the clip holds NaN or infinite numbers", where=clip.skeleton.name)
    numbers = Numbers()
    bones = {name: {"node": joint} for joint, name in enumerate(posed.skeleton.joint_names)}
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": GENERATOR},
        "extensionsUsed": [EXTENSION],
        "extensions": {EXTENSION: {"specVersion": "1.0", "humanoid": {"humanBones": bones}}},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": joint_nodes(posed),
        "animations": [animation_of(posed, numbers)],
        "accessors": numbers.accessors,
        "bufferViews": numbers.views,
        "buffers": [{"byteLength": len(numbers.data)}],
    }
    return pack(document, numbers)


def _bones_alone(posed: Arranged) -> Arranged:
    """Return the poses of the bones that VRM names.

    Raises:
        InvalidInput: one that it requires is missing.
    """
    tree = posed.skeleton
    kept = [joint for joint, name in enumerate(tree.joint_names) if name in BONES]
    names = tuple(tree.joint_names[joint] for joint in kept)
    missing = [name for name in REQUIRED if name not in names]
    if missing or kept[0] != 0:
        lost = ", ".join(missing) or "hips at the root"
        hint = "Write another format, or a skeleton with these parts."
        raise InvalidInput(f"VRM needs bones that are not found: {lost}", where=tree.name, hint=hint)
    parents = [_above(tree, joint, kept) for joint in kept]
    rest = tree.rest.astype(np.float64)
    offsets = np.array([rest[j] - (rest[kept[p]] if p >= 0 else 0) for j, p in zip(kept, parents, strict=True)])
    world = global_rotations(tree, posed.rotations)[:, kept]
    rotations = world.copy()
    rotations[:, 1:] = multiply(conjugate(world[:, parents[1:]]), world[:, 1:])
    skeleton = Skeleton(tree.name, names, tuple(parents), offsets.astype(np.float32), mirror_by_name(names))
    return replace(posed, skeleton=skeleton, rotations=rotations, ends=None)


def _above(tree: Skeleton, joint: int, kept: list[int]) -> int:
    """Return the place in `kept` of the nearest of them above a joint, -1 for the first."""
    above = tree.parents[joint]
    while above >= 0 and above not in kept:
        above = tree.parents[above]
    return kept.index(above) if above >= 0 else -1
