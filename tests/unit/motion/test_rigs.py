from __future__ import annotations

import numpy as np
import pytest

from marey.exporters.convert import convert
from marey.motion.clip import load_npz
from marey.motion.feet import find_contacts
from marey.motion.io.bvh import BvhClip, write_bvh
from marey.motion.kinematics import facing
from marey.motion.rigs.landmarks import feet_and_facing
from marey.motion.rotations import about, multiply, rotate
from marey.motion.skeleton import HUMANML3D, SNAPMOGEN, Skeleton, mirror_by_name
from tests.support.walker import walker

# Thigh, knee, ankle, toe, collar bone, upper arm, lower arm, hand of the left side
RIGS = {
    "mixamo": "mixamorig:LeftUpLeg mixamorig:LeftLeg mixamorig:LeftFoot mixamorig:LeftToeBase mixamorig:LeftShoulder "
    "mixamorig:LeftArm mixamorig:LeftForeArm mixamorig:LeftHand",
    "unreal": "thigh_l calf_l foot_l ball_l clavicle_l upperarm_l lowerarm_l hand_l",
    "rigify": "thigh.L shin.L foot.L toe.L shoulder.L upper_arm.L forearm.L hand.L",
    "lafan": "LeftUpLeg LeftLeg LeftFoot LeftToe LeftShoulder LeftArm LeftForeArm LeftHand",
    "smpl": "L_Hip L_Knee L_Ankle L_Foot L_Collar L_Shoulder L_Elbow L_Wrist",
    "bandai": "UpperLeg_L LowerLeg_L Foot_L Toes_L Shoulder_L UpperArm_L LowerArm_L Hand_L",
    "iclone": "CC_Base_L_Thigh CC_Base_L_Calf CC_Base_L_Foot CC_Base_L_ToeBase CC_Base_L_Clavicle CC_Base_L_Upperarm "
    "CC_Base_L_Forearm CC_Base_L_Hand",
}


def rig(left: str) -> Skeleton:
    """HumanML3D's body under other names, the right side first."""
    joints = ["hip", "knee", "ankle", "foot", "collar", "shoulder", "elbow", "wrist"]
    right = left.replace("Left", "Right").replace("_L_", "_R_").replace("L_", "R_")
    right = (
        right.replace("_l", "_r").replace(".L", ".R") if "_l " in left or ".L" in left else right.replace("_L", "_R")
    )
    names = list(HUMANML3D.joint_names)
    for own, side, other in zip(joints, left.split(), right.split(), strict=True):
        names[HUMANML3D.index(f"L_{own}")], names[HUMANML3D.index(f"R_{own}")] = side, other
    assert len(set(names)) == 22
    return Skeleton("x", tuple(names), HUMANML3D.parents, HUMANML3D.offsets, mirror_by_name(tuple(names)))


@pytest.mark.parametrize("name", RIGS)
def test_feet_and_facing_are_found_in_the_rigs_people_use(name):
    assert feet_and_facing(rig(RIGS[name])) == (HUMANML3D.feet, HUMANML3D.facing)


def test_our_own_are_found_too():
    for skeleton in (HUMANML3D, SNAPMOGEN):
        assert feet_and_facing(skeleton) == (skeleton.feet, skeleton.facing)


def test_nothing_is_made_up():
    names = ("root", "a_l", "a_r", "tail")
    assert feet_and_facing(Skeleton("x", names, (-1, 0, 0, 0), np.zeros((4, 3), np.float32), (0, 2, 1, 3))) == ((), ())


def test_a_bvh_of_another_rig_becomes_a_clip_that_faces_z_with_contacts(tmp_path):
    clip = walker(seconds=4)
    rotations = clip.rotations.astype(float)
    rotations[:, 0] = multiply(about("Y", 2.0), rotations[:, 0])
    root = rotate(about("Y", 2.0), clip.root.astype(float))
    skeleton = rig(RIGS["lafan"])
    write_bvh(tmp_path / "a.bvh", BvhClip(skeleton, rotations, root, None, 20.0, np.full((22, 3), np.nan)))
    assert convert(tmp_path / "a.bvh", tmp_path / "b.npz") == ()
    with np.load(tmp_path / "b.npz") as file:
        joints, names, contacts = file["joints"].astype(float), list(file["names"]), file["contacts"]
    order = [names.index(n) for n in skeleton.joint_names]
    np.testing.assert_allclose(facing(joints[0, order], HUMANML3D), [0, 0, 1], atol=1e-5)
    assert contacts.any()
    np.testing.assert_array_equal(contacts, find_contacts(clip.joints, HUMANML3D, 20))
    assert load_npz(tmp_path / "b.npz").frames == clip.frames
