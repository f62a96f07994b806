"""A written BVH in three.js: every joint where the npz has it.

Wants Node and the npm package `three`, installed in a folder that MAREY_THREE names; neither is a dependency.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from marey.motion.clip import load_npz
from marey.motion.io.bvh import write_bvh
from tests.support.exported import CLIPS

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).with_name("three_joints.mjs")


@pytest.fixture(scope="module")
def three() -> list[str]:
    """The beginning of a command that reads a BVH file with three.js."""
    node, folder = shutil.which("node"), os.environ.get("MAREY_THREE")
    if node is None:
        pytest.skip("there is no Node here")
    if not folder or not (Path(folder) / "node_modules" / "three").is_dir():
        pytest.skip("there is no three.js here (npm install three, and name that folder in MAREY_THREE)")
    return [node, str(SCRIPT), folder]


@pytest.mark.parametrize("root_bone", [False, True])
@pytest.mark.parametrize("name", CLIPS)
def test_three_puts_every_joint_where_the_npz_has_it(name, root_bone, three, tmp_path):
    clip = CLIPS[name]
    if root_bone and "root" in clip.skeleton.joint_names:
        pytest.skip("this skeleton has a joint named root")
    clip.save_npz(tmp_path / "a.npz")
    write_bvh(tmp_path / "a.bvh", clip, root_bone=root_bone)
    done = subprocess.run([*three, tmp_path / "a.bvh"], check=True, capture_output=True, text=True, timeout=120)
    assert done.stderr == ""
    wanted, seen = load_npz(tmp_path / "a.npz"), json.loads(done.stdout)
    order = [seen["names"].index(joint) for joint in wanted.skeleton.joint_names]
    joints = np.array(seen["joints"])[:, order] / 100  # centimetres
    assert joints.shape == wanted.joints.shape
    assert np.linalg.norm(joints - wanted.joints, axis=-1).max() < 1e-3
    np.testing.assert_allclose(seen["times"], np.arange(wanted.frames) / wanted.fps, atol=1e-5)
