"""Written VRM animations: valid glTF, and what three-vrm reads from them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest

from marey.exporters import Coordinates, exporter_of
from marey.motion.kinematics import global_rotations
from marey.motion.rigs.rename import renamed
from marey.motion.rotations import Array, multiply, rotate
from tests.support.clients import node
from tests.support.exported import CLIPS, LONG

pytestmark = pytest.mark.slow

ALL = CLIPS | LONG
PARENTS = {
    "humanml3d": {"leftUpperArm": "L_shoulder", "leftHand": "L_wrist", "rightLowerLeg": "R_knee", "head": "head"},
    "kit": {"leftUpperArm": "LS", "rightLowerLeg": "RK", "leftHand": "LW"},
    "snapmogen": {"leftUpperArm": "L_armUpper0001_bind_JNT", "rightLowerLeg": "R_legLower0001_bind_JNT"},
}


@pytest.mark.parametrize("name", ALL)
def test_the_validator_of_khronos_finds_no_fault(name, tmp_path):
    (tmp_path / "a.vrma").write_bytes(exporter_of("vrma").write(ALL[name], Coordinates()))
    messages = node("glb_faults.mjs", "gltf-validator", tmp_path / "a.vrma")
    assert {each["code"] for each in messages} <= {"UNSUPPORTED_EXTENSION", "NODE_EMPTY"}, "ends of limbs are empty"
    assert min(each["severity"] for each in messages) >= 2, "information, neither error nor warning"


def played(seen: Mapping[str, Any]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Return rotations (T, 4) and places (T, 3) of bones in the world, on an avatar of the size of the animation."""
    hips = np.array(seen["translation"]["hips"]).reshape(-1, 3)
    still = np.tile([1.0, 0, 0, 0], (len(hips), 1))
    own = {bone: np.array(values).reshape(-1, 4)[:, [3, 0, 1, 2]] for bone, values in seen["rotation"].items()}
    rest = {bone: np.array(place) for bone, place in seen["places"].items()}
    turns, places = {"hips": own["hips"]}, {"hips": hips}
    waiting = [bone for bone in rest if bone != "hips"]
    while waiting:
        bone = next(each for each in waiting if seen["above"][each] in turns)
        above = seen["above"][bone]
        places[bone] = places[above] + rotate(turns[above], rest[bone] - rest[above])
        turns[bone] = multiply(turns[above], own.get(bone, still))
        waiting.remove(bone)
    return turns, places


@pytest.mark.parametrize("name", ALL)
def test_three_vrm_turns_and_places_bones_as_the_clip_does(name, tmp_path):
    clip = ALL[name]
    (tmp_path / "a.vrma").write_bytes(exporter_of("vrma").write(clip, Coordinates()))
    seen = node("three_vrma.mjs", "@pixiv/three-vrm-animation", tmp_path / "a.vrma")
    np.testing.assert_allclose(seen["times"], np.arange(clip.frames) / clip.fps, atol=1e-5)
    assert seen["duration"] == pytest.approx((clip.frames - 1) / clip.fps, abs=1e-5)
    assert seen["rest"][1] == pytest.approx(clip.skeleton.rest[0, 1] - clip.skeleton.rest[:, 1].min(), abs=1e-5)
    turns, places = played(seen)
    np.testing.assert_allclose(places["hips"], clip.root, atol=1e-5)
    world = global_rotations(clip.skeleton, clip.rotations.astype(float))
    for bone, joint in PARENTS[clip.skeleton.name].items():
        wanted = world[:, clip.skeleton.index(joint)]
        assert np.abs(np.abs((turns[bone] * wanted).sum(axis=-1)) - 1).max() < 1e-5, bone
    if clip.skeleton.name == "humanml3d":  # all its joints are bones of VRM; others bend where VRM has no bone
        bones = renamed(clip.skeleton.joint_names, clip.skeleton.parents, "vrm")
        assert set(bones) == set(places)
        for joint, bone in enumerate(bones):
            assert np.linalg.norm(places[bone] - clip.joints[:, joint], axis=-1).max() < 1e-3, bone
