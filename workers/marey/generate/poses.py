"""Constraints of motions that are generated in this process; poses that they name are read from files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from marey.core.errors import InvalidInput
from marey.items.constraints import MAX_FILE, named_motions, parse_constraints
from marey.items.item import Item
from marey.motion.keyframes import PoseFiles


def with_poses(constraints: Sequence[Mapping[str, Any]], folder: Path) -> list[dict[str, Any]]:
    """Return checked constraints in which no keyframe names a motion: its joints' rotations and the height of its root
    stand in its place.

    Args:
        folder: that paths of motion files begin at.

    Raises:
        InvalidInput: a motion that only a server knows, a frame that it does not have, or a file that cannot be read;
            with the field in `where`.
    """
    for where, named in named_motions(constraints):
        if "id" in named:
            raise InvalidInput(
                "a motion of a server cannot be read here",
                where=f"{where}.id",
                hint='Fetch its npz and write {"file": "pose.npz", "frame": 0}, or submit to the server.',
            )
    return PoseFiles(folder).fill(constraints)


def constraints_of(item: Item, given: Sequence[Mapping[str, Any]]) -> Sequence[Mapping[str, Any]]:
    """Return the constraints of an item, read from the working directory, or else those given for all."""
    return with_poses(item.constraints, Path()) if item.constraints else given


def read_file(file: Path | None) -> Sequence[Mapping[str, Any]]:
    """Return the constraints of a JSON file; motion files that they name are found from its folder.

    Raises:
        NotFound, TooLarge: the file cannot be read.
        InvalidInput: constraints that cannot be used, with the file and the field.
    """
    if file is None:
        return ()
    from marey.motion.files import read_limited

    content = read_limited(file, MAX_FILE)
    try:
        return with_poses(parse_constraints(content), file.parent)
    except InvalidInput as error:
        raise InvalidInput(error.message, where=f"{file}: {error.where}", hint=error.hint) from None
