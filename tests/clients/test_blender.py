"""A written BVH in Blender: every joint where the npz has it. `tests.support.clients` says what has to be installed."""

from __future__ import annotations

import numpy as np
import pytest

from marey.motion.clip import load_npz
from marey.motion.io.bvh import write_bvh
from tests.support.clients import blender
from tests.support.exported import CLIPS

pytestmark = pytest.mark.slow

OPTIONS = {"plain": {}, "root": {"root_bone": True}, "offset": {"bvh_root": "offset"}}
CASES = [(name, options) for name in CLIPS for options in OPTIONS if (name, options) != ("tumbling KIT joints", "root")]
"""KIT's skeleton has a joint named root."""


@pytest.mark.parametrize(("name", "options"), CASES)
def test_blender_puts_every_joint_where_the_npz_has_it(name, options, tmp_path):
    clip = CLIPS[name]
    clip.save_npz(tmp_path / "a.npz")
    write_bvh(tmp_path / "a.bvh", clip, **OPTIONS[options])
    blender("blender_joints.py", tmp_path / "a.bvh", tmp_path / "seen.npz")
    wanted = load_npz(tmp_path / "a.npz")
    with np.load(tmp_path / "seen.npz") as seen:
        order = [list(seen["names"]).index(joint) for joint in wanted.skeleton.joint_names]
        assert seen["joints"][:, order].shape == wanted.joints.shape
        assert np.linalg.norm(seen["joints"][:, order] - wanted.joints, axis=-1).max() < 1e-3
        assert float(seen["fps"]) == pytest.approx(wanted.fps, rel=1e-4)
