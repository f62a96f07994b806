"""A written BVH in Blender: every joint where the npz has it.

Wants a Python with the `bpy` module, named by MAREY_BPY_PYTHON, or Blender itself on the path; neither is a dependency.
"""

from __future__ import annotations

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from marey.motion.clip import load_npz
from marey.motion.io.bvh import write_bvh
from tests.support.exported import CLIPS

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).with_name("blender_joints.py")


@pytest.fixture(scope="module")
def blender() -> list[str]:
    """The beginning of a command that runs a script in Blender."""
    if python := os.environ.get("MAREY_BPY_PYTHON"):
        return [python, str(SCRIPT)]
    if importlib.util.find_spec("bpy"):
        return [sys.executable, str(SCRIPT)]
    if program := shutil.which("blender"):
        return [program, "--background", "--factory-startup", "--python", str(SCRIPT), "--"]
    pytest.skip("there is no Blender here (name a Python that has `bpy` in MAREY_BPY_PYTHON)")


@pytest.mark.parametrize("options", [{}, {"root_bone": True}, {"bvh_root": "offset"}], ids=["plain", "root", "offset"])
@pytest.mark.parametrize("name", CLIPS)
def test_blender_puts_every_joint_where_the_npz_has_it(name, options, blender, tmp_path):
    clip = CLIPS[name]
    if options.get("root_bone") and "root" in clip.skeleton.joint_names:
        pytest.skip("this skeleton has a joint named root")
    clip.save_npz(tmp_path / "a.npz")
    write_bvh(tmp_path / "a.bvh", clip, **options)
    subprocess.run([*blender, tmp_path / "a.bvh", tmp_path / "seen.npz"], check=True, capture_output=True, timeout=300)
    wanted = load_npz(tmp_path / "a.npz")
    with np.load(tmp_path / "seen.npz") as seen:
        order = [list(seen["names"]).index(joint) for joint in wanted.skeleton.joint_names]
        assert seen["joints"][:, order].shape == wanted.joints.shape
        assert np.linalg.norm(seen["joints"][:, order] - wanted.joints, axis=-1).max() < 1e-3
        assert float(seen["fps"]) == pytest.approx(wanted.fps, rel=1e-4)
