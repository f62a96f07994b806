"""Poses that constraints name as frames of motions: read, and put in their place. numpy is loaded with the first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from marey.core.errors import InvalidInput, MareyError
from marey.core.extras import needs_extra
from marey.motion.edits.licences import LICENCE
from marey.motion.files import read_limited

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip
    from marey.motion.skeleton import Skeleton

MAX_FILE = 4 * 2**20
"""Bytes of a file of constraints."""
KEPT_FILES = 16
"""Motion files that stay in memory, for the next constraint that names one."""


class PoseFiles:
    """Poses of motion files.

    Args:
        folder: that paths of motion files begin at.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._load = lru_cache(KEPT_FILES)(self._read)

    def fill(self, constraints: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Return checked constraints in which no keyframe names a file; those with ids stay as they are.

        Raises:
            InvalidInput: a file that cannot be read, or a frame that it does not have; with the field in `where`.
        """
        return [self._filled(each, f"constraints.{number}.motion") for number, each in enumerate(constraints)]

    def _filled(self, each: Mapping[str, Any], where: str) -> dict[str, Any]:
        named = each.get("motion", {})
        if "file" not in named:
            return dict(each)
        try:
            clip = self._load(named["file"])
        except MareyError as error:
            raise InvalidInput(error.message, where=f"{where}.file", hint=error.hint) from error
        if named["frame"] >= clip.frames:
            raise InvalidInput(beyond(named["frame"], clip.frames), where=f"{where}.frame")
        return with_pose(each, pose_of(clip, named["frame"]))

    def _read(self, name: str) -> MotionClip:
        try:
            from marey.motion.clip import load_npz
        except ImportError as error:
            missing = needs_extra("motion", error)
            missing.hint = "pip install 'marey[motion]', or name a motion of the server by its `id`."
            raise missing from error
        return load_npz(self._folder / name)


def read_constraints_file(
    file: Path, read: Callable[[bytes], Sequence[Mapping[str, Any]]]
) -> Sequence[Mapping[str, Any]]:
    """Return the constraints of a file; motion files that they name are found from its folder.

    Args:
        read: returns the checked constraints of its content, or raises `InvalidInput` with the field in `where`.

    Raises:
        NotFound, TooLarge: the file cannot be read.
        InvalidInput: of `read`, or a motion file that cannot be used; with the file and the field.
    """
    content = read_limited(file, MAX_FILE)
    try:
        return PoseFiles(file.parent).fill(read(content))
    except InvalidInput as error:
        raise InvalidInput(error.message, where=f"{file}: {error.where}", hint=error.hint) from None


def pose_of(clip: MotionClip, frame: int) -> dict[str, Any]:
    """Return a frame of a clip as fields of a pose keyframe: rotations by joint, the height of the root, and the terms
    of the clip, where it has any."""
    licence = clip.manifest.get(LICENCE)
    turns = zip(clip.skeleton.joint_names, clip.rotations[frame], strict=True)
    return {
        "joint_rotations": {name: [float(x) for x in turn] for name, turn in turns},
        "root_height": float(clip.root[frame, 1]),
        **({LICENCE: licence} if isinstance(licence, str) and licence else {}),
    }


def with_pose(constraint: Mapping[str, Any], pose: Mapping[str, Any]) -> dict[str, Any]:
    """Return a pose keyframe with a pose (`pose_of`) in place of its `motion`; its own place or height comes first."""
    rest = {name: value for name, value in constraint.items() if name != "motion"}
    placed = "root_position" in rest or "root_height" in rest
    return {**rest, **{name: value for name, value in pose.items() if not (placed and name == "root_height")}}


def ordered_rotations(given: Any, skeleton: Skeleton, where: str) -> list[Sequence[float]]:
    """Return checked `joint_rotations`, by joint or in order, in the order of a skeleton.

    Raises:
        InvalidInput: they are of another skeleton.
    """
    if isinstance(given, Mapping):
        by_name = cast("Mapping[str, Sequence[float]]", given)
        named = {plain_name(name): (name, turn) for name, turn in by_name.items()}
        unknown = [name for plain, (name, _) in named.items() if plain not in skeleton.joint_names]
        missing = [name for name in skeleton.joint_names if name not in named]
        if unknown or missing:
            said = f"unknown joint {unknown[0][:40]!r}" if unknown else f"the rotation of {missing[0]!r} is missing"
            raise InvalidInput(
                f"{said}: the pose is of another skeleton than the model's",
                where=where,
                hint=f"Its joints: {', '.join(skeleton.joint_names)}.",
            )
        return [named[name][1] for name in skeleton.joint_names]
    turns: list[Sequence[float]] = list(given)
    if len(turns) != len(skeleton):
        raise InvalidInput(f"{len(turns)} rotations; the model's skeleton has {len(skeleton)} joints", where=where)
    return turns


def plain_name(name: str) -> str:
    """Return the name of a joint as skeletons write it: `left_wrist` is `L_wrist`."""
    for long, short in (("left_", "L_"), ("right_", "R_")):
        if name.startswith(long):
            return short + name.removeprefix(long)
    return name


def beyond(frame: int, frames: int) -> str:
    """Return the message about a frame that a motion does not have."""
    return f"frame {frame} is beyond the motion, which has {frames}"
