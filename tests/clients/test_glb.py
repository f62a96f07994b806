"""Written glb files in other programs: valid, and every joint where the npz has it.

`tests.support.clients` says what has to be installed.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from marey.exporters import Coordinates, exporter_of
from marey.motion.io.glb_write import write_glb
from tests.support.clients import blender, node
from tests.support.exported import CLIPS

pytestmark = pytest.mark.slow

VARIANTS = {"plain": {}, "root bone": {"root_bone": True}, "T-pose": {"tpose_frame": True, "root_bone": True}}
VARIANTS |= {"body": {"mesh": True}, "body and root bone": {"mesh": True, "root_bone": True}}


CASES = [
    (name, variant)
    for name in CLIPS
    for variant, options in VARIANTS.items()
    if not ("root_bone" in options and "root" in CLIPS[name].skeleton.joint_names)
]


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_the_validator_of_khronos_has_nothing_to_say(name, variant, tmp_path):
    content = exporter_of("glb").write(CLIPS[name], Coordinates(**VARIANTS[variant]))
    (tmp_path / "a.glb").write_bytes(content)
    messages = node("glb_faults.mjs", "gltf-validator", tmp_path / "a.glb")
    assert {(each["code"], each["severity"]) for each in messages} <= {("UNUSED_OBJECT", 2)}, "there is no mesh"


@pytest.mark.parametrize("name", CLIPS)
def test_three_puts_every_joint_where_the_npz_has_it(name, tmp_path):
    clip = CLIPS[name]
    write_glb(tmp_path / "a.glb", clip)
    seen = node("three_glb.mjs", "three", tmp_path / "a.glb")
    order = [seen["names"].index(joint) for joint in clip.skeleton.joint_names]
    joints = np.array(seen["joints"])[:, order]
    assert joints.shape == clip.joints.shape
    assert np.linalg.norm(joints - clip.joints, axis=-1).max() < 1e-3
    np.testing.assert_allclose(seen["times"], np.arange(clip.frames) / clip.fps, atol=1e-5)
    assert seen["extras"]["manifest"] == json.loads(json.dumps(clip.manifest))


@pytest.mark.parametrize("name", CLIPS)
def test_blender_puts_every_joint_where_the_npz_has_it(name, tmp_path):
    clip = CLIPS[name]
    write_glb(tmp_path / "a.glb", clip)
    blender("blender_glb.py", tmp_path / "a.glb", tmp_path / "seen.npz")
    with np.load(tmp_path / "seen.npz") as seen:
        order = [list(seen["names"]).index(joint) for joint in clip.skeleton.joint_names]
        assert seen["joints"][:, order].shape == clip.joints.shape
        assert np.linalg.norm(seen["joints"][:, order] - clip.joints, axis=-1).max() < 1e-3
        np.testing.assert_allclose(seen["times"], np.arange(clip.frames) / clip.fps, atol=1e-3)
        assert seen["rest"][:, 1].min() == pytest.approx(0, abs=1e-4), "the toes are on the floor at rest"
