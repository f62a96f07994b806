"""T-pose and A-pose of SnapMoGen's rig."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

from marey.cli.main import app
from marey.core.errors import InvalidInput
from marey.motion.body import standard_body
from marey.motion.clip import MotionClip
from marey.motion.io.bvh import format_bvh, parse_bvh, read_bvh
from marey.motion.kinematics import bone_lengths, forward_kinematics
from marey.motion.rest_pose import A_POSES, change_rest_pose
from marey.motion.rotations import angle_between, to_euler
from marey.motion.skeleton import HUMANML3D, SNAPMOGEN
from tests.support.rigged import rigged
from tests.support.walker import walker
from tests.unit.motion.test_rig_features import published_motion

CM = 0.01


def clip_of(rotations, root, skeleton=SNAPMOGEN) -> MotionClip:
    return MotionClip.of(skeleton, rotations, root, np.zeros((len(root), 4), bool), 30)


def test_the_a_pose_moves_joints_as_published():
    rotations, root = published_motion()
    before = forward_kinematics(SNAPMOGEN, rotations, root)
    clip = change_rest_pose(clip_of(rotations, root), "a")
    after = forward_kinematics(clip.skeleton, clip.rotations, clip.root)
    off = np.linalg.norm(after - before, axis=-1).max(axis=0) / CM
    assert off.argmax() == SNAPMOGEN.index("R_hand0001_bind_JNT")
    assert off.max() == pytest.approx(0.186, abs=1e-3)
    assert off[[3, 4, 5, 6, 7, 11]] == pytest.approx(0.081, abs=1e-3)
    assert off[[19, 23]] == pytest.approx(0.069, abs=1e-3)
    assert off[[0, 1, 2, 15, 16, 17, 18, 20, 21, 22]] == pytest.approx(0.0, abs=1e-3)
    np.testing.assert_allclose(to_euler(clip.rotations[20, 8], "XYZ"), [12.9844, -9.4368, 30.0846], atol=1e-3)
    np.testing.assert_allclose(after[20, 10] / CM, [59.8904, 71.5526, -18.5299], atol=1e-3)


def test_a_written_a_pose_is_read_again():
    clip = change_rest_pose(clip_of(*published_motion()), "a")
    read = parse_bvh(format_bvh(clip).encode(), rest_frame="keep")
    order = [read.skeleton.joint_names.index(name) for name in SNAPMOGEN.joint_names]
    joints = forward_kinematics(clip.skeleton, clip.rotations, clip.root)
    assert np.linalg.norm(read.joints()[:, order] - joints, axis=-1).max() < 1.5e-4 * CM


@pytest.mark.parametrize("skeleton", [SNAPMOGEN, standard_body(SNAPMOGEN).skeleton], ids=["rig", "standard"])
def test_a_and_back_is_the_same_motion(skeleton):
    rotations, root = rigged(1, 30)
    clip = clip_of(rotations, root, skeleton)
    other = change_rest_pose(clip, "a")
    size = float(np.linalg.norm(skeleton.offsets[9]) / np.linalg.norm(SNAPMOGEN.offsets[9]))
    np.testing.assert_allclose(other.offsets[1:], size * A_POSES["snapmogen"][1:], atol=1e-5 * size)
    np.testing.assert_allclose(other.joints, clip.joints, atol=2.5e-3 * size)
    back = change_rest_pose(other, "t")
    np.testing.assert_allclose(back.offsets, clip.offsets, atol=1e-6)
    assert np.degrees(angle_between(back.rotations.astype(float), rotations)).max() < 0.05
    np.testing.assert_allclose(back.joints, clip.joints, atol=1e-5)


def test_bones_of_a_clip_fit_its_skeleton_after_the_change():
    clip = change_rest_pose(clip_of(*rigged(2, 10)), "a")
    lengths = np.linalg.norm(clip.offsets, axis=1) * (np.arange(24) > 0)
    np.testing.assert_allclose(bone_lengths(clip.joints, SNAPMOGEN)[3], lengths, atol=1e-6)


def test_a_skeleton_without_an_a_pose_is_refused():
    with pytest.raises(InvalidInput, match=r"^humanml3d: .*no A-pose") as error:
        change_rest_pose(walker(), "a")
    assert "snapmogen" in (error.value.hint or "")


def test_the_command_line_writes_and_reads_the_a_pose(tmp_path):
    clip_of(*rigged(3, 20)).save_npz(tmp_path / "a.npz")
    run = CliRunner()
    written = run.invoke(app, ["convert", str(tmp_path / "a.npz"), str(tmp_path / "b.bvh"), "--rest-pose", "a"])
    assert written.exit_code == 0, written.output
    arm = read_bvh(tmp_path / "b.bvh").skeleton
    np.testing.assert_allclose(
        arm.offsets[arm.index("L_armLower0001_bind_JNT")] / CM, [15.2659, -6.5521, -0.0582], atol=1e-3
    )
    read = ["convert", str(tmp_path / "b.bvh"), str(tmp_path / "c.bvh"), "--from-rest-pose", "a"]
    assert run.invoke(app, read).exit_code == 0
    arm = read_bvh(tmp_path / "c.bvh").skeleton
    np.testing.assert_allclose(arm.offsets[arm.index("L_armLower0001_bind_JNT")] / CM, [16.585, 0, 0.0015], atol=1e-3)
    walker().save_npz(tmp_path / "w.npz")
    refused = run.invoke(app, ["convert", str(tmp_path / "w.npz"), str(tmp_path / "w.bvh"), "--rest-pose", "a"])
    assert refused.exit_code != 0
    assert not (tmp_path / "w.bvh").exists()
    assert HUMANML3D.name not in A_POSES
