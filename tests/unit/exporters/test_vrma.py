"""VRM animations, read by a reader that shares no code with the writer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.exporters import Coordinates, exporter_of
from marey.motion.clip import MotionClip
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


def test_a_clip_that_is_not_finite_or_lacks_a_bone_that_vrm_requires_is_refused() -> None:
    clip = walker()
    root = clip.root.copy()
    root[3, 1] = np.nan
    with pytest.raises(InvalidInput, match=r"^humanml3d: the clip holds NaN or infinite numbers"):
        format_vrma(replace(clip, root=root))
    kept = [joint for joint, name in enumerate(clip.skeleton.joint_names) if name not in ("L_wrist", "R_wrist")]
    tree = clip.skeleton
    armless = Skeleton(
        "armless",
        tuple(tree.joint_names[joint] for joint in kept),
        tuple(kept.index(tree.parents[joint]) if joint else -1 for joint in kept),
        tree.offsets[kept],
        tuple(kept.index(tree.mirror[joint]) for joint in kept),
    )
    with pytest.raises(InvalidInput, match=r"^armless: VRM needs bones that are not found: leftHand, rightHand"):
        format_vrma(MotionClip.of(armless, clip.rotations[:, kept], clip.root, clip.contacts, clip.fps))


def test_a_skeleton_without_legs_is_refused() -> None:
    clip = walker()
    names = tuple(f"x{k}" for k in range(len(clip.skeleton)))
    tree = Skeleton("other", names, clip.skeleton.parents, clip.skeleton.offsets, clip.skeleton.mirror)
    with pytest.raises(InvalidInput, match=r"^skeleton: no joint found for left upper leg"):
        format_vrma(replace(clip, skeleton=replace(tree, parents=(-1,) + (0,) * (len(names) - 1))))
