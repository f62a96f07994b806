"""Written VRM animations: valid glTF, and what three-vrm reads from them."""

from __future__ import annotations

import numpy as np
import pytest

from marey.exporters import Coordinates, exporter_of
from marey.motion.kinematics import global_rotations
from marey.motion.rotations import multiply
from tests.support.clients import node
from tests.support.exported import CLIPS

pytestmark = pytest.mark.slow

PARENTS = {
    "humanml3d": {"leftUpperArm": "L_shoulder", "leftHand": "L_wrist", "rightLowerLeg": "R_knee", "head": "head"},
    "kit": {"leftUpperArm": "LS", "rightLowerLeg": "RK", "leftHand": "LW"},
    "snapmogen": {"leftUpperArm": "L_armUpper0001_bind_JNT", "rightLowerLeg": "R_legLower0001_bind_JNT"},
}
CHAIN = {
    "leftHand": "leftLowerArm", "leftLowerArm": "leftUpperArm", "leftUpperArm": "leftShoulder",
    "leftShoulder": "upperChest", "upperChest": "chest", "chest": "spine", "spine": "hips", "head": "neck",
    "neck": "upperChest", "rightLowerLeg": "rightUpperLeg", "rightUpperLeg": "hips",
}  # fmt: skip


@pytest.mark.parametrize("name", CLIPS)
def test_the_validator_of_khronos_finds_no_fault(name, tmp_path):
    (tmp_path / "a.vrma").write_bytes(exporter_of("vrma").write(CLIPS[name], Coordinates()))
    messages = node("glb_faults.mjs", "gltf-validator", tmp_path / "a.vrma")
    assert {each["code"] for each in messages} <= {"UNSUPPORTED_EXTENSION", "NODE_EMPTY"}, "ends of limbs are empty"
    assert min(each["severity"] for each in messages) >= 2, "information, neither error nor warning"


@pytest.mark.parametrize("name", CLIPS)
def test_three_vrm_turns_bones_as_the_clip_does(name, tmp_path):
    clip = CLIPS[name]
    (tmp_path / "a.vrma").write_bytes(exporter_of("vrma").write(clip, Coordinates()))
    seen = node("three_vrma.mjs", "@pixiv/three-vrm-animation", tmp_path / "a.vrma")
    tracks = {bone: np.array(values).reshape(-1, 4)[:, [3, 0, 1, 2]] for bone, values in seen["rotation"].items()}
    np.testing.assert_allclose(seen["times"], np.arange(clip.frames) / clip.fps, atol=1e-5)
    np.testing.assert_allclose(np.array(seen["translation"]["hips"]).reshape(-1, 3), clip.root, atol=1e-5)
    assert seen["rest"][1] == pytest.approx(clip.skeleton.rest[0, 1] - clip.skeleton.rest[:, 1].min(), abs=1e-5)
    world = global_rotations(clip.skeleton, clip.rotations.astype(float))
    for bone, joint in PARENTS[clip.skeleton.name].items():
        turn, above = tracks[bone], CHAIN.get(bone)
        while above is not None:
            turn = multiply(tracks[above], turn) if above in tracks else turn
            above = CHAIN.get(above)
        wanted = world[:, clip.skeleton.index(joint)]
        assert np.abs(np.abs((turn * wanted).sum(axis=-1)) - 1).max() < 1e-5, bone
