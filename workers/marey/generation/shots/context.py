"""Clips as context of a model: features at its rate, and what its tokens lose of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.generation.kept import as_tokens
from marey.motion.body import travel_scale
from marey.motion.clip import MotionClip
from marey.motion.features import FeatureLayout, encode_all
from marey.motion.kinematics import facing, forward_kinematics
from marey.motion.resample import frame_times, resample
from marey.motion.rotations import Array, about, rotate
from marey.motion.skeleton import Skeleton
from marey.nn.motion_tokenizer import MotionTokenizer

Float32 = NDArray[np.float32]
MOST_NAMED = 4
"""Joints in a message."""
LARGEST_ERROR = 100.0
"""Millimetres a joint, mean; a context that the tokens show worse is refused. Held-out clips of dances have 74."""


def model_features(clip: MotionClip, layout: FeatureLayout) -> Float32:
    """Return the features (Tf, D) of a clip at the rate of a layout: its own if it has them, else those of its poses on
    the skeleton of the layout.

    Args:
        clip: of two frames at least.
        layout: of the model.

    Raises:
        InvalidInput: another skeleton than the layout's.
    """
    if clip.features.shape == (frames_at(clip, layout.fps), layout.dim) and clip.features_fps == layout.fps:
        return clip.features
    training = layout.skeleton
    if clip.skeleton.joint_names != training.joint_names or clip.skeleton.parents != training.parents:
        raise InvalidInput(
            f"the motion has another skeleton than the model: {_difference(clip.skeleton, training)}",
            hint="Edit a generated motion, or one with the same joints.",
        )
    moving = resample(clip, layout.fps)
    root = moving.root.astype(np.float64) / travel_scale(training, clip.skeleton)
    joints = forward_kinematics(training, moving.rotations.astype(np.float64), root)
    return encode_all(layout, joints)


def _difference(given: Skeleton, training: Skeleton) -> str:
    """Return how a skeleton differs from that of a model."""
    if len(given) != len(training):
        return f"{len(given)} joints, not the {len(training)} of {training.name}"
    unknown = [name for name in given.joint_names if name not in training.joint_names]
    if not unknown:
        return f"its joints are joined otherwise than those of {training.name}"
    missing = [name for name in training.joint_names if name not in given.joint_names]
    return f"{_named(unknown)} in place of {_named(missing)} of {training.name}"


def _named(joints: Sequence[str]) -> str:
    return ", ".join(joints[:MOST_NAMED]) + (", …" if len(joints) > MOST_NAMED else "")


def context_error(features: Float32, tokenizer: MotionTokenizer, layout: FeatureLayout) -> float:
    """Return how far a model's tokens show features (t, D) from their poses: millimetres a joint, mean, without place
    and heading."""
    shown = as_tokens(features, tokenizer)
    return 1000 * float(np.linalg.norm(_at_root(features, layout) - _at_root(shown, layout), axis=-1).mean())


def check_error(millimetres: float) -> None:
    """Check that a model's tokens can show its context.

    Raises:
        InvalidInput: they cannot.
    """
    if millimetres > LARGEST_ERROR:
        raise InvalidInput(
            f"the model cannot show the frames beside the edit: its tokens are {millimetres:.0f} mm off, "
            f"and at most {LARGEST_ERROR:.0f} are allowed",
            hint="The movement is unlike all that the model learned. `force` edits it all the same.",
        )


def frames_at(clip: MotionClip, fps: float) -> int:
    """Return the number of frames of a clip at another rate."""
    return len(frame_times(clip.frames, clip.fps, fps))


def _at_root(features: Float32, layout: FeatureLayout) -> Array:
    """Return joints (T, J, 3) of bodies that stand over the origin and face +Z."""
    joints = layout.decode(features).astype(np.float64)
    joints -= joints[:, :1] * np.array([1.0, 0.0, 1.0])
    x, _, z = np.moveaxis(facing(joints, layout.skeleton), -1, 0)
    return rotate(about("Y", -np.arctan2(x, z))[:, None], joints)
