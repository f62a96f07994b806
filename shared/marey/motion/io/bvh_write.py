"""Write BVH files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.arrange import Posed, arrange
from marey.motion.export_options import PLAIN, BvhRoot, ExportOptions, InPlace, Placement
from marey.motion.files import write_atomically
from marey.motion.rotations import (
    Z_TO_Y,
    Array,
    conjugate,
    continuous_euler,
    multiply,
    normalize,
    rotate,
    to_euler,
)
from marey.motion.skeleton import Skeleton
from marey.motion.units import METRES, Unit, Up


def write_bvh(
    path: Path | str,
    clip: Posed,
    *,
    unit: Unit = "cm",
    up: Up = "y",
    bvh_root: BvhRoot = "zero",
    root_bone: bool = False,
    in_place: InPlace | None = None,
    tpose_frame: bool = False,
    placement: Placement = "origin",
) -> None:
    """Write a clip atomically: OFFSETs are the T-pose, joint names the skeleton's, no comments.

    The root's OFFSET is zero, because programs differ in whether position channels replace it or are added to it; for
    the same reason only the root has position channels, with the pelvis under a root bone, and bones that change length
    are refused.

    Args:
        path: the file.
        clip: a MotionClip or a BvhClip.
        unit, up: of the file's numbers.
        bvh_root, root_bone, in_place, tpose_frame, placement: see `ExportOptions`.

    Raises:
        InvalidInput: joints of the clip change their distance, it holds numbers that are not finite, or two options
            contradict each other.
    """
    options = ExportOptions(
        bvh_root=bvh_root, root_bone=root_bone, in_place=in_place, tpose_frame=tpose_frame, placement=placement
    )
    write_atomically(Path(path), format_bvh(clip, unit=unit, up=up, options=options).encode())


def format_bvh(clip: Posed, *, unit: Unit = "cm", up: Up = "y", options: ExportOptions = PLAIN) -> str:
    """Return the text of the BVH file; see `write_bvh`."""
    posed = arrange(clip, options)
    moving = posed.positions.shape[1]
    layout = Layout(
        posed.skeleton, ends=posed.ends, unit=unit, up=up, moving=moving, root_offset=options.bvh_root == "offset"
    )
    rows = layout.rows(posed.positions, continuous_euler(layout.angles(posed.rotations)))
    return "\n".join([layout.header(str(len(rows)), posed.fps), *rows]) + "\n"


class Layout:
    """A skeleton in BVH form: the only code that formats a header and a row of numbers.

    Joints are depth first in the file, whatever their order in the arrays.

    Args:
        skeleton: its offsets become the OFFSETs.
        ends: (J, 3) End Site offsets in metres; NaN or None = a short bone in the direction of the last one.
        unit: unit of the file's lengths.
        up: the axis of the file that points up.
        moving: joints with position channels: their number from the root on, such as 2 with a root bone, or the joints.
        root_offset: the root's OFFSET is its place in the rest pose; otherwise the OFFSETs of `moving` joints are zero.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        *,
        ends: Array | None = None,
        unit: Unit = "cm",
        up: Up = "y",
        moving: int | Sequence[int] = 1,
        root_offset: bool = False,
    ) -> None:
        self.skeleton = skeleton
        self.up = up
        self._moving = list(range(moving)) if isinstance(moving, int) else sorted(moving)
        self._scale = 1 / METRES[unit]
        self._offsets = self._turned(skeleton.offsets * self._scale)
        if not root_offset:
            self._offsets[self._moving] = 0
        self._tips = self._turned(_tips(skeleton, ends) * self._scale)
        self._order: list[int] = []
        self._hierarchy = ["HIERARCHY"]
        self._joint(0, 0)

    def header(self, frames: str, fps: float) -> str:
        """Return the part before the numbers, without the end of its last line; `frames` is the frame count."""
        return "\n".join([*self._hierarchy, "MOTION", f"Frames: {frames}", f"Frame Time: {1 / fps:.8f}"])

    def angles(self, rotations: NDArray[np.floating[Any]]) -> Array:
        """Convert local quaternions (T, J, 4) to Euler angles (T, J, 3) in degrees, each frame by itself;
        `continuous_euler` removes jumps between frames."""
        turns = np.asarray(rotations, np.float64)
        if self.up == "z":
            turns = multiply(multiply(conjugate(Z_TO_Y), turns), Z_TO_Y)
        return to_euler(turns, "ZYX")

    def rows(self, positions: NDArray[np.floating[Any]], angles: Array) -> list[str]:
        """Format the lines of numbers, without their ends.

        Args:
            positions: (T, P, 3) of the moving joints in ascending order, metres, Y up, in the axes of the parents.
            angles: (T, J, 3) degrees, in the skeleton's order.

        Raises:
            InvalidInput: numbers that are not finite.
        """
        places = self._turned(np.asarray(positions, np.float64) * self._scale)
        column = {joint: number for number, joint in enumerate(self._moving)}
        columns: list[Array] = []
        for joint in self._order:
            columns += [places[:, column[joint]]] if joint in column else []
            columns.append(angles[:, joint])
        values = np.concatenate(columns, axis=1)
        if not np.isfinite(values).all():
            raise InvalidInput("the clip holds NaN or infinite numbers", where=self.skeleton.name)
        values = np.round(values, 6) + 0.0  # no -0
        row = " ".join(["%.6f"] * values.shape[1])
        return [row % tuple(numbers) for numbers in values.tolist()]

    def _turned(self, vectors: Array) -> Array:
        return rotate(conjugate(Z_TO_Y), vectors) if self.up == "z" else vectors

    def _joint(self, j: int, depth: int) -> None:
        self._order.append(j)
        children, pad = self.skeleton.children[j], "\t" * depth
        channels = "3 Zrotation Yrotation Xrotation"
        if j in self._moving:
            channels = "6 Xposition Yposition Zposition Zrotation Yrotation Xrotation"
        self._hierarchy += [
            f"{pad}{'JOINT' if j else 'ROOT'} {_word(self.skeleton.joint_names[j])}",
            f"{pad}{{",
            f"{pad}\tOFFSET {_vector(self._offsets[j])}",
            f"{pad}\tCHANNELS {channels}",
        ]
        for child in children:
            self._joint(child, depth + 1)
        if not children:
            self._hierarchy += [f"{pad}\tEnd Site", f"{pad}\t{{"]
            self._hierarchy += [f"{pad}\t\tOFFSET {_vector(self._tips[j])}", f"{pad}\t}}"]
        self._hierarchy.append(f"{pad}}}")


def _vector(v: Array) -> str:
    return " ".join(f"{x + 0.0:.6f}" for x in np.round(v, 6))


def _word(name: str) -> str:
    """Return a joint name as one word of the file: whitespace and braces would end it."""
    return re.sub(r"[\s{}]+", "_", name) or "_"


def _tips(skeleton: Skeleton, ends: Array | None) -> Array:
    """Return End Site offsets (J, 3) in metres: the given ones, else a short bone in the last one's direction (toes:
    forward)."""
    offsets = np.asarray(skeleton.offsets, np.float64)
    tips = 0.15 * normalize(offsets)
    for toe in skeleton.feet[1::2]:
        tips[toe] = [0.0, 0.0, 0.05]
    return tips if ends is None else np.where(np.isfinite(ends), ends, tips)
