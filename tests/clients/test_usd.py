"""Written USD files: the validators of pxr.UsdValidation find no fault, and joints are where the npz has them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.support.clients import python
from tests.support.exported import CLIPS

pytestmark = pytest.mark.slow

SHARED = Path(__file__).resolve().parents[2] / "shared"
VARIANTS = {
    "plain": {},
    "body, metres, Z up": {"mesh": True, "root_bone": True, "unit": "m", "up": "z"},
    "T-pose": {"tpose_frame": True},
    "mixamo": {"rig": "mixamo"},
}
CASES = [(name, "plain") for name in CLIPS] + [("a walk", variant) for variant in VARIANTS if variant != "plain"]


@pytest.mark.parametrize(("name", "variant"), CASES)
def test_usd_core_puts_every_joint_where_the_npz_has_it(name, variant, tmp_path):
    clip, options = CLIPS[name], VARIANTS[variant]
    clip.save_npz(tmp_path / "a.npz")
    python("MAREY_USD_PYTHON", "usd_write.py", SHARED, tmp_path / "a.npz", tmp_path / "a.usd", json.dumps(options))
    python("MAREY_USD_PYTHON", "usd_check.py", tmp_path)
    seen = json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))
    assert seen["faults"] == []
    assert seen["validators"] > 20
    assert np.array(seen["rest"])[:, 1].min() == pytest.approx(0, abs=1e-4), "the toes are on the floor at rest"
    if "rig" in options:
        assert seen["names"][0] == "mixamorig:Hips"
        assert seen["paths"][1] == "mixamorig_Hips/mixamorig_Spine"
        return
    order = [seen["names"].index(joint) for joint in clip.skeleton.joint_names]
    first = int("tpose_frame" in options)
    joints = np.array(seen["joints"])[first:, order]
    assert joints.shape == clip.joints.shape
    assert np.linalg.norm(joints - clip.joints, axis=-1).max() < 1e-3
    np.testing.assert_allclose(seen["times"], np.arange(clip.frames + first) / clip.fps, atol=1e-6)
    assert seen["end"] == clip.frames - 1 + first


def test_the_validators_find_faults_where_there_are_some(tmp_path):
    (tmp_path / "a.usd").write_text('#usda 1.0\ndef SkelRoot "Character"\n{\n}\n', encoding="utf-8")
    assert "StageMetadata" in python("MAREY_USD_PYTHON", "usd_check.py", tmp_path, "--faults")
