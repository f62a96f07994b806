"""Statistics of random weights."""

from __future__ import annotations

import numpy as np

from marey.motion.features import HUMANML3D_263
from marey.motion.kinematics import bone_lengths
from marey.motion.skeleton import HUMANML3D
from marey.nn.bundling import standing


def test_random_weights_have_the_statistics_of_a_standing_body() -> None:
    mean, std = standing("humanml3d-263")
    joints = HUMANML3D_263.decode(np.repeat(mean[None], 5, 0))
    lengths = np.linalg.norm(HUMANML3D.offsets.astype(float), axis=-1)
    assert np.abs(bone_lengths(joints, HUMANML3D)[:, 1:] - lengths[1:]).max() < 1e-3
    assert abs(float(joints[..., 1].min())) < 1e-3
    assert (std > 0).all()
