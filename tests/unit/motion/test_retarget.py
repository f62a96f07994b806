"""Retargeting onto rigs whose every joint is known."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from marey.core.errors import InvalidInput
from marey.motion.clip import MotionClip
from marey.motion.export_options import ExportOptions
from marey.motion.io.bvh import BvhClip
from marey.motion.retarget.align import Alignment
from marey.motion.retarget.apply import on_body
from marey.motion.retarget.load import load_body
from marey.motion.retarget.reference import REFERENCES, reference_rig
from marey.motion.retarget.retarget import retarget
from marey.motion.retarget.source import rig_of, source_of, source_on
from marey.motion.rigs.body import RigBody
from marey.motion.rigs.joint_map import map_joints
from marey.motion.rotations import Array, about, angle_between, conjugate, from_rotvec, normalize, rotate, to_matrix
from marey.motion.skeleton import HUMANML3D, SKELETONS, Skeleton, mirror_by_name, skeleton_of
from tests.support.changed_rigs import Change, lively, source_on_rig
from tests.support.walker import walker

WALK = walker(seconds=3)
LIVELY = lively(walker(seconds=2, turn=0.3), 5)


def worst(change: Change) -> float:
    """Return the largest distance in metres of a joint of the retargeted copy from the source's."""
    clip, rig = change.motion(LIVELY), change.rig()
    places = retarget(source_of(clip), RigBody.of(rig)).world()[1]
    names = [name for name in HUMANML3D.joint_names if name in rig.joint_names]
    own, theirs = ([tree.index(name) for name in names] for tree in (rig, HUMANML3D))
    return float(np.linalg.norm(places[:, own] - clip.joints[:, theirs], axis=-1).max())


@pytest.mark.parametrize("seed", range(20))
def test_a_changed_copy_of_the_skeleton_moves_as_the_source(seed):
    assert worst(Change.draw(seed)) <= 1e-3


@pytest.mark.slow
def test_two_hundred_changed_copies_move_as_the_source():
    assert max(worst(Change.draw(seed)) for seed in range(20, 200)) <= 1e-3


@pytest.mark.parametrize("name", REFERENCES)
def test_feet_on_a_reference_skeleton_stand_where_the_source_stands_at_its_scale(name):
    source, body = source_of(WALK), load_body(name)
    places = retarget(source, body).world()[1]
    scale = body.leg / source.body.leg
    for side, toe in (("left", "L_foot"), ("right", "R_foot")):
        own, theirs = places[:, body.map.parts[f"{side}_toes"]], WALK.joints[:, HUMANML3D.index(toe)]
        stands = WALK.contacts[:, 1 if side == "left" else 3]
        rest = body.at(f"{side}_toes")[1] - body.floor
        assert np.abs(own[stands, 1] - rest - scale * theirs[stands, 1]).max() < 0.01
        steps = [np.linalg.norm(np.diff(each[:, [0, 2]], axis=0), axis=-1) for each in (own, scale * theirs)]
        held = stands[1:] & stands[:-1]
        assert steps[0][held].mean() <= steps[1][held].mean() + 1e-4


@pytest.mark.parametrize("name", REFERENCES)
def test_bones_of_a_reference_skeleton_keep_their_length_and_left_stays_left(name):
    body = load_body(name)
    motion = on_body(WALK, body)
    still = [j for j in range(len(body.rig)) if not motion.moving[j]]
    assert np.allclose(motion.translations[:, still], body.rig.offsets[still])
    places = motion.world()[1]
    hands = [places[:, body.map.parts[f"{side}_hand"]] for side in ("left", "right")]
    assert (hands[0][:, 1] > hands[1][:, 1] + 0.3).all()  # the walker holds up its left hand
    assert hands[0][0, 0] > hands[1][0, 0]


def test_from_one_rig_to_another_and_back_nothing_is_lost():
    source = source_of(WALK)
    there = on_body(WALK, RigBody.of(Change(3, "a", 5, 0.01, "z").rig()))
    back = retarget(source_on_rig(there), source.body).world()[1]
    assert np.linalg.norm(back - WALK.joints, axis=-1).max() <= 5e-3


