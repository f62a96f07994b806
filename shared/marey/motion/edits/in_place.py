"""Removal of the travel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from marey.motion.arrange import headings, travel_of
from marey.motion.clip import MotionClip
from marey.motion.edits.place import posed
from marey.motion.rotations import conjugate, multiply


def in_place(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Remove the travel (X and Z of the root), or travel and heading; the manifest records what was removed."""
    rotations, root = clip.rotations.astype(np.float64), clip.root.astype(np.float64)
    turned = headings(rotations[:, 0])
    manifest = {**clip.manifest, **travel_of(root, turned, clip.fps)}
    root[:, [0, 2]] = root[:1, [0, 2]]
    if values["remove"] == "heading":
        rotations[:, 0] = multiply(conjugate(turned), rotations[:, 0])
    return posed(replace(clip, manifest=manifest), rotations, root)
