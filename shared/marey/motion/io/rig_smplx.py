"""Read the neutral rest joints of SMPL-X from its model file, such as `SMPLX_NEUTRAL.npz`.

The model (Pavlakos et al., "Expressive Body Capture", CVPR 2019) may not be passed on, so Marey ships none of its
numbers: users get it at https://smpl-x.is.tue.mpg.de under its own terms. Joints are `J_regressor @ v_template`.
"""

from __future__ import annotations

import hashlib
from pathlib import PurePath

import numpy as np

from marey.core.arrays import check_array, parse_npz
from marey.motion.rigs.make_rig import RigNode, make_rig
from marey.motion.rigs.rig import Rig

_FINGERS = [f"{finger}{n}" for finger in ("index", "middle", "pinky", "ring", "thumb") for n in (1, 2, 3)]
JOINTS = [
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
    "jaw",
    "left_eye_smplhf",
    "right_eye_smplhf",
] + [f"{side}_{finger}" for side in ("left", "right") for finger in _FINGERS]
"""Names of the 55 joints in the order of the model's arrays."""
_HAND = {
    f"{side}_{f}": f"{side}_{f[:-1]}{int(f[-1]) - 1}" for side in ("left", "right") for f in _FINGERS if f[-1] > "1"
}
_BODY = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 15, 15, 15)
PARENTS = (
    *_BODY,
    *(JOINTS.index(_HAND.get(name, f"{name.split('_')[0]}_wrist")) for name in JOINTS[len(_BODY) :]),
)
"""Parent of each joint (`kintree_table` of the model)."""
SOURCE = "smplx"
MAX_UNPACKED = 2**28
VERTICES = 10475


def parse_smplx_rig(data: bytes, where: str = "npz") -> Rig:
    """Read the bytes of a model file: the rest joints of the mean body, the axes of all joints along the world's.

    Raises:
        InvalidFile: not an SMPL-X model as npz.
        TooLarge: its arrays are over 256 MiB.
    """
    hint = "Give the model of SMPL-X as npz, such as SMPLX_NEUTRAL.npz."
    arrays = parse_npz(data, where, ("v_template", "J_regressor"), limit=MAX_UNPACKED, hint=hint)
    points = check_array(arrays["v_template"], "v_template", where, kinds="f", shape=(VERTICES, 3), hint=hint)
    weights = check_array(
        arrays["J_regressor"], "J_regressor", where, kinds="f", shape=(len(JOINTS), VERTICES), hint=hint
    )
    places = weights.astype(np.float64) @ points.astype(np.float64)
    nodes: list[RigNode] = []
    for name, parent, place in zip(JOINTS, PARENTS, places, strict=True):
        matrix = np.eye(4)
        matrix[:3, 3] = place
        nodes.append(RigNode(name, parent, matrix))
    sha256 = hashlib.sha256(data).hexdigest()
    return make_rig(nodes, name=PurePath(where).name, where=where, unit=1.0, up="y", source=SOURCE, sha256=sha256)
