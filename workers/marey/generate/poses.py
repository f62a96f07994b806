"""Constraints of motions that are generated in this process; poses that they name are read from files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from marey.core.errors import InvalidInput
from marey.items.constraints import named_motions, parse_constraints
from marey.items.item import Item
from marey.motion.keyframes import PoseFiles, read_constraints_file


def with_poses(constraints: Sequence[Mapping[str, Any]], folder: Path) -> list[dict[str, Any]]:
    """Return checked constraints in which no keyframe names a motion: its joints' rotations and the height of its root
    stand in its place.

    Args:
        folder: that paths of motion files begin at.

    Raises:
        InvalidInput: a motion that only a server knows, a frame that it does not have, or a file that cannot be read;
            with the field in `where`.
    """
    return PoseFiles(folder).fill(_without_ids(constraints))


def constraints_of(item: Item, given: Sequence[Mapping[str, Any]]) -> Sequence[Mapping[str, Any]]:
    """Return the constraints of an item, read from the working directory, or else those given for all."""
    return with_poses(item.constraints, Path()) if item.constraints else given


def read_file(file: Path | None) -> Sequence[Mapping[str, Any]]:
    """Return the constraints of a JSON file, or none without a file; see `read_constraints_file`."""
    if file is None:
        return ()
    return read_constraints_file(file, lambda content: _without_ids(parse_constraints(content)))


def _without_ids(constraints: Sequence[Mapping[str, Any]]) -> Sequence[Mapping[str, Any]]:
    for where, named in named_motions(constraints):
        if "id" in named:
            raise InvalidInput(
                "a motion of a server cannot be read here",
                where=f"{where}.id",
                hint='Fetch its npz and write {"file": "pose.npz", "frame": 0}, or submit to the server.',
            )
    return constraints
