"""Poses of an export: the clip with another root, place or rest pose, as its options say.

Joints stay where they are, to less than a millimetre, unless the options move the whole body.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol, cast

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.export_options import PLAIN, ExportOptions
from marey.motion.rigs.rename import renamed
from marey.motion.rotations import IDENTITY, Array, about, conjugate, multiply, rotate, unroll
from marey.motion.skeleton import Skeleton

ROOT = "root"
LEAST_TWIST = 0.2
"""Below this length the part of a rotation about the vertical is not defined well: the body is nearly upside down, and
the heading before it is held."""


class Posed(Protocol):
    """Input of exports: a BvhClip or a MotionClip."""

    @property
    def skeleton(self) -> Skeleton: ...
    @property
    def rotations(self) -> NDArray[np.floating[Any]]: ...
    @property
    def root(self) -> NDArray[np.floating[Any]]: ...
    @property
    def fps(self) -> float: ...


@dataclass(frozen=True, eq=False)
class Arranged:
    """Poses to write.

    Attributes:
        skeleton: its offsets are the rest pose: the T-pose with the toes on the floor; metres.
        rotations: (T, J, 4) float64 local quaternions `w x y z`.
        positions: (T, P, 3) float64 positions of the first P joints in the axes of their parents, metres: of the root,
            and with a root bone of the pelvis too.
        fps: frames a second.
        ends: (J, 3) End Sites of a BVH file, NaN where there is none; None if the motion does not come from one.
        removed: what `in_place` took out, for the manifest; empty otherwise.
    """

    skeleton: Skeleton
    rotations: Array = field(repr=False)
    positions: Array = field(repr=False)
    fps: float
    ends: Array | None = field(default=None, repr=False)
    removed: Mapping[str, Any] = field(default_factory=dict[str, Any])


def arrange(clip: Posed, options: ExportOptions = PLAIN) -> Arranged:
    """Return the poses of a clip with these options.

    Raises:
        InvalidInput: bones of the clip change their length, the placement in its manifest cannot be read, a root bone
            is wanted where a joint has its name, or the parts of the body that other names need are not found.
    """
    rotations, root, heading, removed = moved(clip, options)
    skeleton = clip.skeleton.with_offsets(np.concatenate([_standing(clip.skeleton)[None], clip.skeleton.offsets[1:]]))
    if options.names is not None:
        skeleton = replace(skeleton, joint_names=renamed(skeleton.joint_names, skeleton.parents, options.names))
    ends = cast("Array | None", getattr(clip, "ends", None))
    arranged = Arranged(skeleton, rotations, root[:, None], clip.fps, ends, removed)
    if options.root_bone:
        arranged = _with_root_bone(arranged, heading)
    return _with_rest_frame(arranged) if options.tpose_frame else arranged


def moved(clip: Posed, options: ExportOptions) -> tuple[Array, Array, Array, dict[str, Any]]:
    """Move a clip as a whole: in place, or where it was taken from.

    Returns:
        Rotations (T, J, 4), root (T, 3) in metres, heading (T, 4) or (1, 4), and what `in_place` took out.

    Raises:
        InvalidInput: bones of the clip change their length, or its placement or the record of a loop cannot be read.
    """
    if getattr(clip, "positions", None) is not None:
        raise InvalidInput("bones of this clip change their length, and files have one offset per joint")
    rotations, root = np.array(clip.rotations, np.float64), np.array(clip.root, np.float64)
    heading = headings(rotations[:, 0]) if options.in_place or options.root_bone else IDENTITY[None]
    removed: dict[str, Any] = {}
    if options.in_place:
        removed = travel_of(root, heading, clip.fps)
        root[:, [0, 2]] = root[:1, [0, 2]]
        if (turn := cycle_turn(clip, len(root))).any():
            back = about("Y", -turn)
            rotations[:, 0], heading = multiply(back, rotations[:, 0]), multiply(back, heading)
    if options.in_place == "heading":
        rotations[:, 0] = multiply(conjugate(heading), rotations[:, 0])
        heading = np.tile(IDENTITY, (len(heading), 1))
    if options.placement == "keep":
        turn, shift = placement_of(clip)
        rotations[:, 0], heading = multiply(turn, rotations[:, 0]), multiply(turn, heading)
        root = rotate(turn, root) + shift
    return rotations, root, heading, removed


def headings(rotations: Array) -> Array:
    """Return how far the body has turned about the vertical since frame 0: quaternions (T, 4).

    The part of a rotation about Y (its twist) is the turn that leaves the shortest tilt. Frame 0 has none: there a clip
    faces +Z.

    Args:
        rotations: (T, 4) of the root, in the world.
    """
    turned = multiply(rotations, conjugate(rotations[:1]))
    twist = turned * np.array([1.0, 0.0, 1.0, 0.0])
    sure = np.linalg.norm(twist, axis=-1) > LEAST_TWIST
    last = np.maximum.accumulate(np.where(sure, np.arange(len(sure)), 0))  # frame 0 is sure
    twist = twist[last]
    return unroll(twist / np.linalg.norm(twist, axis=-1, keepdims=True))


def yaws(heading: Array) -> Array:
    """Return the angles (T,) of turns about the vertical, in radians, without jumps; positive is to the left."""
    return np.unwrap(2 * np.arctan2(heading[:, 2], heading[:, 0]), period=2 * np.pi)


def cycle_turn(clip: Posed, frames: int) -> Array:
    """Return how far a loop has turned by each frame, if its cycle turned evenly: angles (T,) in radians, by the record
    in its manifest; zero for a motion that is no loop.

    A loop in place has to end as it began, or the body would turn at a stroke wherever a cycle begins anew.

    Raises:
        InvalidInput: the record holds something else than numbers.
    """
    record = cast("Mapping[str, Any]", getattr(clip, "manifest", {})).get("loop")
    if not record:
        return np.zeros(frames)
    heading, seconds = cycle_numbers(record, ("heading", "seconds"))
    speed = heading / seconds if seconds else np.nan
    if not np.isfinite(speed):
        raise InvalidInput(f"{heading:g} radians in {seconds:g} s are no speed", where="manifest: loop.cycle")
    return speed / clip.fps * np.arange(frames)


def cycle_numbers(loop: object, names: Sequence[str]) -> list[float]:
    """Return numbers of the cycle in the record of a loop.

    Raises:
        InvalidInput: the record holds something else.
    """
    cycle = cast("Mapping[str, Any]", loop).get("cycle") if isinstance(loop, Mapping) else None
    return _numbers(cycle, names, "loop.cycle")


def _numbers(record: object, names: Sequence[str], where: str, *, missing: float = np.nan) -> list[float]:
    """Return finite numbers of an entry of a manifest by name.

    Raises:
        InvalidInput: it holds something else than these numbers.
    """
    try:
        found = [float(cast("Mapping[str, Any]", record).get(name, missing)) for name in names]
    except (AttributeError, TypeError, ValueError):
        found = [np.nan]
    if not np.isfinite(found).all():
        wanted = f"{', '.join(names[:-1])} and {names[-1]}"
        raise InvalidInput(f"is not an object with the numbers {wanted}", where=f"manifest: {where}")
    return found


def placement_of(clip: object) -> tuple[Array, Array]:
    """Return the placement in a clip's manifest, `{"x", "z", "heading"}` in metres and radians: the turn (4,) about the
    vertical, and the way (3,) after it. Without one the clip stays at the origin.

    Raises:
        InvalidInput: it holds something else than these numbers.
    """
    manifest = cast("Mapping[str, Any]", getattr(clip, "manifest", {}))
    x, z, heading = _numbers(manifest.get("placement") or {}, ("x", "z", "heading"), "placement", missing=0.0)
    return about("Y", heading), np.array([x, 0.0, z])


def _standing(skeleton: Skeleton) -> Array:
    """Return the position (3,) of the root at which the lowest joint of the rest pose is on the floor."""
    rest = skeleton.rest.astype(np.float64)
    return np.array([0.0, float(rest[0, 1] - rest[:, 1].min()), 0.0])


def travel_of(root: Array, heading: Array, fps: float) -> dict[str, Any]:
    """Describe travel and heading of a motion, in all and per second: metres and radians."""
    seconds = max(len(root) - 1, 1) / fps
    x, _, z = (root[-1] - root[0]).tolist()
    angles = yaws(heading)
    whole = {"x": x, "z": z, "heading": float(angles[-1] - angles[0])}
    return {
        "travel": {name: round(value, 6) + 0.0 for name, value in whole.items()},
        "travel_per_second": {name: round(value / seconds, 6) + 0.0 for name, value in whole.items()},
    }


def _with_root_bone(plain: Arranged, heading: Array) -> Arranged:
    """Return the poses with a joint on the floor over the root: it takes X, Z and the heading, the root keeps the
    rest."""
    tree = plain.skeleton
    if ROOT in tree.joint_names:
        raise InvalidInput(
            f"the skeleton has a joint named {ROOT!r} already", where=tree.name, hint="Export it without a root bone."
        )
    floor = plain.positions[:, 0] * np.array([1.0, 0.0, 1.0])
    back = conjugate(heading)
    pelvis = rotate(back, plain.positions[:, 0] - floor)
    rotations = np.concatenate(
        [heading[:, None], multiply(back, plain.rotations[:, 0])[:, None], plain.rotations[:, 1:]], axis=1
    )
    skeleton = Skeleton(
        name=tree.name,
        joint_names=(ROOT, *tree.joint_names),
        parents=(-1, *(parent + 1 for parent in tree.parents)),
        offsets=np.concatenate([np.zeros((1, 3), np.float32), tree.offsets]),
        mirror=(0, *(joint + 1 for joint in tree.mirror)),
        feet=tuple(joint + 1 for joint in tree.feet),
        facing=tuple(joint + 1 for joint in tree.facing),
    )
    ends = None if plain.ends is None else np.concatenate([np.full((1, 3), np.nan), plain.ends])
    return replace(
        plain, skeleton=skeleton, rotations=rotations, positions=np.stack([floor, pelvis], axis=1), ends=ends
    )


def _with_rest_frame(moving: Arranged) -> Arranged:
    """Return the poses with the rest pose before them."""
    rest = np.broadcast_to(IDENTITY, (1, *moving.rotations.shape[1:]))
    places = moving.skeleton.offsets[None, : moving.positions.shape[1]].astype(np.float64)
    return replace(
        moving,
        rotations=np.concatenate([rest, moving.rotations]),
        positions=np.concatenate([places, moving.positions]),
    )
