"""Motions: clips in memory, their npz, BVH, glb and FBX files, and the geometry behind them. Needs the extra `motion`.

    from marey.motion import load_npz, write_bvh

    write_bvh("wave.bvh", load_npz("wave.npz"))

Names in `__all__` are public and documented in `docs/reference/python-api.md`; the modules of this package are not.
A name is imported when it is first used, so importing one module of this package does not import the others.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from marey.core.lazy import lazy_names

if TYPE_CHECKING:
    from marey.motion.clip import MotionClip, load_npz
    from marey.motion.edits.editing import edit
    from marey.motion.io.bvh import BvhClip, read_bvh, write_bvh
    from marey.motion.io.convert import clip_from_bvh
    from marey.motion.io.fbx_read import read_fbx
    from marey.motion.io.fbx_write import write_fbx
    from marey.motion.io.glb_read import read_glb
    from marey.motion.io.glb_write import write_glb

    __version__: str

__getattr__ = lazy_names(
    __name__,
    {
        "marey.motion.clip": "MotionClip load_npz",
        "marey.motion.edits.editing": "edit",
        "marey.motion.io.bvh": "BvhClip read_bvh write_bvh",
        "marey.motion.io.convert": "clip_from_bvh",
        "marey.motion.io.fbx_read": "read_fbx",
        "marey.motion.io.fbx_write": "write_fbx",
        "marey.motion.io.glb_read": "read_glb",
        "marey.motion.io.glb_write": "write_glb",
    },
)

__all__ = [
    "BvhClip",
    "MotionClip",
    "__version__",
    "clip_from_bvh",
    "edit",
    "load_npz",
    "read_bvh",
    "read_fbx",
    "read_glb",
    "write_bvh",
    "write_fbx",
    "write_glb",
]
