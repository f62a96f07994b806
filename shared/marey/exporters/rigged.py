"""Files of motions that are on a rig already."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from marey.core.errors import InvalidInput
from marey.exporters.exporter import Coordinates
from marey.exporters.registry import exporter_for, exporters

if TYPE_CHECKING:
    from marey.motion.rigs.rigged import RiggedMotion


def write_rigged(path: Path | str, motion: RiggedMotion) -> None:
    """Write a motion on a rig atomically, in centimetres and Y up where its format leaves them open.

    Args:
        path: its ending tells the format, of those that have the option `rig`, such as `.glb`, `.bvh` and `.fbx`.
        motion: as `marey.motion.retarget.on_body` returns it.

    Raises:
        InvalidInput: another ending, numbers that are not finite, or a folder that cannot be written to.
    """
    from marey.motion.files import write_atomically

    path = Path(path)
    writer = exporter_for(path)
    if writer.encode_rigged is None:
        having = ", ".join(f".{each.extension}" for each in exporters().values() if each.encode_rigged is not None)
        raise InvalidInput(f"{writer.format} files hold no rig", where=str(path), hint=f"Endings that do: {having}.")
    write_atomically(path, writer.encode_rigged(motion, Coordinates()))
