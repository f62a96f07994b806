"""A loop with what comes before and after it when it is played on: retargeted so, its last frame leads to its first."""

from __future__ import annotations

from collections.abc import Mapping
from typing import cast

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.arrange import cycle_numbers
from marey.motion.clip import MotionClip
from marey.motion.export_options import ExportOptions
from marey.motion.kinematics import facing
from marey.motion.rotations import Array, about, conjugate, multiply, rotate

REACH = 2.0
"""Seconds before and after a frame that retargeting may look at: filters of 0.25 s, and the step from one stance of a
foot to the next."""


def played_around(clip: MotionClip, options: ExportOptions) -> tuple[MotionClip, slice]:
    """Return a loop with the end of its cycle before it and the beginning after it, and where it stands in that; a
    motion that is no loop as it is.

    Args:
        clip: poses as the options place them; `loop` of the manifest is that of a cycle which travels.
        options: with `in_place` the cycle does not travel any more.

    Raises:
        InvalidInput: the record of the loop cannot be read.
    """
    whole = slice(0, clip.frames)
    record = clip.manifest.get("loop")
    if record is None or not clip.skeleton.facing:
        return clip, whole
    cycle = clip.frames - (_end_of(record) == "closed")
    turn, shift = _travel(clip, record, options)
    count = min(round(REACH * clip.fps), cycle)
    before = slice(cycle - count, cycle)
    after = slice(clip.frames - cycle, clip.frames - cycle + count)
    rotations, root = clip.rotations.astype(np.float64), clip.root.astype(np.float64)
    back = conjugate(turn)
    earlier, later = rotations[before].copy(), rotations[after].copy()
    earlier[:, 0], later[:, 0] = multiply(back, earlier[:, 0]), multiply(turn, later[:, 0])
    places = [rotate(back, root[before] - shift), root, rotate(turn, root[after]) + shift]
    contacts = np.concatenate([clip.contacts[before], clip.contacts, clip.contacts[after]])
    longer = MotionClip.of(
        clip.skeleton,
        np.concatenate([earlier, rotations, later]),
        np.concatenate(places),
        contacts,
        clip.fps,
        manifest=clip.manifest,
    )
    return longer, slice(count, count + clip.frames)


def _end_of(record: object) -> str:
    end = cast("Mapping[str, object]", record).get("end") if isinstance(record, Mapping) else None
    if end not in ("closed", "open"):
        raise InvalidInput("is neither closed nor open", where="manifest: loop.end")
    return cast("str", end)


def _travel(clip: MotionClip, record: object, options: ExportOptions) -> tuple[Array, Array]:
    """Return turn (4,) and way (3,) that take a cycle to the next one, in the world."""
    if options.in_place:
        return about("Y", 0.0), np.zeros(3)
    x, z, angle = cycle_numbers(record, ("x", "z", "heading"))
    ahead = facing(clip.joints[0].astype(np.float64), clip.skeleton)
    way = rotate(about("Y", float(np.arctan2(ahead[0], ahead[2]))), np.array([x, 0.0, z]))
    turn, first = about("Y", angle), clip.root[0].astype(np.float64) * [1.0, 0.0, 1.0]
    return turn, first + way - rotate(turn, first)