def test_to_a_body_of_other_proportions_and_back():
    source = source_of(LIVELY)
    there = on_body(LIVELY, load_body("mixamo"))
    back = retarget(source_on_rig(there), source.body).world()[1]
    assert np.linalg.norm(back - LIVELY.joints, axis=-1).mean() <= 0.02


def knee_of(places: Array, body: RigBody) -> Array:
    """Return the bend (T,) of the right knee, degrees."""
    hip, knee, ankle = (places[:, body.map.parts[f"right_{part}"]] for part in ("upper_leg", "lower_leg", "foot"))
    return np.degrees(np.arccos((normalize(knee - hip) * normalize(ankle - knee)).sum(axis=-1)))


@pytest.mark.parametrize("name", ["mixamo", "humanik"])
def test_the_knee_of_a_leg_that_swings_bends_as_the_sources_however_the_foot_is_pitched(name):
    """A foot that is longer or steeper than the source's would draw the ankle along if its toe went where the source's
    goes."""
    frames = 40
    rotations = np.tile([1.0, 0.0, 0.0, 0.0], (frames, 22, 1))
    swing = 0.4 + 0.6 * np.sin(np.linspace(0.0, np.pi, frames))
    for joint, most in (("R_hip", -0.8), ("R_knee", 1.3), ("R_ankle", 0.9)):
        rotations[:, HUMANML3D.index(joint)] = from_rotvec(np.outer(most * swing, [1.0, 0.0, 0.0]))
    stands = np.tile([True, True, False, False], (frames, 1))
    root = np.tile(HUMANML3D.rest[0] - [0.0, HUMANML3D.rest[:, 1].min(), 0.0], (frames, 1))
    clip = MotionClip.of(HUMANML3D, rotations, root, stands, 20.0)
    source, body = source_of(clip), load_body(name)
    bend = knee_of(source.joints, source.body)
    places = retarget(source, body).world()[1]
    assert bend.max() > 70
    assert np.abs(knee_of(places, body) - bend).max() < 1.5
    toe, theirs = (
        places[:, each.map.parts["right_toes"], 1] - each.at("right_toes")[1]
        for each, places in ((body, places), (source.body, source.joints))
    )
    assert (toe > np.minimum(body.leg / source.body.leg * theirs, 0.0) - 1e-3).all()


def test_helpers_of_unreal_follow_hands_and_feet():
    body = load_body("ue4")
    motion = on_body(WALK, body)
    world, places = motion.world()
    for helper, leader in (("ik_foot_l", "foot_l"), ("ik_hand_gun", "hand_r"), ("ik_hand_l", "hand_l")):
        own, theirs = body.rig.index(helper), body.rig.index(leader)
        assert np.abs(places[:, own] - places[:, theirs]).max() < 1e-6
        assert angle_between(world[:, own], world[:, theirs]).max() < 1e-6


def test_the_twist_of_an_arm_is_shared():
    from marey.motion.rotations import about

    rotations = WALK.rotations.astype(np.float64)
    rotations[:, HUMANML3D.index("L_wrist")] = about("X", np.full(WALK.frames, 1.0))
    clip = type(WALK).of(WALK.skeleton, rotations, WALK.root, WALK.contacts, WALK.fps)
    body = load_body("ue4")
    rest = body.rig.local_rotations[body.rig.index("lowerarm_twist_01_l")]
    turned = [on_body(each, body).rotations[:, body.rig.index("lowerarm_twist_01_l")] for each in (WALK, clip)]
    assert angle_between(turned[0], rest[None]).max() < 1e-3
    assert np.allclose(angle_between(turned[1], rest[None]), 0.52, atol=0.05)


