"""Bodies of other proportions: read from files, refused where they are none, and motions on them."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from marey.core.errors import InvalidFile, InvalidInput, NotFound
from marey.exporters import Coordinates, exporters
from marey.motion.body import standard_body, stature, travel_scale
from marey.motion.body_files import read_body
from marey.motion.change_body import change_body
from marey.motion.clip import MotionClip
from marey.motion.export_options import ExportOptions
from marey.motion.features import HUMANML3D_263
from marey.motion.finish import finish_motion
from marey.motion.hands import arms, join_hands, wrist_distance
from marey.motion.io.bvh import write_bvh
from marey.motion.kinematics import forward_kinematics
from marey.motion.retarget.load import load_body
from marey.motion.retarget.reference import REFERENCES
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.parts import SIDES
from marey.motion.rotations import IDENTITY, Array, angle_between
from marey.motion.skeleton import HUMANML3D, KIT, Skeleton
from tests.support.motions import dancer
from tests.support.stepping import sliding


def shaped(legs: float = 1.0, arms: float = 1.0, size: float = 1.0) -> Skeleton:
    """A body with other legs and arms, toes on the floor."""
    offsets = size * HUMANML3D.offsets.astype(float)
    for j, name in enumerate(HUMANML3D.joint_names):
        offsets[j] *= legs if "knee" in name or "ankle" in name else arms if "elbow" in name or "wrist" in name else 1
    offsets[0] = 0
    offsets[0, 1] = -HUMANML3D.with_offsets(offsets).rest[:, 1].min()
    return HUMANML3D.with_offsets(np.round(offsets, 6))


CHILD, SHORT_LEGS, TALL = shaped(0.8, 0.85, 0.65), shaped(0.75), shaped(1.1, 1.1, 1.1)


def still(skeleton: Skeleton, joints: int | None = None) -> MotionClip:
    rotations = np.broadcast_to(IDENTITY, (3, joints or len(skeleton), 4))
    return MotionClip.of(skeleton, rotations, np.tile(skeleton.offsets[:1], (3, 1)), np.zeros((3, 4), bool), 20)


def sliding_clip() -> MotionClip:
    return finish_motion(HUMANML3D_263.encode(sliding(0.02, 1)), HUMANML3D_263)


def write(path, skeleton: Skeleton):
    write_bvh(path, still(skeleton))
    return path


MIXAMO = {
    "pelvis": "Hips", "spine1": "Spine", "spine2": "Spine1", "spine3": "Spine2", "neck": "Neck", "head": "Head",
    "hip": "UpLeg", "knee": "Leg", "ankle": "Foot", "foot": "ToeBase",
    "collar": "Shoulder", "shoulder": "Arm", "elbow": "ForeArm", "wrist": "Hand",
}  # fmt: skip
MEASURES = (
    ("L_hip", "R_hip"), ("L_hip", "L_knee"), ("L_knee", "L_ankle"), ("L_ankle", "L_foot"), ("neck", "head"),
    ("neck", "L_shoulder"), ("neck", "L_collar"), ("L_shoulder", "L_elbow"), ("L_elbow", "L_wrist"),
)  # fmt: skip
"""Joints whose distance a body takes from a rig."""


def renamed(skeleton: Skeleton, prefix: str = "mixamorig:") -> Skeleton:
    def name(joint: str) -> str:
        side, _, part = joint.rpartition("_")
        return prefix + {"L": "Left", "R": "Right", "": ""}[side] + MIXAMO[part]

    names = tuple(name(joint) for joint in skeleton.joint_names)
    return Skeleton("rig", names, skeleton.parents, skeleton.offsets, skeleton.mirror)


def measures(skeleton: Skeleton) -> list[float]:
    """Distances of `MEASURES`, and from the middle of the hips to the neck, metres."""
    at = {name: skeleton.rest[joint].astype(float) for joint, name in enumerate(skeleton.joint_names)}
    pairs = [(at[a], at[b]) for a, b in MEASURES] + [((at["L_hip"] + at["R_hip"]) / 2, at["neck"])]
    return [float(np.linalg.norm(a - b)) for a, b in pairs]


def measures_of(rig: RigBody) -> list[float]:
    """The same of a rig, both sides averaged."""
    parts = {
        "hip": "upper_leg", "knee": "lower_leg", "ankle": "foot", "foot": "toes", "collar": "shoulder",
        "shoulder": "upper_arm", "elbow": "lower_arm", "wrist": "hand",
    }  # fmt: skip

    def at(joint: str, other: bool) -> Array:
        letter, _, part = joint.rpartition("_")
        if not letter:
            return rig.at({"neck": "neck1"}.get(part, part))
        return rig.at(f"{'left' if (letter == 'L') != other else 'right'}_{parts[part]}")

    own = [
        float(np.mean([np.linalg.norm(at(a, other) - at(b, other)) for other in (False, True)])) for a, b in MEASURES
    ]
    return [*own, float(np.linalg.norm(rig.hips - rig.at("neck1")))]


def test_standard_is_the_standard_body():
    assert read_body("standard", HUMANML3D) is standard_body(HUMANML3D)


@pytest.mark.parametrize("skeleton", [CHILD, SHORT_LEGS, TALL])
@pytest.mark.parametrize("ending", ["npz", "bvh", "glb", "fbx"])
def test_a_body_is_read_from_all_exports_of_marey_alike(tmp_path, skeleton, ending):
    path = tmp_path / f"hero.{ending}"
    path.write_bytes(exporters()[ending].write(still(skeleton), Coordinates()))
    found = read_body(path, HUMANML3D)
    np.testing.assert_allclose(found.skeleton.offsets, skeleton.offsets, atol=0 if ending == "npz" else 2e-6)
    assert found.name == f"hero.{ending}"
    assert found.skeleton.feet == HUMANML3D.feet


def test_a_root_bone_is_no_part_of_a_body(tmp_path):
    path = tmp_path / "hero.glb"
    path.write_bytes(exporters()["glb"].write(still(CHILD), Coordinates(root_bone=True)))
    np.testing.assert_allclose(read_body(path, HUMANML3D).skeleton.offsets, CHILD.offsets, atol=2e-6)


@pytest.mark.parametrize("prefix", ["mixamorig:", ""])
@pytest.mark.parametrize("skeleton", [CHILD, SHORT_LEGS, TALL])
def test_a_rig_with_mixamos_names_is_a_body(tmp_path, skeleton, prefix):
    found = read_body(write(tmp_path / "hero.bvh", renamed(skeleton, prefix)), HUMANML3D).skeleton
    np.testing.assert_allclose(measures(found), measures(skeleton), atol=1e-5)
    legs = [joint for joint, name in enumerate(found.joint_names) if name.endswith(("knee", "ankle", "foot"))]
    np.testing.assert_allclose(found.offsets[legs], skeleton.offsets[legs], atol=1e-5)


def test_a_rig_in_an_a_pose_has_the_arms_of_the_t_pose(tmp_path):
    offsets = TALL.offsets.copy()
    for j, name in enumerate(TALL.joint_names):
        if "elbow" in name or "wrist" in name:
            x, _, z = offsets[j]
            offsets[j] = [x * np.cos(0.8), -abs(x) * np.sin(0.8), z]
    found = read_body(write(tmp_path / "hero.bvh", renamed(TALL.with_offsets(offsets))), HUMANML3D).skeleton
    np.testing.assert_allclose(measures(found), measures(TALL), atol=1e-5)
    limbs = [joint for joint, name in enumerate(TALL.joint_names) if name.endswith(("elbow", "wrist", "knee", "foot"))]
    np.testing.assert_allclose(found.offsets[limbs], TALL.offsets[limbs], atol=1e-5)


@pytest.mark.parametrize("rig", REFERENCES)
@pytest.mark.parametrize("ending", ["", ".glb", ".fbx", ".bvh"])
def test_the_measures_of_a_rig_are_those_of_the_body(tmp_path, rig, ending):
    given = rig if not ending else tmp_path / f"hero{ending}"
    if ending:  # on joints with other axes, Z up or in an A-pose
        coordinates = Coordinates.of(ExportOptions(rig=rig, tpose_frame=True))
        given.write_bytes(exporters()[ending[1:]].write(sliding_clip(), coordinates))
    found = read_body(given, HUMANML3D)
    np.testing.assert_allclose(measures(found.skeleton), measures_of(load_body(given)), atol=2e-5)
    np.testing.assert_allclose(found.skeleton.offsets, read_body(rig, HUMANML3D).skeleton.offsets, atol=1e-4)
    mirrored = found.skeleton.offsets[list(HUMANML3D.mirror)] * [-1, 1, 1]
    np.testing.assert_allclose(found.skeleton.offsets, mirrored, atol=1e-6)


@pytest.mark.parametrize("rig", REFERENCES)
def test_feet_reach_the_floor_on_the_body_of_a_rig(rig):
    body = read_body(rig, HUMANML3D)
    clip = change_body(sliding_clip(), body)
    toes, stands = clip.joints[:, list(body.skeleton.feet[1::2])], clip.contacts[:, 1::2]
    assert stands.any()
    assert np.abs(toes[..., 1][stands]).max() < 0.03
    knees = [body.skeleton.index(name) for name in ("L_knee", "R_knee")]
    own = sliding_clip()
    bent = [np.degrees(angle_between(each.rotations[:, knees], IDENTITY)).mean() for each in (clip, own)]
    assert bent[0] == pytest.approx(bent[1], abs=4)  # no legs that are stretched, or bent, to reach the floor


def test_parts_that_a_rig_does_not_have_are_those_of_the_standard_body(tmp_path):
    given = {"head": None} | {f"{side}_{part}": None for side in SIDES for part in ("hand", "shoulder", "toes")}
    (tmp_path / "map.json").write_text(json.dumps(given))
    whole = read_body("mixamo", HUMANML3D).skeleton.offsets
    found = read_body("mixamo", HUMANML3D, tmp_path / "map.json").skeleton
    own = HUMANML3D.offsets
    legs = load_body("mixamo").leg / sum(np.linalg.norm(own[found.index(name)]) for name in ("L_knee", "L_ankle"))
    trunk = found.offsets[found.index("spine2")][1] / own[found.index("spine2")][1]
    for name, scale in (("L_wrist", trunk), ("head", trunk), ("L_collar", trunk), ("R_foot", legs)):
        joint = found.index(name)
        np.testing.assert_allclose(found.offsets[joint], scale * own[joint], atol=1e-5, err_msg=name)
        assert np.abs(found.offsets[joint] - whole[joint]).max() > 1e-3, name
    shoulders = [skeleton.rest[skeleton.index("L_shoulder")][0] for skeleton in (found, HUMANML3D.with_offsets(whole))]
    assert shoulders[0] == pytest.approx(shoulders[1], abs=1e-5)


def test_a_map_names_the_joints_that_are_not_found(tmp_path):
    skeleton = renamed(CHILD)
    odd = Skeleton("rig", tuple(f"j{n}" for n in range(22)), skeleton.parents, skeleton.offsets, skeleton.mirror)
    path = write(tmp_path / "odd.bvh", odd)
    names = {"head": "j15"}
    for letter, side in ("L", "left"), ("R", "right"):
        names |= {
            f"{side}_{part}": f"j{CHILD.index(f'{letter}_{joint}')}"
            for joint, part in (("hip", "upper_leg"), ("knee", "lower_leg"), ("ankle", "foot"), ("foot", "toes"),
                                ("shoulder", "upper_arm"), ("elbow", "lower_arm"), ("wrist", "hand"))
        }  # fmt: skip
    (tmp_path / "map.json").write_text(json.dumps(names))
    found = read_body(path, HUMANML3D, tmp_path / "map.json").skeleton
    np.testing.assert_allclose(measures(found), measures(CHILD), atol=1e-5)
    (tmp_path / "map.json").write_text('{"left_foot": "nobody"}')
    with pytest.raises(InvalidInput, match=r"map\.json: .*the rig has no joint 'nobody'"):
        read_body(path, HUMANML3D, tmp_path / "map.json")


def test_rigs_without_legs_are_refused(tmp_path):
    line = Skeleton(
        "rig", ("a", "b", "c"), (-1, 0, 1), np.array([[0, 0, 0], [0, 1, 0], [0, 1, 0]], np.float32), (0, 1, 2)
    )
    with pytest.raises(InvalidInput, match="no joint found for left upper leg"):
        read_body(write(tmp_path / "line.bvh", line), HUMANML3D)


@pytest.mark.parametrize(
    ("skeleton", "message"),
    [
        (shaped(size=2), r"3\.46 m tall"),
        (shaped(arms=0.1), "bone to L_elbow"),
        (HUMANML3D.with_offsets(HUMANML3D.offsets * [-1, 1, 1]), "no T-pose"),
        (renamed(shaped(size=2)), r"3\.46 m tall"),
        (renamed(shaped(arms=0.1)), "bone to L_elbow"),
    ],
    ids=["giant", "no arms", "mirrored", "giant rig", "rig without arms"],
)
def test_bodies_that_no_human_has_are_refused(tmp_path, skeleton, message):
    with pytest.raises(InvalidFile, match=message) as caught:
        read_body(write(tmp_path / "rig.bvh", skeleton), HUMANML3D)
    assert (caught.value.argument, "rig.bvh" in str(caught.value.where)) == ("body", True)


def test_other_files_and_bundles_are_refused(tmp_path):
    with pytest.raises(InvalidInput, match=r"`\.txt` is not a rig format") as caught:
        read_body(tmp_path / "rig.txt", HUMANML3D)
    assert (caught.value.argument, ".glb" in str(caught.value)) == ("body", True)
    with pytest.raises(InvalidInput, match="there is no rig 'hero'") as caught:
        read_body("hero", HUMANML3D)
    assert (caught.value.argument, caught.value.where) == ("body", "body")
    for ending in ("bvh", "npz", "glb"):
        with pytest.raises(NotFound):
            read_body(tmp_path / f"rig.{ending}", HUMANML3D)
    with pytest.raises(InvalidInput, match="this bundle has kit"):
        read_body(tmp_path / "rig.bvh", KIT)
    still(KIT).save_npz(tmp_path / "kit.npz")
    with pytest.raises(InvalidFile, match="another skeleton"):
        read_body(tmp_path / "kit.npz", HUMANML3D)
    (tmp_path / "text.npz").write_text("no npz")
    with pytest.raises(InvalidFile):
        read_body(tmp_path / "text.npz", HUMANML3D)


@pytest.mark.parametrize("skeleton", [CHILD, SHORT_LEGS, TALL], ids=["child", "short legs", "tall"])
def test_feet_stand_on_other_bodies_and_travel_follows_the_legs(skeleton):
    body = SimpleNamespace(skeleton=skeleton)
    features = HUMANML3D_263.encode(sliding(0.02, 1))
    own = finish_motion(features, HUMANML3D_263)
    clip = finish_motion(features, HUMANML3D_263, body=body)  # pyright: ignore[reportArgumentType]
    np.testing.assert_array_equal(clip.offsets, skeleton.offsets)
    toes = clip.joints[:, list(skeleton.feet[1::2])]
    stands = clip.contacts[:, 1::2]
    assert stands.any()
    assert np.abs(toes[..., 1][stands]).max() < 0.03
    moved = np.linalg.norm(np.diff(toes, axis=0)[..., [0, 2]], axis=-1)
    assert moved[stands[1:] & stands[:-1]].max() < 0.010
    ratio = travel_scale(standard_body(HUMANML3D).skeleton, skeleton)
    far, wanted = (np.linalg.norm(each.root[-1] - each.root[0]) for each in (clip, own))
    assert far == pytest.approx(ratio * wanted, rel=0.05)


@pytest.mark.parametrize("skeleton", [CHILD, SHORT_LEGS, TALL], ids=["child", "short legs", "tall"])
def test_hands_that_meet_do_so_on_other_bodies(skeleton):
    rotations, root = dancer(3, 40)
    joints = forward_kinematics(HUMANML3D, rotations, root)
    (*_, right), (*_, left) = arms(HUMANML3D)
    moved = forward_kinematics(skeleton, rotations, travel_scale(HUMANML3D, skeleton) * root)
    wanted = np.full(len(joints), 0.1 * stature(skeleton) / stature(HUMANML3D))
    front = moved.copy()
    middle, aside = moved[:, 9] + [0, -0.1, 0.25 * stature(skeleton)], np.array([0.08, 0, 0])
    front[:, right], front[:, left] = middle - aside, middle + aside
    found = wrist_distance(join_hands(front, wanted, skeleton), skeleton)
    assert np.abs(found - wanted).max() < 0.020
