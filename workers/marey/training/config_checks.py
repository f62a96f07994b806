"""Checks of a configuration's fields against each other that several models share."""

from __future__ import annotations

from collections.abc import Sequence

from marey.core.errors import InvalidInput
from marey.motion.features import layout


def check_body(name: str, features: int, joints: int, fps: float, frames: tuple[int, int]) -> None:
    """Check sizes against the layout of the features, and the shortest motion against the longest.

    Raises:
        InvalidInput: unknown layout, or they contradict each other.
    """
    known = layout(name)
    bones = len(known.skeleton.joint_names)
    if (known.dim, bones, known.fps) != (features, joints, fps):
        raise InvalidInput(
            f"{name} has {known.dim} features of {bones} joints at {known.fps:g} fps, "
            f"not {features} of {joints} at {fps:g}",
            where="layout",
        )
    if frames[0] > frames[1]:
        raise InvalidInput(f"{frames[0]} is over max_frames, {frames[1]}", where="min_frames")


def check_heads(table: str, heads: int, width: int) -> None:
    """Check that the heads of attention divide the width evenly. Raises InvalidInput."""
    if width % heads:
        raise InvalidInput(f"{heads} does not divide the width, {width}", where=f"{table}.heads")


def check_windows(windows: Sequence[int], rate: int) -> None:
    """Check that there are windows, and that each is a number of whole tokens of `rate` frames. Raises InvalidInput."""
    if not windows or any(window % rate for window in windows):
        raise InvalidInput(f"must be multiples of {rate}, the frames of a token, at least one", where="windows")
