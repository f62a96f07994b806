"""Removal of the travel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from marey.motion.arrange import cycle_turn, headings, travel_of
from marey.motion.clip import MotionClip
from marey.motion.edits.place import posed
from marey.motion.rotations import about, conjugate, multiply


def in_place(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Remove the travel (X and Z of the root), or travel and heading; the manifest records what was removed.

    Of a loop, the turn of its cycle is removed too, evenly, so that it ends as it began.
    """
    rotations, root = clip.rotations.astype(np.float64), clip.root.astype(np.float64)
    turned = headings(rotations[:, 0])
    manifest = {**clip.manifest, **travel_of(root, turned, clip.fps)}
    root[:, [0, 2]] = root[:1, [0, 2]]
    if values["remove"] == "heading":
        rotations[:, 0] = multiply(conjugate(turned), rotations[:, 0])
    elif (turn := cycle_turn(clip, len(root))).any():
        rotations[:, 0] = multiply(about("Y", -turn), rotations[:, 0])
    if "loop" in manifest:
        still = {**manifest["loop"]["cycle"], "x": 0.0, "z": 0.0, "heading": 0.0}
        manifest["loop"] = {**manifest["loop"], "cycle": still}
    return posed(replace(clip, manifest=manifest), rotations, root)
