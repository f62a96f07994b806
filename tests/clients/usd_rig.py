"""Read the rigs of USD files, in a Python that has `usd-core` and numpy but not Marey itself.

    python usd_rig.py SHARED FOLDER [--binary]

SHARED is the folder of the package `marey` in the checkout. Prints JSON by name of each file of the folder: the joints,
their places and axes, and how far they are after the skeleton is written as USD and read again; or the error. With
--binary text files are converted before, `a.usda` to `a.usdc`.
"""

import json
import sys
from pathlib import Path

shared, folder, *binary = sys.argv[1:]
sys.path.insert(0, shared)

import numpy as np  # noqa: E402
from pxr import Sdf  # noqa: E402

from marey.core.errors import MareyError  # noqa: E402
from marey.motion.io.usd_write import format_rigged_usd  # noqa: E402
from marey.motion.rigs.read import parse_rig, read_rig  # noqa: E402
from marey.motion.rigs.rigged import RiggedMotion  # noqa: E402


def at_rest(rig):
    """The rig in its rest pose for two frames."""
    turns, places = np.tile(rig.local_rotations, (2, 1, 1)), np.tile(rig.offsets, (2, 1, 1))
    return RiggedMotion(rig, turns, places, np.zeros(len(rig), bool), np.zeros((2, 4), bool), 20.0)


def look(path):
    try:
        rig = read_rig(path)
    except MareyError as error:
        return {"kind": type(error).__name__, "error": error.message, "hint": error.hint}
    again = parse_rig(format_rigged_usd(at_rest(rig)), "again.usd")
    return {
        "names": rig.joint_names,
        "parents": rig.parents,
        "places": rig.positions.tolist(),
        "axes": rig.orientations.tolist(),
        "unit": rig.unit,
        "up": rig.up,
        "notes": rig.notes,
        "again": float(np.abs(again.positions - rig.positions).max()),
        "same": [again.unit, again.up, list(again.joint_names)] == [rig.unit, rig.up, list(rig.joint_names)],
    }


for text in Path(folder).glob("*.usda") if binary else ():
    Sdf.Layer.OpenAsAnonymous(str(text)).Export(str(text.with_suffix(".usdc")))
    text.unlink()
print(json.dumps({path.name: look(path) for path in sorted(Path(folder).glob("*.usd*"))}))
