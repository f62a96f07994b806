"""Writing BVH files."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from shared.errors import InvalidInput
from shared.motion.files import write_atomically
from shared.motion.rotations import Array, conjugate, continuous_euler, multiply, normalize, rotate, to_euler
from shared.motion.skeleton import Skeleton
from shared.motion.units import METRES, Z_TO_Y, Unit, Up


class Posed(Protocol):
    """What can be written: a BvhClip or a MotionClip."""

    @property
    def skeleton(self) -> Skeleton: ...
    @property
    def rotations(self) -> NDArray[np.floating[Any]]: ...
    @property
    def root(self) -> NDArray[np.floating[Any]]: ...
    @property
    def fps(self) -> float: ...


def write_bvh(path: Path | str, clip: Posed, *, unit: Unit = "cm", up: Up = "y") -> None:
    """Write a clip: OFFSETs are the T-pose, joint names the skeleton's, no comments; whole or not at all.

    The root's OFFSET is zero, because programs differ in whether position channels replace it or are added to it; for
    the same reason only the root has position channels, and bones that change length are refused.

    Raises:
        InvalidInput: joints of the clip change their distance, or it holds numbers that are not finite.
    """
    write_atomically(Path(path), format_bvh(clip, unit=unit, up=up).encode())


def format_bvh(clip: Posed, *, unit: Unit = "cm", up: Up = "y") -> str:
    """The text of the BVH file; see `write_bvh`."""
    if getattr(clip, "positions", None) is not None:
        raise InvalidInput("bones of this clip change their length, which one set of OFFSETs cannot say")
    scale = 1 / METRES[unit]
    skeleton, rotations = clip.skeleton, np.asarray(clip.rotations, np.float64)
    root, offsets = np.asarray(clip.root, np.float64) * scale, skeleton.offsets * scale
    tips = _tips(clip) * scale
    if up == "z":
        offsets, tips, root = (rotate(conjugate(Z_TO_Y), a) for a in (offsets, tips, root))
        rotations = multiply(multiply(conjugate(Z_TO_Y), rotations), Z_TO_Y)
    # file order is depth first, whatever the order of the arrays
    order: list[int] = []
    lines = ["HIERARCHY"]

    def vector(v: Array) -> str:
        return " ".join(f"{x + 0.0:.6f}" for x in np.round(v, 6))

    def joint(j: int, depth: int) -> None:
        order.append(j)
        pad = "\t" * depth
        lines.append(f"{pad}{'JOINT' if j else 'ROOT'} {_word(skeleton.joint_names[j])}")
        lines.append(f"{pad}{{")
        lines.append(f"{pad}\tOFFSET {vector(offsets[j] if j else np.zeros(3))}")
        channels = (
            "3 Zrotation Yrotation Xrotation" if j else "6 Xposition Yposition Zposition Zrotation Yrotation Xrotation"
        )
        lines.append(f"{pad}\tCHANNELS {channels}")
        for child in skeleton.children[j]:
            joint(child, depth + 1)
        if not skeleton.children[j]:
            lines.extend([f"{pad}\tEnd Site", f"{pad}\t{{", f"{pad}\t\tOFFSET {vector(tips[j])}", f"{pad}\t}}"])
        lines.append(f"{pad}}}")

    joint(0, 0)
    angles = continuous_euler(to_euler(rotations, "ZYX"))[:, order].reshape(len(root), -1)
    values = np.concatenate([root, angles], axis=1)
    if not np.isfinite(values).all():
        raise InvalidInput("the clip holds NaN or infinite numbers", where=skeleton.name)
    values = np.round(values, 6) + 0.0  # no -0
    lines += ["MOTION", f"Frames: {len(values)}", f"Frame Time: {1 / clip.fps:.8f}"]
    row = " ".join(["%.6f"] * values.shape[1])
    lines += [row % tuple(numbers) for numbers in values.tolist()]
    return "\n".join(lines) + "\n"


def _word(name: str) -> str:
    """A joint name as one word of the file: whitespace and braces would end it."""
    return re.sub(r"[\s{}]+", "_", name) or "_"


def _tips(clip: Posed) -> Array:
    """(J, 3) End Site offsets in metres: the file's own, else a short bone on from the last one (toes: forward)."""
    skeleton = clip.skeleton
    offsets = np.asarray(skeleton.offsets, np.float64)
    tips = 0.15 * normalize(offsets)
    for toe in skeleton.feet[1::2]:
        tips[toe] = [0.0, 0.0, 0.05]
    own = getattr(clip, "ends", None)
    return tips if own is None else np.where(np.isfinite(own), own, tips)
