"""A motion on a rig: what exporters write with `--rig`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.motion.rigs.rig import Rig
from marey.motion.rotations import Array, multiply, rotate


@dataclass(frozen=True, eq=False)
class RiggedMotion:
    """Poses of a rig over time.

    Attributes:
        rig: the hierarchy, the rest pose, and what its file needs (`Rig.in_file` converts to unit and axes of it).
        rotations: (T, J, 4) float64 quaternions `w x y z` from the parent (not from the rest pose); of roots, in the
            world.
        translations: (T, J, 3) float64 metres, from the parent in its axes; of roots, in the world. They are the rest
            pose's where a joint is not `moving`.
        moving: (J,) bool, True for joints whose translation changes: the hips or a root bone, and helpers such as
            `ik_foot_l`. The others need no position channels.
        contacts: (T, 4) bool, True where L ankle, L toe, R ankle, R toe stand.
        fps: frames a second.
        hips: the joint that carries the body.
        manifest: provenance of the motion with `rig`: name, sha256 and how joints were mapped; JSON.
        removed: what `in_place` took out, for the manifest; empty otherwise.
    """

    rig: Rig
    rotations: Array = field(repr=False)
    translations: Array = field(repr=False)
    moving: NDArray[np.bool_] = field(repr=False)
    contacts: NDArray[np.bool_] = field(repr=False)
    fps: float
    hips: int = 0
    manifest: Mapping[str, Any] = field(default_factory=dict[str, Any], repr=False)
    removed: Mapping[str, Any] = field(default_factory=dict[str, Any], repr=False)

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.rotations)

    def world(self) -> tuple[Array, Array]:
        """Return orientations (T, J, 4) and positions (T, J, 3) of the joints in the world, metres."""
        turns, places = self.rotations.copy(), self.translations.copy()
        for joint, parent in enumerate(self.rig.parents):
            if parent >= 0:
                turns[:, joint] = multiply(turns[:, parent], turns[:, joint])
                places[:, joint] = places[:, parent] + rotate(turns[:, parent], places[:, joint])
        return turns, places
