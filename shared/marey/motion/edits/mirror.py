"""Left and right exchanged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, cast

import numpy as np

from marey.core.errors import InvalidInput
from marey.core.sides import swap_sides_in
from marey.motion.clip import MotionClip
from marey.motion.edits.place import PLACEMENT
from marey.motion.skeleton import OTHER_FOOT

TEXTS = ("prompt", "prompts", "rewritten", "not_rewritten", "graph", "scope", "timeline")
"""Keys of a manifest that say in words what is to be seen."""


def mirror(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Exchange left and right: poses, contacts, bones, and what the manifest says of place, cycle and prompt.

    Raises:
        InvalidInput: left and right joints of the skeleton are not known.
    """
    tree, swap = clip.skeleton, list(clip.skeleton.mirror)
    if swap == list(range(len(tree))) and len(tree) > 1:
        raise InvalidInput(
            "the names of the joints do not tell left from right",
            hint="Rename them, for example to LeftArm and RightArm.",
        )
    across = np.array([-1.0, 1.0, 1.0])
    skeleton = tree.with_offsets(tree.offsets[swap] * across)
    rotations = clip.rotations[:, swap] * np.array([1.0, 1.0, -1.0, -1.0])
    manifest = {name: swap_sides_in(value) if name in TEXTS else value for name, value in clip.manifest.items()}
    if PLACEMENT in manifest:
        manifest[PLACEMENT] = _mirrored_place(manifest[PLACEMENT])
    if "loop" in manifest:
        cycle = cast("dict[str, Any]", manifest["loop"])
        manifest["loop"] = {**cycle, "cycle": _mirrored_place(cycle["cycle"])}
    contacts = clip.contacts[:, OTHER_FOOT]
    return MotionClip.of(skeleton, rotations, clip.root * across, contacts, clip.fps, manifest=manifest)


def _mirrored_place(place: Mapping[str, Any]) -> dict[str, Any]:
    """Return a record of a place or of travel with x and heading negated."""
    return {name: 0.0 - value if name in ("x", "heading") else value for name, value in place.items()}
