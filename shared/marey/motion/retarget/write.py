"""Write a motion on a rig to a file."""

from __future__ import annotations

from pathlib import Path

from marey.core.errors import InvalidInput
from marey.motion.files import write_atomically
from marey.motion.io.rigged_bvh import format_rigged_bvh
from marey.motion.io.rigged_glb import format_rigged_glb
from marey.motion.rigs.rigged import RiggedMotion


def write_rigged(path: Path | str, motion: RiggedMotion) -> None:
    """Write a motion on a rig atomically; the name's ending tells the format: .glb, or .bvh in centimetres and Y up.

    Raises:
        InvalidInput: another ending, numbers that are not finite, or a folder that cannot be written to.
    """
    path = Path(path)
    if path.suffix.lower() == ".glb":
        write_atomically(path, format_rigged_glb(motion))
    elif path.suffix.lower() == ".bvh":
        write_atomically(path, format_rigged_bvh(motion).encode())
    else:
        raise InvalidInput("is neither .glb nor .bvh", where=str(path))
