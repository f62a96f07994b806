"""One motion after another: the second begins at the last pose of the first, and their difference fades.

The difference of poses and of speeds at the joint is added to the second motion and fades out (inertialisation, Bollo,
"Inertialization: High-Performance Animation Transitions in Gears of War", GDC 2018), here by a cubic Hermite curve.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.edits.place import heading_of, moved, posed
from marey.motion.edits.prompts import joined
from marey.motion.resample import resample
from marey.motion.rotations import Array, about, conjugate, from_rotvec, multiply, rotate, to_rotvec

SAME_TURN, SAME_PLACE = 2e-3, 1e-3
"""Radians and metres up to which two poses are the same: pieces of one motion are joined as they are."""
SAME_BONES = 1e-4
"""Metres."""
READ_PROMPT = ("rewritten", "not_rewritten", "graph", "scope")
"""Keys of a manifest that say how its prompt was read."""


def concat(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Let another motion follow: n + m - 1 frames, since its first pose is the last of the clip.

    Args:
        values: `with`, the other motion, and `blend`, the seconds of the fading.

    Raises:
        InvalidInput: the skeletons differ.
    """
    second = values["with"]
    _check_bodies(clip, second)
    second = _placed(resample(second, clip.fps), clip)
    rotations, root = _faded(clip, second, round(values["blend"] * clip.fps))
    return posed(
        clip,
        np.concatenate([clip.rotations.astype(np.float64), rotations[1:]]),
        np.concatenate([clip.root.astype(np.float64), root[1:]]),
        contacts=np.concatenate([clip.contacts, second.contacts[1:]]),
        manifest=_joined_prompts(clip, second),
    )


def _joined_prompts(clip: MotionClip, second: MotionClip) -> dict[str, Any]:
    """Return the clip's manifest with the prompts of both, each with its first frame, where they differ.

    What was read in the first prompt alone is left out.
    """
    ours = clip.manifest.get("prompt", "")
    both = joined(ours, second.manifest.get("prompt", ""))
    if both == ours:
        return dict(clip.manifest)
    prompts = _prompts(clip) + [[frame + clip.frames - 1, text] for frame, text in _prompts(second)]
    kept = {name: value for name, value in clip.manifest.items() if name not in READ_PROMPT}
    return {**kept, "prompt": both, "prompts": prompts}


def _prompts(clip: MotionClip) -> list[list[Any]]:
    """Return the prompts of a motion, each with its first frame."""
    given: Any = clip.manifest.get("prompts")
    return [[frame, text] for frame, text in given] if given else [[0, clip.manifest["prompt"]]]


def _check_bodies(clip: MotionClip, second: MotionClip) -> None:
    ours, theirs = clip.skeleton, second.skeleton
    if ours.joint_names != theirs.joint_names or ours.parents != theirs.parents:
        raise InvalidInput("the motions have different skeletons", hint="Join motions of one skeleton.")
    apart = float(np.abs(ours.offsets[1:] - theirs.offsets[1:]).max(initial=0.0))
    if apart > SAME_BONES:
        raise InvalidInput(
            f"the bodies differ: a bone ends {1000 * apart:.1f} mm apart",
            hint="Generate both motions with one body.",
        )


def _placed(second: MotionClip, clip: MotionClip) -> MotionClip:
    """Return the second motion at the place and heading of the clip's last pose."""
    turn = about("Y", heading_of(clip, -1) - heading_of(second, 0))
    shift = clip.root[-1].astype(np.float64) - rotate(turn, second.root[0].astype(np.float64))
    return moved(second, turn, shift * np.array([1.0, 0.0, 1.0]))


def _faded(clip: MotionClip, second: MotionClip, frames: int) -> tuple[Array, Array]:
    """Return rotations (m, J, 4) and root (m, 3) of the placed second motion with the fading difference."""
    rotations, root = second.rotations.astype(np.float64), second.root.astype(np.float64)
    turn = to_rotvec(multiply(clip.rotations[-1].astype(np.float64), conjugate(rotations[0])))
    way = clip.root[-1].astype(np.float64) - root[0]
    if np.abs(turn).max() <= SAME_TURN and np.abs(way).max() <= SAME_PLACE:
        return rotations, root
    turning, moving = _speed(clip, slice(-2, None)), _speed(second, slice(0, 2))
    span = min(frames, len(root) - 1)
    k = np.arange(span + 1, dtype=np.float64)[:, None]
    turns = from_rotvec(fade(turn, turning[0] - moving[0], k[..., None], span))
    rotations[: span + 1] = multiply(turns, rotations[: span + 1])
    root[: span + 1] += fade(way, turning[1] - moving[1], k, span)
    return rotations, root


def _speed(clip: MotionClip, two: slice) -> tuple[Array, Array]:
    """Return how far joints (J, 3) turn and the root (3,) moves from one frame to the next: radians, metres."""
    rotations, root = clip.rotations[two].astype(np.float64), clip.root[two].astype(np.float64)
    if len(root) < 2:
        return np.zeros((len(clip.skeleton), 3)), np.zeros(3)
    return to_rotvec(multiply(rotations[1], conjugate(rotations[0]))), root[1] - root[0]


def fade(value: Array, slope: Array, k: Array, span: int) -> Array:
    """Return a cubic Hermite curve from `value`, with `slope` a frame, at k = 0 to zero at k = span."""
    if span < 1:
        return np.where(k == 0, value, 0.0)
    t = k / span
    return (1 + 2 * t) * (1 - t) ** 2 * value + t * (1 - t) ** 2 * span * slope
