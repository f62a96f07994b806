"""Feet of a finished motion: locked, found again, or as the model generated them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.body import NamedBody
from marey.motion.clip import MotionClip
from marey.motion.edits.place import posed
from marey.motion.features import LAYOUTS
from marey.motion.feet import clean_feet, find_contacts, need_feet
from marey.motion.finish import CLEANED, finish_motion
from marey.motion.kinematics import bone_lengths
from marey.motion.pose import aim_bones, checked_joints


def set_feet(clip: MotionClip, values: Mapping[str, Any]) -> MotionClip:
    """Lock standing feet, find the contacts again, or go back to the model's feet.

    Raises:
        InvalidInput: the feet of the skeleton are not known, or there are no features to go back to.
    """
    return {"lock": _locked, "free": _free, "raw": _raw}[values["mode"]](clip)


def found_contacts(clip: MotionClip) -> NDArray[np.bool_]:
    """Return the contacts (T, 4) of the poses; none where the feet of the skeleton are not known."""
    if not clip.skeleton.feet:
        return np.zeros((clip.frames, 4), bool)
    return find_contacts(clip.joints.astype(np.float64), clip.skeleton, clip.fps)


def _locked(clip: MotionClip) -> MotionClip:
    need_feet(clip.skeleton)
    joints, contacts = clean_feet(clip.joints, clip.skeleton, clip.fps)
    rotations = aim_bones(joints, clip.rotations.astype(np.float64), clip.skeleton)
    return posed(clip, rotations, joints[:, 0], contacts=contacts, manifest={**clip.manifest, CLEANED: True})


def _free(clip: MotionClip) -> MotionClip:
    need_feet(clip.skeleton)
    return replace(clip, contacts=found_contacts(clip))


def _raw(clip: MotionClip) -> MotionClip:
    """Finish the features again without clean-up, on the skeleton of the training data: the clip's, scaled."""
    layout = next((each for each in LAYOUTS.values() if each.skeleton.name == clip.skeleton.name), None)
    if layout is None or not clip.features.size or clip.features.shape[1] != layout.dim:
        raise InvalidInput(
            "the motion has no features, which the raw feet are made of",
            hint="Only generated motions have them, until they are edited: make it the first operation.",
        )
    joints = checked_joints(layout.decode(clip.features), layout.skeleton)
    bones = np.linalg.norm(clip.skeleton.offsets[1:], axis=1)
    scale = float(np.median(np.median(bone_lengths(joints, layout.skeleton)[:, 1:], axis=0) / bones))
    trained = replace(cast("Any", layout), skeleton=clip.skeleton.with_offsets(scale * clip.skeleton.offsets))
    body = NamedBody("", clip.skeleton)
    manifest = {**clip.manifest, CLEANED: False}
    return finish_motion(clip.features, trained, body=body, fps=clip.fps, clean=False, manifest=manifest)
