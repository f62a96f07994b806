"""VRM animations, read by a reader that shares no code with the writer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.exporters import Coordinates, exporter_of
from marey.motion.export_options import ExportOptions
from marey.motion.io.vrma_write import REQUIRED, format_vrma
from marey.motion.skeleton import KIT, SNAPMOGEN, Skeleton
from tests.support.exported import tumbling
from tests.support.glb import Glb
from tests.support.walker import walker

CLIPS = {"a walk": walker(turn=0.7), "KIT": tumbling(KIT, 12.5), "SnapMoGen": tumbling(SNAPMOGEN, 30)}


@pytest.mark.parametrize("name", CLIPS)
def test_every_bone_that_vrm_requires_is_named_once(name: str) -> None:
    seen = Glb.read(format_vrma(CLIPS[name]))
    extension = seen.document["extensions"]["VRMC_vrm_animation"]
    assert extension["specVersion"] == "1.0"
    assert seen.document["extensionsUsed"] == ["VRMC_vrm_animation"]
    bones = {bone: each["node"] for bone, each in extension["humanoid"]["humanBones"].items()}
    assert set(REQUIRED) <= bones.keys()
    assert len(set(bones.values())) == len(bones)
    for bone, number in bones.items():
        assert seen.document["nodes"][number]["name"] == bone


def test_the_hips_move_in_metres_and_the_rest_pose_is_the_t_pose() -> None:
    clip = CLIPS["a walk"]
    seen = Glb.read(format_vrma(clip))
    places = seen.tracks("translation")
    np.testing.assert_allclose(places[0], clip.root, atol=1e-6)
    joints = seen.joints()
    names = seen.names
    for bone, joint in (("leftHand", "L_wrist"), ("rightFoot", "R_ankle"), ("head", "head")):
        at, wanted = joints[:, names.index(bone)], clip.joints[:, clip.skeleton.index(joint)]
        np.testing.assert_allclose(at, wanted, atol=1e-5)


def test_no_prompt_is_in_it_and_equal_clips_give_equal_bytes() -> None:
    clip = replace(walker(), manifest={"prompt": "zanzibar"})
    data = exporter_of("vrma").write(clip, Coordinates())
    assert b"zanzibar" not in data
    assert data == format_vrma(walker())
    assert data != format_vrma(clip, ExportOptions(in_place="travel"))


def test_a_skeleton_without_legs_is_refused() -> None:
    clip = walker()
    names = tuple(f"x{k}" for k in range(len(clip.skeleton)))
    tree = Skeleton("other", names, clip.skeleton.parents, clip.skeleton.offsets, clip.skeleton.mirror)
    with pytest.raises(InvalidInput):
        format_vrma(replace(clip, skeleton=replace(tree, parents=(-1,) + (0,) * (len(names) - 1))))
