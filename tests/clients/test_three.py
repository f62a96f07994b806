"""A written BVH in three.js: every joint where the npz has it; see `tests.support.clients` for what is needed."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.clip import load_npz
from marey.motion.io.bvh import write_bvh
from tests.support.clients import node
from tests.support.exported import CLIPS

pytestmark = pytest.mark.slow

CASES = [(name, bone) for name in CLIPS for bone in (False, True) if (name, bone) != ("tumbling KIT joints", True)]
"""KIT's skeleton has a joint named root."""


@pytest.mark.parametrize(("name", "root_bone"), CASES)
def test_three_puts_every_joint_where_the_npz_has_it(name, root_bone, tmp_path):
    clip = CLIPS[name]
    clip.save_npz(tmp_path / "a.npz")
    write_bvh(tmp_path / "a.bvh", clip, root_bone=root_bone)
    wanted, seen = load_npz(tmp_path / "a.npz"), node("three_joints.mjs", "three", tmp_path / "a.bvh")
    order = [seen["names"].index(joint) for joint in wanted.skeleton.joint_names]
    joints = np.array(seen["joints"])[:, order] / 100  # centimetres
    assert joints.shape == wanted.joints.shape
    assert np.linalg.norm(joints - wanted.joints, axis=-1).max() < 1e-3
    np.testing.assert_allclose(seen["times"], np.arange(wanted.frames) / wanted.fps, atol=1e-5)
