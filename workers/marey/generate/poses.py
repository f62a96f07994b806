"""Poses of constraints that name a frame of a motion file: read, and written out as rotations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from marey.core.errors import InvalidInput, MareyError
from marey.items.constraints import MAX_FILE, parse_constraints
from marey.items.item import Item


def with_poses(constraints: Sequence[Mapping[str, Any]], folder: Path) -> list[dict[str, Any]]:
    """Return checked constraints in which no keyframe names a motion: its joints' rotations and the height of its root
    stand in its place.

    Args:
        folder: that paths of motion files begin at.

    Raises:
        InvalidInput: a motion that only a server knows, a frame that it does not have, or a file that cannot be read;
            with the field in `where`.
    """
    return [_with_pose(each, f"constraints.{number}.motion", folder) for number, each in enumerate(constraints)]


def _with_pose(each: Mapping[str, Any], where: str, folder: Path) -> dict[str, Any]:
    if "motion" not in each:
        return dict(each)
    from marey.motion import load_npz

    named = each["motion"]
    if "file" not in named:
        raise InvalidInput(
            "a motion of a server cannot be read here",
            where=f"{where}.id",
            hint='Fetch its npz and write {"file": "pose.npz", "frame": 0}, or give `joint_rotations`.',
        )
    try:
        clip = load_npz(folder / named["file"])
    except MareyError as error:
        raise InvalidInput(error.message, where=f"{where}.file", hint=error.hint) from error
    frame = named["frame"]
    if frame >= clip.frames:
        raise InvalidInput(f"frame {frame} is beyond the motion, which has {clip.frames}", where=f"{where}.frame")
    rotations = {
        name: [float(x) for x in turn]
        for name, turn in zip(clip.skeleton.joint_names, clip.rotations[frame], strict=True)
    }
    read = {name: value for name, value in each.items() if name != "motion"}
    height = {} if "root_position" in each or "root_height" in each else {"root_height": float(clip.root[frame, 1])}
    return {**read, "joint_rotations": rotations, **height}


def constraints_of(item: Item, given: Sequence[Mapping[str, Any]]) -> Sequence[Mapping[str, Any]]:
    """Return the constraints of an item, read from the working directory, or else those given for all."""
    return with_poses(item.constraints, Path()) if item.constraints else given


def read_file(file: Path | None) -> Sequence[Mapping[str, Any]]:
    """Return the constraints of a JSON file; motion files that they name are found from its folder.

    Raises:
        NotFound, TooLarge: the file cannot be read.
        InvalidInput: constraints that cannot be used, with the field.
    """
    if file is None:
        return ()
    from marey.motion.files import read_limited

    return with_poses(parse_constraints(read_limited(file, MAX_FILE)), file.parent)
