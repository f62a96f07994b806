"""Read the rig of a USD file: the largest UsdSkel skeleton of .usd, .usda or .usdc, by Pixar's `usd-core`.

The library runs in a child process with limits of time and memory (`usd_child.py`), and the file may name no other.
"""

from __future__ import annotations

import hashlib
import importlib
import json
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path, PurePath
from typing import Any

import numpy as np

from marey.core.errors import InvalidFile, TooLarge
from marey.core.extras import extra
from marey.motion.rigs.make_rig import RigNode, make_rig
from marey.motion.rigs.rig import MAX_BYTES, Rig

SECONDS = 10
"""Processor time of the child; files of 64 MiB take a fifth of it."""
MEMORY = 512 * 2**20
"""Bytes of memory of the child beside the library's own. Large meshes in text take twenty times their size."""
UNITS = (1e-6, 1e6)


def parse_usd_rig(data: bytes, where: str = "usd") -> Rig:
    """Read the rig of a USD file.

    Raises:
        MissingExtra: `usd-core` is not installed.
        InvalidFile: broken, without a skeleton or its rest pose, or naming another file: sublayer, reference, payload,
            value clips or a path such as that of a texture.
        TooLarge: over 64 MiB or 2,000 joints, or more than the child may take.
    """
    if len(data) > MAX_BYTES:
        raise TooLarge(f"{len(data) / 2**20:.0f} MiB, over the limit of {MAX_BYTES / 2**20:.0f} MiB", where=where)
    with extra("usd"):
        importlib.import_module("pxr")
    found = _read(data, where)
    if "error" in found:
        kind = TooLarge if found["kind"] == "large" else InvalidFile
        raise kind(found["error"], where=where, hint=found["hint"])
    unit, up = float(found["unit"]), found["up"]
    if up not in ("y", "z") or not UNITS[0] <= unit <= UNITS[1]:
        raise InvalidFile(f"its unit of {unit:g} metres or its axis {up!r} is none that a rig has", where=where)
    matrices = np.array(found["matrices"], np.float64).reshape(-1, 4, 4).swapaxes(1, 2)  # rows are the axes
    joints = zip(found["names"], found["parents"], matrices, strict=True)
    return make_rig(
        [RigNode(name, parent, matrix) for name, parent, matrix in joints],
        name=PurePath(where).name,
        where=where,
        unit=unit,
        up=up,
        source="usd",
        sha256=hashlib.sha256(data).hexdigest(),
        notes=found["notes"],
    )


def _read(data: bytes, where: str) -> dict[str, Any]:
    """Return what the child process finds."""
    # It gets no settings, which hold secrets, and loads no plug-ins. It finds what this process finds.
    own = {name: value for name, value in os.environ.items() if not name.startswith(("MAREY_", "PXR_"))}
    own["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)
    with tempfile.TemporaryDirectory(prefix="marey-usd-") as folder:
        path = Path(folder) / "rig.usd"  # whose ending leaves open whether it is text or binary
        path.write_bytes(data)
        command = [sys.executable, "-P", "-m", "marey.motion.io.usd_child", str(path), str(SECONDS), str(MEMORY)]
        try:
            done = subprocess.run(
                command, env=own, stdin=subprocess.DEVNULL, capture_output=True, timeout=6 * SECONDS, check=False
            )
        except subprocess.TimeoutExpired:
            raise _too_slow(where) from None
    if done.returncode == -signal.SIGXCPU or done.returncode == -signal.SIGKILL:
        raise _too_slow(where)
    if done.returncode < 0:  # C++ aborts where memory runs out, and fails on some broken files
        raise InvalidFile("is broken, or takes too much memory: Pixar's library failed on it", where=where)
    if done.returncode:
        raise RuntimeError(f"the reader of USD failed on {where}: {done.stderr.decode(errors='replace')}")
    return json.loads(done.stdout)


def _too_slow(where: str) -> TooLarge:
    return TooLarge(f"takes more than {SECONDS} s to read", where=where, hint="Export the skeleton without the scene.")
