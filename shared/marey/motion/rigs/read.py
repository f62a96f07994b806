"""Read a rig from a file; the name's ending tells the format."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.files import read_limited
from marey.motion.rigs.rig import MAX_BYTES, Rig

Reader = Callable[[bytes, str], Rig]
"""Reads the bytes of a file; the second argument names it in errors. Raises `InvalidFile` or `TooLarge`. It makes the
rig with `marey.motion.rigs.make_rig.make_rig`, which checks what all formats have in common."""

READERS: dict[str, str] = {
    "glb": "marey.motion.io.rig_gltf:parse_glb_rig",
    "gltf": "marey.motion.io.rig_gltf:parse_gltf_rig",
    "vrm": "marey.motion.io.rig_gltf:parse_glb_rig",
    "vrma": "marey.motion.io.rig_gltf:parse_glb_rig",
    "bvh": "marey.motion.io.rig_bvh:parse_bvh_rig",
    "fbx": "marey.motion.io.rig_fbx:parse_fbx_rig",
    "usd": "marey.motion.io.rig_usd:parse_usd_rig",
    "usda": "marey.motion.io.rig_usd:parse_usd_rig",
    "usdc": "marey.motion.io.rig_usd:parse_usd_rig",
    "npz": "marey.motion.io.rig_smplx:parse_smplx_rig",
    "json": "marey.motion.io.rig_json:parse_json_rig",
}
"""Reader by the ending of a file's name, as `module:function`; modules are imported when they are needed."""
LIMITS = {"npz": 2**28}
"""Largest file of a format in bytes, where it is not `MAX_BYTES`: the model of SMPL-X holds far more than joints."""


def read_rig(path: Path | str) -> Rig:
    """Read a rig file of a known format.

    Raises:
        InvalidInput: an unknown format.
        NotFound: no such file.
        InvalidFile: broken, or without a skeleton that motion can be put on.
        TooLarge: over 64 MiB or 2,000 joints.
    """
    path = Path(path)
    reader = _reader(path)
    return _read(reader, read_limited(path, LIMITS.get(_extension(path), MAX_BYTES)), str(path))


def parse_rig(data: bytes, name: str) -> Rig:
    """Read the bytes of a rig file.

    Args:
        data: the whole file.
        name: of the file; its ending tells the format.

    Raises:
        InvalidInput, InvalidFile, TooLarge: as `read_rig`.
    """
    return _read(_reader(Path(name)), data, name)


def _read(reader: Reader, data: bytes, name: str) -> Rig:
    with np.errstate(over="ignore", invalid="ignore"):  # `make_rig` refuses what is not finite
        return reader(data, name)


def _extension(path: Path) -> str:
    return path.suffix.lower().removeprefix(".")


def _reader(path: Path) -> Reader:
    extension = _extension(path)
    if extension not in READERS:
        known = ", ".join(f".{each}" for each in READERS)
        raise InvalidInput(f"`{path.suffix}` is not a rig format", where=str(path), hint=f"Known: {known}.")
    module, _, function = READERS[extension].partition(":")
    return getattr(importlib.import_module(module), function)