def test_a_root_bone_takes_the_travel_and_no_joint_moves():
    body = load_body("ue4")
    plain, rooted = on_body(LIVELY, body), on_body(LIVELY, body, ExportOptions(rig="ue4", root_bone=True))
    hips, root = body.map.parts["hips"], body.rig.index("root")
    kept = [j for j in range(len(body.rig)) if body.rig.joint_names[j] not in ("root", "ik_foot_root", "ik_hand_root")]
    assert np.abs(plain.world()[1][:, kept] - rooted.world()[1][:, kept]).max() < 1e-5
    travel = rooted.world()[1][:, [root, hips]]
    assert np.abs(travel[:, 0, 1]).max() < 1e-9
    apart = body.rig.positions[root] - body.rig.positions[hips]
    np.testing.assert_allclose((travel[:, 0] - travel[:, 1])[:, [0, 2]], [apart[[0, 2]]] * rooted.frames, atol=1e-6)
    assert np.ptp(travel[:, 0, 2]) > 1
    world, places = rooted.world()
    for name in ("ik_foot_root", "ik_hand_root"):
        joint = body.rig.index(name)
        on_root = rotate(conjugate(world[:, root]), places[:, joint] - places[:, root])
        np.testing.assert_allclose(on_root, [body.rig.offsets[joint]] * rooted.frames, atol=1e-6)
    with pytest.raises(InvalidInput, match="no bone above the hips"):
        on_body(LIVELY, load_body("mixamo"), ExportOptions(rig="mixamo", root_bone=True))


def test_a_root_bone_keeps_its_place_beside_hips_that_do_not_stand_over_it():
    rig = reference_rig("ue4")
    root = rig.index("root")
    places = np.add(rig.positions, [0.03, 0.0, 0.1])
    places[root] = rig.positions[root]
    body = RigBody.of(replace(rig, positions=places))
    motion = on_body(LIVELY, body, ExportOptions(rig="ue4", root_bone=True))
    hips = body.map.parts["hips"]
    apart = (motion.world()[1][:, root] - motion.world()[1][:, hips])[:, [0, 2]]
    np.testing.assert_allclose(apart, [(places[root] - places[hips])[[0, 2]]] * motion.frames, atol=1e-6)


def test_in_place_and_a_rest_frame():
    body = load_body("mixamo")
    motion = on_body(WALK, body, ExportOptions(rig="mixamo", in_place="travel", tpose_frame=True))
    assert motion.frames == WALK.frames + 1
    hips = motion.world()[1][:, body.map.parts["hips"]]
    assert np.abs(hips[0] - body.rig.positions[body.map.parts["hips"]]).max() < 1e-9
    assert np.ptp(hips[1:, 2]) < 0.1
    assert motion.removed["travel"]["z"] > 2


def test_hands_reach_on_request():
    body = load_body("mixamo")
    source = source_of(WALK)
    scale = body.leg / source.body.leg
    goal = (WALK.joints[:, HUMANML3D.index("R_wrist")] - WALK.joints[:, [1, 2]].mean(axis=1)) * scale
    found = []
    for hands in (False, True):
        places = retarget(source, body, hands=hands).world()[1]
        parts = body.map.parts
        hips = (places[:, parts["left_upper_leg"]] + places[:, parts["right_upper_leg"]]) / 2
        found.append(np.linalg.norm(places[:, parts["right_hand"]] - hips - goal, axis=-1).max())
    assert found[1] < 0.01 < found[0]


@pytest.mark.parametrize("part", ["hand", "lower_arm", "upper_arm"])
def test_hands_reach_on_the_side_that_has_an_arm_and_the_other_is_left(part):
    """Also where the source has no such part and the rig has."""
    source = source_of(WALK)
    bare = RigBody.of(reference_rig("mixamo"), map_joints(reference_rig("mixamo"), {f"left_{part}": None}))
    own = RigBody.of(source.body.rig, map_joints(source.body.rig, {f"left_{part}": None}))
    for theirs, body in ((source, bare), (replace(source, body=own), load_body("mixamo"))):
        still, reaching = (retarget(theirs, body, hands=hands).world()[1] for hands in (False, True))
        moved = np.abs(reaching - still).max(axis=(0, 2))
        assert moved[body.map.parts["right_hand"]] > 0.01
        assert moved[body.rig.index("mixamorig:LeftHand")] < 1e-9


def _without_arms(skeleton: Skeleton) -> Skeleton:
    kept = [
        joint for joint, name in enumerate(skeleton.joint_names) if not re.search("collar|should|elbow|wrist", name)
    ]
    names = tuple(skeleton.joint_names[joint] for joint in kept)
    parents = tuple(kept.index(skeleton.parents[joint]) if joint else -1 for joint in kept)
    return Skeleton("armless", names, parents, skeleton.offsets[kept], mirror_by_name(names))


