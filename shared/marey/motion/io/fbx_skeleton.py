"""Which nodes of an FBX file are its skeleton."""

from __future__ import annotations

from collections.abc import Iterable

from marey.core.errors import InvalidFile, TooLarge
from marey.motion.io.fbx_scene import BODIES, BONES, Scene

MAX_JOINTS = 2000


def bones_of(scene: Scene) -> set[int]:
    """Return the identifiers of the joints: limbs and what skins are bound to; without these, all plain nodes."""
    bones = {key for key, model in scene.models.items() if model.kind in BONES} | scene.linked
    return bones or {key for key, model in scene.models.items() if model.kind not in BODIES}


def skeleton_order(scene: Scene, bones: Iterable[int]) -> list[int]:
    """Return bones and all nodes above them, parents first, siblings in the order of the file.

    Raises:
        InvalidFile: a circle of parents, or no bones.
        TooLarge: over 2,000 joints.
    """
    kept: set[int] = set()
    for bone in bones:
        at: int | None = bone
        while at is not None and at not in kept:
            kept.add(at)
            at = scene.parents.get(at)
    if not kept:
        hint = "Export the character with its bones."
        raise InvalidFile("holds no skeleton", where=scene.file.where, hint=hint)
    if len(kept) > MAX_JOINTS:
        raise TooLarge(f"{len(kept)} joints, over the limit of {MAX_JOINTS}", where=scene.file.where)
    below: dict[int | None, list[int]] = {}
    for key in scene.models:
        if key in kept:
            below.setdefault(scene.parents.get(key), []).append(key)
    order: list[int] = []
    waiting = below.get(None, [])[::-1]
    while waiting:
        order.append(waiting.pop())
        waiting.extend(below.get(order[-1], [])[::-1])
    if len(order) < len(kept):
        lost = next(key for key in kept if key not in set(order))
        raise scene.file.broken(f"{scene.models[lost].name!r} is above itself: the skeleton is a circle")
    return order
