"""Written glb files in other programs: valid, and every joint where the npz has it.

Wants Node and the npm packages `three` and `gltf-validator`, installed in a folder that MAREY_THREE names; and Blender,
or a Python with the `bpy` module that MAREY_BPY_PYTHON names. None is a dependency.
"""

from __future__ import annotations

import importlib.util
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from marey.exporters import Coordinates, exporter_of
from marey.motion.io.glb_write import write_glb
from tests.support.exported import CLIPS

pytestmark = pytest.mark.slow

HERE = Path(__file__).parent
VARIANTS = {"plain": {}, "root bone": {"root_bone": True}, "T-pose": {"tpose_frame": True, "root_bone": True}}
VARIANTS |= {"body": {"mesh": True}, "body and root bone": {"mesh": True, "root_bone": True}}


@pytest.fixture(scope="module")
def node() -> list[str]:
    """The beginning of a command that runs a script of this folder in Node, and the folder with its packages."""
    program, folder = shutil.which("node"), os.environ.get("MAREY_THREE")
    if program is None:
        pytest.skip("there is no Node here")
    packages = Path(folder or "nowhere") / "node_modules"
    if not all((packages / name).is_dir() for name in ("three", "gltf-validator")):
        pytest.skip("npm install three gltf-validator, and name that folder in MAREY_THREE")
    return [program, str(folder)]


@pytest.fixture(scope="module")
def blender() -> list[str]:
    """The beginning of a command that runs the script in Blender."""
    script = str(HERE / "blender_glb.py")
    if python := os.environ.get("MAREY_BPY_PYTHON"):
        return [python, script]
    if importlib.util.find_spec("bpy"):
        return [sys.executable, script]
    if program := shutil.which("blender"):
        return [program, "--background", "--factory-startup", "--python", script, "--"]
    pytest.skip("there is no Blender here (name a Python that has `bpy` in MAREY_BPY_PYTHON)")


def run_script(node: list[str], script: str, path: Path):
    program, folder = node
    done = subprocess.run(
        [program, HERE / script, folder, path], check=True, capture_output=True, text=True, timeout=120
    )
    assert done.stderr == ""
    return json.loads(done.stdout)


@pytest.mark.parametrize("variant", VARIANTS)
@pytest.mark.parametrize("name", CLIPS)
def test_the_validator_of_khronos_has_nothing_to_say(name, variant, node, tmp_path):
    if "root_bone" in VARIANTS[variant] and "root" in CLIPS[name].skeleton.joint_names:
        pytest.skip("this skeleton has a joint named root")
    content = exporter_of("glb").write(CLIPS[name], Coordinates(**VARIANTS[variant]))
    (tmp_path / "a.glb").write_bytes(content)
    messages = run_script(node, "glb_faults.mjs", tmp_path / "a.glb")
    assert {(each["code"], each["severity"]) for each in messages} <= {("UNUSED_OBJECT", 2)}, "there is no mesh"


@pytest.mark.parametrize("name", CLIPS)
def test_three_puts_every_joint_where_the_npz_has_it(name, node, tmp_path):
    clip = CLIPS[name]
    write_glb(tmp_path / "a.glb", clip)
    seen = run_script(node, "three_glb.mjs", tmp_path / "a.glb")
    order = [seen["names"].index(joint) for joint in clip.skeleton.joint_names]
    joints = np.array(seen["joints"])[:, order]
    assert joints.shape == clip.joints.shape
    assert np.linalg.norm(joints - clip.joints, axis=-1).max() < 1e-3
    np.testing.assert_allclose(seen["times"], np.arange(clip.frames) / clip.fps, atol=1e-5)
    assert seen["extras"]["manifest"] == json.loads(json.dumps(clip.manifest))


@pytest.mark.parametrize("name", CLIPS)
def test_blender_puts_every_joint_where_the_npz_has_it(name, blender, tmp_path):
    clip = CLIPS[name]
    write_glb(tmp_path / "a.glb", clip)
    subprocess.run([*blender, tmp_path / "a.glb", tmp_path / "seen.npz"], check=True, capture_output=True, timeout=300)
    with np.load(tmp_path / "seen.npz") as seen:
        order = [list(seen["names"]).index(joint) for joint in clip.skeleton.joint_names]
        assert seen["joints"][:, order].shape == clip.joints.shape
        assert np.linalg.norm(seen["joints"][:, order] - clip.joints, axis=-1).max() < 1e-3
        np.testing.assert_allclose(seen["times"], np.arange(clip.frames) / clip.fps, atol=1e-3)
        assert seen["rest"][:, 1].min() == pytest.approx(0, abs=1e-4), "the toes are on the floor at rest"