@pytest.mark.parametrize("armless", ["source", "rig", "both"])
def test_a_trunk_without_arms_stays_upright_where_directions_decide(armless):
    """As from a body that sits at rest; of a body without arms the head tells where the trunk ends."""
    plain = rig_of(HUMANML3D), rig_of(_without_arms(HUMANML3D))
    source, target = plain[armless != "rig"], plain[armless != "source"]
    knees = [source.index(f"{side}_{name}") for side in "LR" for name in ("knee", "ankle", "foot")]
    places = source.positions.copy()
    hips = places[source.index("pelvis")]
    places[knees] = hips + rotate(about("X", -1.4), places[knees] - hips)
    sitting = RigBody.of(replace(source, positions=places))
    assert not sitting.standing
    turns = Alignment(sitting, RigBody.of(target)).turns
    names = [f"spine{number}" for number in range(1, 4)]
    trunk = np.array([turns[name] for name in names])
    assert angle_between(trunk, np.array([1.0, 0.0, 0.0, 0.0])).max() < np.radians(10)


def test_a_clip_without_a_joint_of_the_rig_is_refused_with_the_name_of_the_rig():
    body, (rotations, root) = RigBody.of(rig_of(HUMANML3D)), (WALK.rotations.astype(float), WALK.root.astype(float))
    clip = BvhClip(HUMANML3D, rotations, root, None, WALK.fps, np.full((22, 3), np.nan))
    np.testing.assert_allclose(source_on(body, clip).joints, WALK.joints, atol=1e-5)
    less = skeleton_of(HUMANML3D.joint_names[:-1], HUMANML3D.parents[:-1], HUMANML3D.offsets[:-1])
    with pytest.raises(InvalidInput) as refused:
        source_on(body, replace(clip, skeleton=less, rotations=rotations[:, :-1], ends=clip.ends[:-1]))
    assert refused.value.message == "the motion has no joint 'R_wrist'"
    assert refused.value.where == "humanml3d"


def test_reference_skeletons_are_pinned():
    assert {name: len(reference_rig(name)) for name in REFERENCES} == {"mixamo": 65, "ue4": 68, "humanik": 72}
    for name in REFERENCES:
        assert np.abs(np.linalg.norm(reference_rig(name).orientations, axis=-1) - 1).max() < 1e-9


def test_the_rig_of_a_skeleton_stands_on_the_floor():
    for skeleton in SKELETONS.values():
        offsets = skeleton.offsets.copy()
        offsets[0, 1] += 0.3
        rig = rig_of(skeleton.with_offsets(offsets))
        assert rig.positions[:, 1].min() == pytest.approx(0.0, abs=1e-6)


def test_a_motion_that_is_not_finite_is_not_put_on_a_rig():
    root = WALK.root.copy()
    root[3, 1] = np.inf
    with pytest.raises(InvalidInput, match=r"^humanml3d: the motion holds NaN or infinite numbers"):
        retarget(source_of(replace(WALK, root=root)), load_body("mixamo"))


@pytest.mark.parametrize("name", REFERENCES)
def test_both_sides_of_a_reference_skeleton_are_mirrored(name):
    rig = reference_rig(name)
    axes, mirror = to_matrix(rig.orientations), np.array([-1.0, 1.0, 1.0])
    pairs = [(joint, rig.index(rig.joint_names[other])) for joint, other in enumerate(mirror_by_name(rig.joint_names))]
    sided = [(left, right) for left, right in pairs if left != right and "ik_hand" not in rig.joint_names[left]]
    assert len(sided) > 30
    for left, right in sided:
        np.testing.assert_allclose(rig.positions[right], rig.positions[left] * mirror, atol=1e-9)
        turned = np.abs(np.einsum("ia,ia->a", axes[right], mirror[:, None] * axes[left]))
        np.testing.assert_allclose(turned, 1.0, atol=1e-6, err_msg=rig.joint_names[left])
