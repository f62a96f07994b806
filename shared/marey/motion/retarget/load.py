"""Find a rig by name or file, with its parts."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

from marey.core.documents import read_json
from marey.core.errors import InvalidInput
from marey.motion.files import stamp_of
from marey.motion.retarget.reference import REFERENCES, reference_rig
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.joint_map import map_joints, read_map
from marey.motion.rigs.read import READERS, parse_rig, read_rig


def load_body(rig: str | Path, rig_map: str | Path | None = None) -> RigBody:
    """Return a reference skeleton or the rig of a file, with its parts. Files are read again when they change.

    Args:
        rig: `mixamo`, `ue4`, `humanik`, or a file.
        rig_map: JSON file of parts and joints that override what is found.

    Raises:
        InvalidInput: an unknown rig, one without legs or of a size that no character has, or a map that does not fit.
        NotFound, InvalidFile, TooLarge: a file cannot be read.
    """
    return _load(str(rig), stamp_of(rig), None if rig_map is None else str(rig_map), stamp_of(rig_map))


def parse_body(data: bytes, name: str, rig_map: Any = None) -> RigBody:
    """Return the rig of a file's bytes, with its parts.

    Args:
        data: the whole file.
        name: of the file; its ending tells the format.
        rig_map: JSON value of parts and joints that override what is found; None = no map.

    Raises:
        InvalidInput, InvalidFile, TooLarge: as `load_body`; of the map, `where` is `map`.
    """
    given = None if rig_map is None else read_map(rig_map, "map")
    found = parse_rig(data, name)
    return RigBody.of(found, map_joints(found, given, where="map"))


def _unknown(rig: str) -> InvalidInput:
    endings = ", ".join(f".{each}" for each in READERS)
    suffix = Path(rig).suffix
    if suffix:
        hint = f"Endings that are read: {endings}; or name {', '.join(REFERENCES)}."
        return InvalidInput(f"`{suffix}` is not a rig format", where=rig, hint=hint, argument="rig")
    hint = f"Reference skeletons: {', '.join(REFERENCES)}. Files: {endings}."
    return InvalidInput(f"there is no rig {rig!r}", where="rig", hint=hint, argument="rig")


@lru_cache(maxsize=16)
def _load(rig: str, stamp: tuple[int, int], rig_map: str | None, map_stamp: tuple[int, int]) -> RigBody:
    given = None if rig_map is None else read_map(read_json(Path(rig_map), unique=True), rig_map)
    if rig in REFERENCES:
        found = reference_rig(rig)
    elif Path(rig).suffix.lower().removeprefix(".") in READERS:
        found = read_rig(rig)
    else:
        raise _unknown(rig)
    return RigBody.of(found, map_joints(found, given, where=rig_map))
