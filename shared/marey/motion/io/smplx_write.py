"""Write motions as SMPL-X parameters: an npz with the keys that AMASS and the SMPL-X add-on of Blender use."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from numpy.typing import NDArray

from marey.core.errors import InvalidInput
from marey.motion.io.rig_smplx import JOINTS, SOURCE
from marey.motion.rigs.rig import Rig
from marey.motion.rigs.rigged import RiggedMotion
from marey.motion.rotations import Z_TO_Y, conjugate, multiply, rotate, to_rotvec

BETAS = 16
BODY, FACE = 22, 25
"""Joints before the face, and before the hands."""


def format_smplx(motion: RiggedMotion) -> bytes:
    """Return the bytes of the npz file: metres, Z up, facing -Y, on the mean body of the model. Equal motions give
    equal bytes.

    The pelvis stands at `J0 + trans`, where J0 is its place in the model, and the whole body is turned about it by
    `root_orient`. Face and fingers are at rest.

    Args:
        motion: on the rig of an SMPL-X model (`parse_smplx_rig`).

    Raises:
        InvalidInput: on another rig, or numbers that are not finite.
    """
    rig = motion.rig
    check_rig(rig)
    order = [rig.index(name) for name in JOINTS]
    rotations, up = motion.rotations[:, order].copy(), conjugate(Z_TO_Y)
    rotations[:, 0] = multiply(up, rotations[:, 0])
    rotations[:, BODY:] = [1.0, 0.0, 0.0, 0.0]
    poses = to_rotvec(rotations).reshape(motion.frames, -1)
    trans = rotate(up, motion.translations[:, order[0]]) - rig.positions[order[0]]
    if not (np.isfinite(poses).all() and np.isfinite(trans).all()):
        raise InvalidInput("the motion holds NaN or infinite numbers", where=rig.name)
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **_arrays(poses, trans, motion.fps))
    return buffer.getvalue()


def check_rig(rig: Rig) -> None:
    """Validate that a rig is an SMPL-X model.

    Raises:
        InvalidInput: it is not.
    """
    if rig.source != SOURCE:
        raise InvalidInput(
            "smplx files need the rest joints of the SMPL-X model",
            where=rig.name,
            hint="Name the model's file, such as SMPLX_NEUTRAL.npz, as the rig.",
            argument="rig",
        )


def _arrays(poses: NDArray[Any], trans: NDArray[Any], fps: float) -> dict[str, NDArray[Any]]:
    """Return the arrays of the file: `poses` (T, 165) and its parts, `trans` (T, 3), and what they refer to."""
    poses = poses.astype(np.float32)
    eyes = 3 * (BODY + 1)
    return {
        "surface_model_type": np.array(SOURCE),
        "gender": np.array("neutral"),
        "mocap_frame_rate": np.array(fps, np.float64),
        "mocap_framerate": np.array(fps, np.float64),
        "mocap_time_length": np.array(len(poses) / fps, np.float64),
        "betas": np.zeros(BETAS),
        "num_betas": np.array(BETAS, np.int64),
        "trans": trans.astype(np.float32),
        "poses": poses,
        "root_orient": poses[:, :3],
        "pose_body": poses[:, 3 : 3 * BODY],
        "pose_jaw": poses[:, 3 * BODY : eyes],
        "pose_eye": poses[:, eyes : 3 * FACE],
        "pose_hand": poses[:, 3 * FACE :],
    }
